"""The first page is the README, with its links as they are inside the documentation."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

_MARK = "<!-- readme -->"
_ROOT = Path(__file__).parents[2]


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the README where a page asks for it."""
    if _MARK not in markdown:
        return markdown
    text = (_ROOT / "README.md").read_text(encoding="utf-8")
    return markdown.replace(_MARK, for_documentation(text))


def for_documentation(text: str) -> str:
    """The text of the README with links from `docs/`, and without links to files outside of it."""
    inside = text.replace("](docs/", "](")
    return re.sub(r"\[([^\]]+)\]\((?:LICENSE|CITATION\.cff|CONTRIBUTING\.md)\)", r"`\1`", inside)
