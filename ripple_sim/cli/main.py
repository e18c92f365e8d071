"""The `ripple-sim` program: reads the command line, runs a command, turns errors into one line and an exit status.

Exit status: 0 done, 1 something failed, 2 bad input, 130 interrupted, 143 terminated.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .signals import INTERRUPTED, TERMINATED, end_at_once, end_in_good_order

DONE, FAILED, BAD_INPUT = 0, 1, 2

_DESCRIPTION = "Surface ripples on any genus-0 mesh, driven by the contact forces of a MuJoCo simulation."


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program with the arguments `argv` (by default the process's own) and return its exit status."""
    end_at_once()
    command = _parse(list(sys.argv[1:] if argv is None else argv))
    if isinstance(command, int):
        return command
    os.environ.setdefault("MUJOCO_GL", "disable")  # MuJoCo's own renderer would take the OpenGL context away

    from ripple_sim.errors import DisplayError, EncodingError
    from ripple_sim.solver.errors import GLError, RippleError

    end_in_good_order()
    try:
        command.run()
        sys.stdout.flush()
    except OSError as error:
        # standard output has failed (a full disk, a reader that has stopped): nothing more goes there, not even at exit
        sys.stdout = Path(os.devnull).open("w")  # noqa: SIM115
        return FAILED if isinstance(error, BrokenPipeError) else _fail(error.strerror or error, FAILED)
    except (GLError, DisplayError, EncodingError) as error:  # nothing that other input would cure
        return _fail(error, FAILED)
    except RippleError as error:
        return _fail(error, BAD_INPUT)
    except KeyboardInterrupt as ending:
        return _fail("interrupted", INTERRUPTED, ending)
    except SystemExit as ending:
        if ending.code != TERMINATED:
            raise
        return _fail("terminated", TERMINATED, ending)
    return DONE


def _fail(message: object, status: int, ending: BaseException | None = None) -> int:
    """Print a message, with the notes of the exception that ended the command, in one line; return the status."""
    notes = getattr(message if ending is None else ending, "__notes__", [])
    print(f"ripple-sim: {' '.join('; '.join([str(message), *notes]).split())}", file=sys.stderr)
    return status


def _parse(argv: list[str]) -> Any:
    """Return the command to run, or the exit status if there is nothing to run."""
    # here, where the signals are taken care of: it takes a third of a second
    import tyro.conf
    import tyro.extras

    from .commands import COMMANDS

    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return tyro.extras.subcommand_cli_from_dict(
                COMMANDS,
                prog="ripple-sim",
                description=_DESCRIPTION,
                args=argv,
                config=(tyro.conf.FlagCreatePairsOff,),
            )
    except SystemExit as ending:
        if not ending.code:
            return DONE
        return _fail(_first_part(complaint.getvalue()), BAD_INPUT)


def _first_part(box: str) -> str:
    """Reduce tyro's complaint to what stands between its first two rules, without the help texts (indented by 8).

    It is a title, a rule, what is wrong, a rule, and hints; framed where stdout is UTF-8.
    """
    text = re.sub(r"\x1b\[[0-9;]*m", "", box)
    parts = re.split(r"^[│╭╰ ]*(?:─ .* ─+|─{3,}|-{3,})[│╮╯ ]*$", text, flags=re.MULTILINE)
    part = parts[1] if len(parts) > 1 else text
    said = [line.strip("│ ") for line in part.splitlines() if not re.match(r"│? {9}", line)]
    program = re.search(r"ripple-sim(?: [a-z]+)? --help", text)
    return f"{' '.join(said).strip().rstrip('.')}; see {program[0] if program else 'ripple-sim --help'}"
