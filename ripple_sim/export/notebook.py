"""Pages inside a notebook."""

from __future__ import annotations

import html
from pathlib import Path

_HEIGHT = 420  # [pixels]


def framed(page: Path, aspect: float) -> str:
    """A page as HTML to be shown within another, `aspect` times as wide as high."""
    source = html.escape(page.read_text(encoding="utf-8"), quote=True)
    size = f'width="{round(_HEIGHT * aspect)}" height="{_HEIGHT}"'
    return f'<iframe srcdoc="{source}" {size} style="border: 0; max-width: 100%" allowfullscreen></iframe>'
