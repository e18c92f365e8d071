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
        r"\$\$(.+?)\$\$",
        lambda m: f'<div class="equation">{_block(m[1])}</div>',
        text,
        flags=re.DOTALL,
    )
    # in a span: at the beginning of a line Markdown takes <math> for a block, and ends the list
    # that it is in
    return re.sub(
        r"\$([^$\n]+)\$", lambda m: f"<span>{latex2mathml.converter.convert(m[1])}</span>", text
    )


def _block(formula: str) -> str:
    """A formula on a line of its own, as MathML."""
    return latex2mathml.converter.convert(formula.strip(), "block")
