"""From the words of a command line to a command.

A command is a class: its fields are the arguments, the docstrings the help, and `run` does the work. Heavy imports are
inside `run`, so that `--help` and usage errors are answered at once.
"""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Callable, Sequence
from typing import Any

import tyro.conf
import tyro.extras

from .atlas import Atlas
from .batch import Batch
from .bench_command import Bench
from .cache_command import Cache
from .completion_command import Completion
from .export_command import Export
from .info import Materials
from .info_command import Info
from .render import Drop, Render
from .view_command import View

COMMANDS: dict[str, Callable[..., Any]] = {
    "render": Render,
    "drop": Drop,
    "export": Export,
    "batch": Batch,
    "atlas": Atlas,
    "info": Info,
    "bench": Bench,
    "view": View,
    "materials": Materials,
    "cache": Cache,
    "completion": Completion,
}

_DESCRIPTION = "Surface ripples on any mesh, driven by the contact forces of a MuJoCo simulation."


class UsageError(Exception):
    """The command line is invalid; the message says where, and names the help."""


def parse(argv: Sequence[str]) -> Any:
    """Return the command to run, or None if the help or a completion script was printed instead.

    Raises
    ------
    UsageError
    """
    command = _parse(argv)
    if isinstance(command, Completion):  # which tyro makes from all the commands
        command = _parse(["--tyro-print-completion", command.shell])
    return command


def _parse(argv: Sequence[str]) -> Any:
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return tyro.extras.subcommand_cli_from_dict(
                COMMANDS,
                prog="ripple-sim",
                description=_DESCRIPTION,
                args=list(argv),
                config=(tyro.conf.FlagCreatePairsOff,),
            )
    except SystemExit as ending:
        if ending.code:
            command = f" {argv[0]}" if argv and argv[0] in COMMANDS else ""
            raise UsageError(f"{_first_part(complaint.getvalue())}; see ripple-sim{command} --help") from None
        return None


def _first_part(box: str) -> str:
    """Reduce tyro's complaint to the text between its first two rules, without the help texts (indented by 8).

    A complaint is a title, a rule, what is wrong, a rule, and hints; it is framed where stdout is UTF-8.
    """
    text = re.sub(r"\x1b\[[0-9;]*m", "", box)
    parts = re.split(r"^[│╭╰ ]*(?:─ .* ─+|─{3,}|-{3,})[│╮╯ ]*$", text, flags=re.MULTILINE)
    part = parts[1] if len(parts) > 1 else text
    said = [line.strip("│ ") for line in part.splitlines() if not re.match(r"│? {9}", line)]
    return " ".join(said).strip().rstrip(".")
