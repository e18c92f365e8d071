"""The errors that a caller may catch, all of them `RippleError`, and checks that raise them.

`checked` checks the arguments of a public function; its message names the argument, its value and
the valid values. Warnings name the line of the user's program that called into this package.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
import numbers
import os
import threading
import typing
import warnings
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Any, ParamSpec, TypeVar

import msgspec

_MAX_SHOWN_CHARACTERS = 120  # of a value in a message

# Packages whose frames are not the user's: this package, and packages that run its context
# managers, threads and processes.
_INTERNAL_PACKAGES = ("ripple_sim", "contextlib", "threading", "concurrent", "multiprocessing")

# File and line that a warning names where no line of the user is known.
_NO_LINE = ("ripple_sim", 0)


class RippleError(Exception):
    """Root of all errors that ripple-sim raises on purpose.

    The message says what was wrong, what is expected, the value, and what to do.
    """


class MeshError(RippleError):
    """The mesh cannot be read, is no surface, or does not suit the layout."""


class SphereMapError(RippleError):
    """No certified (fold-free, covering) sphere map was found for the mesh."""


class AtlasError(RippleError):
    """An atlas file or an atlas parameter is invalid."""


class SolverError(RippleError):
    """A wave parameter is invalid, or the wave field is no longer finite."""


class GLError(RippleError, RuntimeError):
    """No usable OpenGL context, or the driver reported an error."""


class RippleWarning(UserWarning):
    """Something runs, but not as expected, for instance a body too fast for the time step."""


Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

# Its attribute `user_line` is the line of the user's program for which the thread works.
_thread = threading.local()

# Warnings without a frame of the user that were shown, as Python keeps them for each module.
_shown_warnings: dict[Any, Any] = {}


@dataclasses.dataclass(frozen=True)
class Valid:
    """A condition on an argument, and the words for it: "must be ..."."""

    holds: Callable[[Any], bool]
    words: str


def is_finite(value: object) -> bool:
    """Whether a value is a number that a float can hold, neither NaN nor infinite."""
    try:
        return isinstance(value, numbers.Real) and math.isfinite(float(value))
    except OverflowError:
        return False


def _is_path(value: object) -> bool:
    try:
        path = os.fspath(value)  # type: ignore[call-overload]
    except TypeError:
        return False
    return isinstance(path, str) and "\0" not in path


POSITIVE = Valid(lambda value: is_finite(value) and value > 0, "a finite number greater than 0")
FUNCTION = Valid(lambda value: value is None or callable(value), "a function, or None")
PATH = Valid(_is_path, "a path: a str or pathlib.Path without a NUL")


def whole(least: int) -> Valid:
    """A whole number from `least` on."""
    return Valid(
        lambda x: isinstance(x, numbers.Integral) and int(x) >= least,
        f"a whole number, {least} or greater",
    )


def instance(kind: type, hint: str = "", *, optional: bool = False) -> Valid:
    """An instance of a class, or None where it is optional, with a hint where to get one."""
    article = "an" if kind.__name__[0] in "AEIO" else "a"
    return Valid(
        lambda x: isinstance(x, kind) or (optional and x is None),
        f"{article} {kind.__name__}{hint}",
    )


def check_fields(error: type[RippleError], record: Any, **valid: Valid) -> None:
    """Check the fields of a dataclass by their annotations, and some fields by further conditions.

    The conditions `valid` are by field name, and hold for values that are not None. Raises `error`
    for the first field that is not valid.
    """
    for name, hint in typing.get_type_hints(type(record)).items():
        value = getattr(record, name)
        try:
            msgspec.convert(value, hint)
        except msgspec.ValidationError:
            raise error(
                f"{name.replace('_', ' ')} must be {_words(hint)}, got {shown(value)}"
            ) from None
        if name in valid and value is not None and not valid[name].holds(value):
            raise error(f"{name.replace('_', ' ')} must be {valid[name].words}, got {shown(value)}")


def _words(hint: Any) -> str:
    """The values that an annotation allows, in the words of a message: "int or None"."""
    kind = typing.get_origin(hint)
    inner = typing.get_args(hint)
    if kind is typing.Literal:
        return " or ".join(map(repr, inner))
    if kind is tuple:
        return f"({', '.join(map(_words, inner))})"
    if kind is Sequence:
        return f"a list of {_words(inner[0])}"
    if hint is type(None):
        return "None"
    if inner:
        return " or ".join(map(_words, inner))
    return hint.__name__


def shown(value: object) -> str:
    """A value as messages show it, cut off if it is long."""
    try:
        text = repr(value)
    except Exception:  # raised by the value's own method, or by an int of too many digits
        text = f"a value of type {type(value).__name__}"
    return text if len(text) <= _MAX_SHOWN_CHARACTERS else f"{text[:_MAX_SHOWN_CHARACTERS]} ..."


def user_line() -> tuple[str, int]:
    """File and number of the line in the user's program that called into this package."""
    frame, _ = _user_frame()
    if frame is None:
        return getattr(_thread, "user_line", _NO_LINE)
    return frame.f_code.co_filename, frame.f_lineno


def work_for(line: tuple[str, int]) -> None:
    """Let warnings of this thread name a line of the user's program.

    It is the line of the call that gave this thread or process its work.
    """
    _thread.user_line = line


def warn_caller(message: str, category: type[Warning] = RippleWarning) -> None:
    """Warn at the user's line that called into this package."""
    frame, level = _user_frame()
    if frame is None:
        warnings.warn_explicit(message, category, *user_line(), registry=_shown_warnings)
    else:
        warnings.warn(message, category, stacklevel=level)


def _user_frame() -> tuple[FrameType | None, int]:
    """The innermost frame of the user on this stack, and its number of frames above the caller's.

    The frame is None if there is no frame of the user.
    """
    frame = inspect.currentframe()
    level = 0
    while frame and frame.f_globals.get("__name__", "").split(".")[0] in _INTERNAL_PACKAGES:
        frame = frame.f_back
        level += 1
    return frame, level


def deprecated(old: str, instead: str, goes: str) -> None:
    """Warn at the user's line that `old` is deprecated: it works until the version `goes`."""
    warn_caller(f"{old} is deprecated and goes with {goes}; use {instead}", DeprecationWarning)


def checked(
    error: type[RippleError], **valid: Valid
) -> Callable[[Callable[Parameters, Result]], Callable[Parameters, Result]]:
    """Decorate a function so that arguments are checked before it runs.

    `valid` has conditions by the name of the argument. An argument that is not valid raises
    `error`. A wrong number of arguments, or a wrong name, is Python's TypeError.
    """

    def decorate(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
        signature = inspect.signature(function)

        @functools.wraps(function)
        def checking(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
            arguments = signature.bind(*args, **kwargs).arguments
            for name, condition in valid.items():
                if name in arguments and not condition.holds(arguments[name]):
                    raise error(
                        f"{name.replace('_', ' ')} must be {condition.words}, got "
                        f"{shown(arguments[name])}"
                    )
            return function(*args, **kwargs)

        return checking

    return decorate
