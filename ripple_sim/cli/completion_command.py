"""`ripple-sim completion`."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Literal

from tyro.conf import Positional, arg


@dataclasses.dataclass(frozen=True, kw_only=True)
class Completion:
    """Print a shell completion script. To use it: source <(ripple-sim completion bash)."""

    shell: Annotated[Positional[Literal["bash", "zsh"]], arg(metavar="SHELL")]
    """Shell to complete in: bash or zsh."""
