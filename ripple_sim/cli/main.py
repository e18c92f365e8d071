"""The `ripple-sim` program: reads the command line, runs a command, turns errors into one line and an exit status.

A command is a class: its fields are the arguments, the docstrings the help, and `run` does the
work. Heavy imports are inside `run`, so that `--help` and usage errors are answered at once. Exit
status: 0 done, 1 something failed, 2 bad input, 128 + a signal's number after one.
"""

from __future__ import annotations

import contextlib
import difflib
import io
import logging
import os
import re
import resource
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro.conf
import tyro.extras
from tyro.conf import Positional, arg

from ripple_sim import __version__
from ripple_sim.solver.errors import RippleError, shown

from .render import DropCommand, ExportCommand, RenderCommand, ViewCommand
from .reports import BatchCommand, BenchCommand, CacheCommand, InfoCommand, MaterialsCommand
from .signals import INTERRUPTED, end_at_once, end_in_good_order, word_of
from .surfaces import AtlasCommand, ModesCommand

DONE = 0
FAILED = 1
BAD_INPUT = 2

_LONGEST = 800  # of a message [characters]

# Address space [GB] that a small job takes, with its libraries, software OpenGL and kernels: with
# less, these end the process, or blame something else.
_ADDRESS_SPACE = {
    InfoCommand: 1.3,
    AtlasCommand: 1.2,
    ModesCommand: 1.2,
    BenchCommand: 2.4,
    RenderCommand: 2.4,
    DropCommand: 2.4,
    ViewCommand: 2.4,
    BatchCommand: 2.4,
    ExportCommand: 3.0,
}

_DESCRIPTION = (
    "Surface ripples on any mesh, driven by the contact forces of a MuJoCo simulation. "
    "--version tells which."
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program with the arguments `argv` (by default the process's own) and return its exit status."""
    end_at_once()
    _open_standard_streams()
    argv = list(sys.argv[1:] if argv is None else argv)
    if any("\0" in word for word in argv):
        return _fail("a word of the command line holds a NUL; no name can", BAD_INPUT)
    try:
        command = parse(argv)
        sys.stdout.flush()  # of the help, the version or a completion script
    except RippleError as error:
        return _fail(error, BAD_INPUT)
    except OSError as error:
        return _give_up_output(error)
    if command is None:
        return DONE
    with warnings.catch_warnings():
        # in one line, without the place in the code
        warnings.showwarning = lambda message, *_, **__: _say(f"warning: {message}")
        return _run(command)


def _run(command: Any) -> int:
    """Run a command and return the exit status."""
    need = _ADDRESS_SPACE.get(type(command), 0)
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    if resource.RLIM_INFINITY != most < 1e9 * need:
        text = (
            f"this needs {need} GB of address space, but the limit (ulimit -v) is "
            f"{most / 1e9:.2f} GB; allow more"
        )
        return _fail(text, FAILED)
    # MuJoCo's own renderer would take the OpenGL context away
    os.environ.setdefault("MUJOCO_GL", "disable")
    log = logging.getLogger("ripple_sim")
    if not log.handlers:
        log.addHandler(_Log())

    from ripple_sim.errors import DisplayError, EncodingError
    from ripple_sim.solver.errors import GLError
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
        failed = isinstance(cause, ConnectionError) or (
            isinstance(cause, OSError) and cause.errno in OF_THE_DISK
        )
        return _fail(error, FAILED if failed else BAD_INPUT)
    except MemoryError as error:
        return _fail(
            (
                f"not enough memory{f': {error}' if str(error) else ''}; ask for a lower "
                f"resolution "
                f"or "
                f"size"
            ),
            FAILED,
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


def _say(message: str) -> None:
    """Print a message on standard error, without line ends and long words, such as a name of thousands of letters."""
    text = " ".join(re.sub(r"(\S{120})\S{80,}", r"\1...", message).split())
    text = text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ..."
    try:
        print(f"ripple-sim: {text}", file=sys.stderr, flush=True)
    except (
        OSError
    ):  # standard error is full, or a closed pipe: nothing more goes there, not even at exit
        sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115


class _Log(logging.Handler):
    """Prints what is logged, that something takes long, as the program's lines."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print it."""
        _say(record.getMessage())


def _open_standard_streams() -> None:
    """Where the caller has closed one of them, open the null device: an output file would take its number."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free, this one
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w" if number else "r"))  # noqa: SIM115


def completion(
    shell: Annotated[
        Positional[Literal["bash", "zsh"]],
        arg(metavar="SHELL", help="Shell to complete in: bash or zsh."),
    ],
) -> None:
    """Print a shell completion script. To use it: source <(ripple-sim completion bash)."""
    parse(["--tyro-print-completion", shell])


COMMANDS: dict[str, Callable[..., Any]] = {
    "render": RenderCommand,
    "drop": DropCommand,
    "export": ExportCommand,
    "batch": BatchCommand,
    "atlas": AtlasCommand,
    "modes": ModesCommand,
    "info": InfoCommand,
    "bench": BenchCommand,
    "view": ViewCommand,
    "materials": MaterialsCommand,
    "cache": CacheCommand,
    "completion": completion,
}


def parse(argv: Sequence[str]) -> Any:
    """Return the command to run, or None if the help, the version or a completion script was printed instead.

    Raises `RippleError` where it is invalid, which says where, and names the help.
    """
    if list(argv) == ["--version"]:
        print(f"ripple-sim {__version__}")
        return None
    if argv and not argv[0].startswith("-") and argv[0] not in COMMANDS:
        near = _nearest(argv[0], COMMANDS)
        names = ", ".join(COMMANDS)
        raise RippleError(
            f"there is no command {shown(argv[0])}{near}; commands are {names}; see ripple-sim "
            f"--help"
        )
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
        if not ending.code:
            return None
    # tyro's complaint is a title, a rule, what is wrong, a rule, and hints; it is framed where
    # stdout is UTF-8. What is between the first two rules counts, without the help texts (indented
    # by 8).
    text = re.sub(r"\x1b\[[0-9;]*m", "", complaint.getvalue())
    parts = re.split(r"^[│╭╰ ]*(?:─ .* ─+|─{3,}|-{3,})[│╮╯ ]*$", text, flags=re.MULTILINE)
    part = parts[1] if len(parts) > 1 else text
    said = " ".join(
        line.strip("│ ") for line in part.splitlines() if not re.match(r"│? {9}", line)
    ).strip()
    command = f" {argv[0]}" if argv else ""
    unknown = re.match(r"Unrecognized options: (--[\w-]+)", said)
    near = _nearest(unknown[1], _options_of(argv[0])) if unknown and argv else ""
    raise RippleError(f"{said.rstrip('.')}{near}; see ripple-sim{command} --help")


def _nearest(word: str, words: Iterable[str]) -> str:
    """A question that names the word that was probably meant, or nothing."""
    near = difflib.get_close_matches(word, list(words), n=1)
    return f" (did you mean {near[0]}?)" if near else ""


def _options_of(command: str) -> list[str]:
    """The options of a command, from its help."""
    with contextlib.redirect_stdout(io.StringIO()) as text:
        parse([command, "--help"])
    return re.findall(r"(?<![\w-])--[a-z][a-z-]*", text.getvalue())
