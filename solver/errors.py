"""The errors a caller may catch, every one of them a `RippleError`, and checks of arguments that raise them.

`checked` names the argument of a public function, its value and what is valid.
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

# Of a value in a message [characters].
_LONGEST = 120

# Packages whose frames are never the user's: this one, and what runs its context managers, threads
# and processes.
_NOT_THE_USERS = ("ripple_sim", "contextlib", "threading", "concurrent", "multiprocessing")

# What a warning names where no thread said for whom it works.
_NO_LINE = ("ripple_sim", 0)


class RippleError(Exception):
    """Root of all errors that ripple-sim raises on purpose.

    The message says what was wrong, the value, what is valid, and what to do.
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
    """Something runs, but not as expected: a hull off its surface, a body too fast for the time step."""


Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")
# `user_line`: the line that this thread works for.
_thread = threading.local()
# Which warnings without a frame of the user's were shown, as Python keeps it for each module.
_shown_warnings: dict[Any, Any] = {}


@dataclasses.dataclass(frozen=True)
class Valid:
    """A condition on an argument, and the words for it: "valid is ..."."""

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
    """Check the fields of a dataclass by their annotations, and those of these names, where they are not None, by more.

    Raises `RippleError` of the given kind, for the first that is not valid.
    """
    for name, hint in typing.get_type_hints(type(record)).items():
        value = getattr(record, name)
        try:
            msgspec.convert(value, hint)
        except msgspec.ValidationError:
            raise error(
                f"{name.replace('_', ' ')} is {shown(value)}; valid is {_words(hint)}"
            ) from None
        if name in valid and value is not None and not valid[name].holds(value):
            raise error(f"{name.replace('_', ' ')} is {shown(value)}; valid is {valid[name].words}")


def _words(hint: Any) -> str:
    """What an annotation allows, as a message says it: "int or None"."""
    kind = typing.get_origin(hint)
    inner = typing.get_args(hint)
    if kind is typing.Literal:
        return " or ".join(map(repr, inner))
    if kind is tuple:
        return f"({', '.join(map(_words, inner))})"
    if kind is Sequence:
        return f"a list of {_words(inner[0])}"
    return (
        "None"
        if hint is type(None)
        else " or ".join(map(_words, inner))
        if inner
        else hint.__name__
    )


def shown(value: object) -> str:
    """A value as messages show it, not at any length."""
    try:
        text = repr(value)
    except Exception:  # of the value's own, or an int of too many digits
        text = f"a value of type {type(value).__name__}"
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ..."


def user_line() -> tuple[str, int]:
    """File and number of the line in the user's program that called into this package."""
    frame, _ = _user_frame()
    if frame is None:
        return getattr(_thread, "user_line", _NO_LINE)
    return frame.f_code.co_filename, frame.f_lineno


def work_for(line: tuple[str, int]) -> None:
    """Let warnings of this thread name a line of another thread or process: that of the call which gave it the work."""
    _thread.user_line = line


def warn_caller(message: str, category: type[Warning] = RippleWarning) -> None:
    """Warn at the user's line that called into this package."""
    frame, level = _user_frame()
    if frame is None:
        warnings.warn_explicit(message, category, *user_line(), registry=_shown_warnings)
    else:
        warnings.warn(message, category, stacklevel=level)


def _user_frame() -> tuple[FrameType | None, int]:
    """The innermost frame of the user's on this stack, and how many frames above the caller's it is; or None."""
    frame = inspect.currentframe()
    level = 0
    while frame and frame.f_globals.get("__name__", "").split(".")[0] in _NOT_THE_USERS:
        frame = frame.f_back
        level += 1
    return frame, level


def deprecated(old: str, instead: str, goes: str) -> None:
    """Warn, from what the user calls, that it is deprecated: it still works, and goes with the version `goes`."""
    warn_caller(f"{old} is deprecated and goes with {goes}; use {instead}", DeprecationWarning)


def checked(
    error: type[RippleError], **valid: Valid
) -> Callable[[Callable[Parameters, Result]], Callable[Parameters, Result]]:
    """Decorate a function so that arguments of these names are checked before it runs; `error` is what is raised.

    A wrong number of arguments, or a wrong name, stays Python's TypeError.
    """

    def decorate(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
        signature = inspect.signature(function)

        @functools.wraps(function)
        def checking(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
            given = signature.bind(*args, **kwargs).arguments
            for name, each in valid.items():
                if name in given and not each.holds(given[name]):
                    raise error(
                        f"{name.replace('_', ' ')} is {shown(given[name])}; valid is {each.words}"
                    )
            return function(*args, **kwargs)

        return checking

    return decorate
