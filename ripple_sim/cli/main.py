"""The `ripple-sim` program: reads the command line and runs a command.

An error becomes one line on standard error and an exit status.

A command is a class: its fields are the arguments, their docstrings are the help texts, and `run`
does the work. Heavy imports are inside `run`, so that `--help` and usage errors are answered at
once. The exit status is 0 (done), 1 (something failed), 2 (bad input), or 128 + the number of the
signal that ended the command.
"""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import io
import logging
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, get_type_hints

import tyro.conf
import tyro.extras
from tyro.conf import Positional, arg

from ripple_sim import __version__
from ripple_sim.solver.errors import RippleError, shown
from ripple_sim.solver.memory import address_space_limit

from .render import DropCommand, ExportCommand, RenderCommand, ViewCommand
from .reports import BatchCommand, BenchCommand, CacheCommand, InfoCommand, MaterialsCommand
from .signals import INTERRUPTED, end_at_once, end_in_good_order, word_of
from .surfaces import AtlasCommand, ModesCommand

DONE = 0
FAILED = 1
BAD_INPUT = 2

# Length at which a message is cut [characters].
_MAX_MESSAGE_LENGTH = 800

# Address space that a small job takes, with its libraries, software OpenGL and kernels [GB]. With
# less the libraries end the process, or report another cause.
_ADDRESS_SPACE_BY_COMMAND = {
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
    "Surface ripples on any mesh, driven by the contact forces of a MuJoCo simulation. --version "
    "prints the version."
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program and return its exit status.

    The arguments `argv` are the process's own by default.
    """
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
    needed = _ADDRESS_SPACE_BY_COMMAND.get(type(command), 0)
    limit = address_space_limit()
    if limit < 1e9 * needed:
        text = (
            f"this needs {needed} GB of address space, but the limit (ulimit -v) is "
            f"{limit / 1e9:.2f} GB; allow more"
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
        reason = f": {error}" if str(error) else ""
        text = f"not enough memory{reason}; ask for a lower resolution or size"
        return _fail(text, FAILED)
    except KeyboardInterrupt as ending:
        return _fail("interrupted", INTERRUPTED, ending)
    except SystemExit as ending:
        status = ending.code if isinstance(ending.code, int) else 0
        word = word_of(status)
        if word is None:
            raise
        return _fail(word, status, ending)
    finally:
        end_at_once()
    return DONE


def _give_up_output(error: OSError) -> int:
    """Give up standard output, which has failed (full disk, closed pipe).

    Nothing more is written to it, not even at exit.
    """
    sys.stdout = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115
    return FAILED if isinstance(error, BrokenPipeError) else _fail(error.strerror or error, FAILED)


def _fail(message: object, status: int, ending: BaseException | None = None) -> int:
    """Print a message in one line, and return the status.

    The notes of the exception that ended the command follow the message.
    """
    notes = getattr(message if ending is None else ending, "__notes__", [])
    _say("; ".join([str(message), *notes]))
    return status


def _say(message: str) -> None:
    """Print a message on standard error, in one line.

    Words of more than 200 characters are cut, such as a very long file name.
    """
    text = " ".join(re.sub(r"(\S{120})\S{80,}", r"\1...", message).split())
    if len(text) > _MAX_MESSAGE_LENGTH:
        text = f"{text[:_MAX_MESSAGE_LENGTH]} ..."
    try:
        print(f"ripple-sim: {text}", file=sys.stderr, flush=True)
    except OSError:
        # standard error is full or a closed pipe: nothing more is written to it, not even at exit
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115


class _Log(logging.Handler):
    """Prints log records, such as that something takes long, as messages of the program."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record."""
        _say(record.getMessage())


def _open_standard_streams() -> None:
    """Open the null device for each standard stream that the caller has closed.

    Otherwise an output file would take the number of that stream.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free, this one
        if getattr(sys, name) is None:
            mode = "w" if number else "r"
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115


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
    """Return the command to run.

    None if the help, the version or a completion script was printed instead.

    Raises `RippleError` if a word is invalid; the message names the word and the help.
    """
    if list(argv) == ["--version"]:
        print(f"ripple-sim {__version__}")
        return None
    if argv and not argv[0].startswith("-") and argv[0] not in COMMANDS:
        suggestion = _suggestion(argv[0], COMMANDS)
        names = ", ".join(COMMANDS)
        raise RippleError(
            f"there is no command {shown(argv[0])}{suggestion}; commands are {names}; see "
            "ripple-sim --help"
        )
    if argv and {"-h", "--help"} & set(argv):
        _join_help_lines(COMMANDS.get(argv[0]))
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
    problem = _problem(complaint.getvalue())
    command = f" {argv[0]}" if argv else ""
    unknown = re.match(r"Unrecognized options: (--[\w-]+)", problem)
    suggestion = ""
    if unknown and argv:
        suggestion = _suggestion(unknown[1], _options_of(argv[0]))
    raise RippleError(f"{problem.rstrip('.')}{suggestion}; see ripple-sim{command} --help")


def _problem(complaint: str) -> str:
    """The problem that tyro complains of, in one line.

    tyro prints a title, a rule, the problem, a rule, and hints, in a frame if stdout is UTF-8. The
    text between the first two rules is the problem; help texts in it are indented by 8.
    """
    text = re.sub(r"\x1b\[[0-9;]*m", "", complaint)  # without colours
    sections = re.split(r"^[│╭╰ ]*(?:─ .* ─+|─{3,}|-{3,})[│╮╯ ]*$", text, flags=re.MULTILINE)
    section = sections[1] if len(sections) > 1 else text
    lines = [line for line in section.splitlines() if not re.match(r"│? {9}", line)]
    return " ".join(line.strip("│ ") for line in lines).strip()


def _suggestion(word: str, words: Iterable[str]) -> str:
    """A question with the one of `words` that is most like a word; empty if none is like it."""
    matches = difflib.get_close_matches(word, list(words), n=1)
    return f" (did you mean {matches[0]}?)" if matches else ""


def _join_help_lines(command: Any) -> None:
    """Let the help of a command flow: tyro would break its texts where the docstrings break."""
    if not isinstance(command, type):
        return
    import docstring_parser  # as tyro does

    types = get_type_hints(command, include_extras=True)
    for base in command.__mro__:
        if not dataclasses.is_dataclass(base):
            continue
        for field in docstring_parser.parse_from_object(base).params:
            text = field.description or ""
            if "\n" in text and field.arg_name in types:
                help_text = arg(help=" ".join(text.split()))
                command.__annotations__[field.arg_name] = Annotated[
                    types[field.arg_name], help_text
                ]


def _options_of(command: str) -> list[str]:
    """The options of a command, from its help."""
    with contextlib.redirect_stdout(io.StringIO()) as text:
        parse([command, "--help"])
    return re.findall(r"(?<![\w-])--[a-z][a-z-]*", text.getvalue())
