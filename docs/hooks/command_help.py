"""The help of every command, as the program prints it."""

from __future__ import annotations

import contextlib
import io
import os
import textwrap
from typing import Any

from ripple_sim.cli import COMMANDS, parse

_MARK = "<!-- commands -->"
# Columns of the help, which fit a page.
_WIDTH = 85


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Fill in the help of all commands on the page that asks for it."""
    return markdown.replace(_MARK, all_help()) if _MARK in markdown else markdown


def all_help() -> str:
    """A heading and the help of each command, in the order of `ripple-sim --help`."""
    return "\n\n".join(f"## {name}\n\n```\n{help_of(name)}\n```" for name in COMMANDS)


def help_of(command: str) -> str:
    """What `ripple-sim COMMAND --help` prints."""
    printed = io.StringIO()
    columns = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = str(_WIDTH)
    try:
        with contextlib.redirect_stdout(printed):
            parse([command, "--help"])
    finally:
        if columns is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = columns
    # tyro breaks the text of options, and not that of the command
    lines = [
        textwrap.fill(line, _WIDTH) if line[:1].strip() else line.rstrip()
        for line in printed.getvalue().splitlines()
    ]
    return "\n".join(lines).strip()
