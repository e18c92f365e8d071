"""Equations of the pages, `$...$` and `$$...$$` outside code, as MathML, which browsers draw."""

from __future__ import annotations

import re
from typing import Any

import latex2mathml.converter


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Turn a page's equations into MathML."""
    pieces = re.split(r"(```.*?```|`[^`\n]*`)", markdown, flags=re.DOTALL)
    return "".join(piece if piece.startswith("`") else _with_equations(piece) for piece in pieces)


def _with_equations(text: str) -> str:
    text = re.sub(
        r"\$\$(.+?)\$\$", lambda m: latex2mathml.converter.convert(m[1].strip(), "block"), text, flags=re.DOTALL
    )
    return re.sub(r"\$([^$\n]+)\$", lambda m: latex2mathml.converter.convert(m[1]), text)
