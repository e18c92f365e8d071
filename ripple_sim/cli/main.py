"""The `ripple-sim` program: reads the command line, runs a command, turns errors into one line and an exit status.

Exit status: 0 done, 1 something failed, 2 bad input, 128 + a signal's number after one.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .signals import INTERRUPTED, end_at_once, end_in_good_order, word_of

DONE, FAILED, BAD_INPUT = 0, 1, 2

_LONGEST = 800  # of a message [characters]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program with the arguments `argv` (by default the process's own) and return its exit status."""
    end_at_once()
    _open_standard_streams()
    command = _parse(list(sys.argv[1:] if argv is None else argv))
    if isinstance(command, int):
        return command
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        return _run(command)


def _run(command: Any) -> int:
    """Run a command and return the exit status."""
    os.environ.setdefault("MUJOCO_GL", "disable")  # MuJoCo's own renderer would take the OpenGL context away

    from ripple_sim.errors import DisplayError, EncodingError
    from ripple_sim.solver.errors import GLError, RippleError, shown
    from ripple_sim.solver.files import OF_THE_DISK, OF_THE_NAME

    end_in_good_order()
    try:
        command.run()
        sys.stdout.flush()
    except OSError as error:
        if error.filename is not None:  # not standard output, which has no name
            status = BAD_INPUT if error.errno in OF_THE_NAME else FAILED
            return _fail(f"{shown(os.fspath(error.filename))}: {error.strerror}", status)
        return _give_up_output(error)
    except (GLError, DisplayError, EncodingError) as error:  # other input would not help
        return _fail(error, FAILED)
    except RippleError as error:
        cause = error.__cause__
        full = isinstance(cause, OSError) and cause.errno in OF_THE_DISK
        return _fail(error, FAILED if full else BAD_INPUT)
    except MemoryError as error:
        return _fail(
            f"not enough memory{f': {error}' if str(error) else ''}; ask for a lower resolution or size", FAILED
        )
    except KeyboardInterrupt as ending:
        return _fail("interrupted", INTERRUPTED, ending)
    except SystemExit as ending:
        if not (isinstance(ending.code, int) and (word := word_of(ending.code))):
            raise
        return _fail(word, ending.code, ending)
    finally:
        end_at_once()
    return DONE


def _give_up_output(error: OSError) -> int:
    """Standard output has failed (full disk, closed pipe): nothing more goes there, not even at exit."""
    sys.stdout = Path(os.devnull).open("w")  # noqa: SIM115
    return FAILED if isinstance(error, BrokenPipeError) else _fail(error.strerror or error, FAILED)


def _fail(message: object, status: int, ending: BaseException | None = None) -> int:
    """Print a message, with the notes of the exception that ended the command, in one line; return the status."""
    notes = getattr(message if ending is None else ending, "__notes__", [])
    _say("; ".join([str(message), *notes]))
    return status


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """Print a warning in one line, without the place in the code: takes the place of `warnings.showwarning`."""
    _say(f"warning: {message}")


def _say(message: str) -> None:
    """Print a line on standard error."""
    try:
        print(f"ripple-sim: {_one_line(message)}", file=sys.stderr, flush=True)
    except OSError:  # standard error is full, or a closed pipe: nothing more goes there, not even at exit
        sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115


def _open_standard_streams() -> None:
    """Where the caller has closed one of them, open the null device: an output file would take its number."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free, this one
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w" if number else "r"))  # noqa: SIM115


def _one_line(message: str) -> str:
    """A message without line ends and long words, such as a name of thousands of letters."""
    text = " ".join(re.sub(r"(\S{120})\S{80,}", r"\1...", message).split())
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ..."


def _parse(argv: list[str]) -> Any:
    """Return the command to run, or the exit status if there is nothing to run."""
    # here, where the signals are handled: importing it takes a third of a second
    from .parser import UsageError, parse

    if any("\0" in word for word in argv):
        return _fail("a word of the command line holds a NUL; no name can", BAD_INPUT)
    try:
        command = parse(argv)
        sys.stdout.flush()  # of the help or a completion script
    except UsageError as error:
        return _fail(error, BAD_INPUT)
    except OSError as error:
        return _give_up_output(error)
    return DONE if command is None else command
