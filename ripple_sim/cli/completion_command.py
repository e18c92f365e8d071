"""`ripple-sim completion`."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Literal

from tyro.conf import Positional, arg


@dataclasses.dataclass(frozen=True, kw_only=True)
class Completion:
    """Print a script by which a shell completes commands and options: source <(ripple-sim completion bash)."""

    shell: Annotated[Positional[Literal["bash", "zsh"]], arg(metavar="SHELL")]
    """Which shell: bash or zsh."""

    def run(self) -> None:
        """Print the script, which tyro makes from the commands themselves."""
        from .main import main

        main(["--tyro-print-completion", self.shell])
