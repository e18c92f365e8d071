"""Checks of the waves' input, and a guard that the waves stay finite.

The guard names the source that was too large.
"""

from __future__ import annotations

import numbers
import sys

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SolverError, shown, whole

# Substeps of a step: a step that needs more is a mistake in a unit, and would run for ever.
_MAX_SUBSTEPS = 1_000_000
_ONE_OR_MORE = whole(1)

# Substeps between two checks of all heights. A check takes a fifth of a substep, so that the checks
# take less than a hundredth of the time. Reading the heights in between checks them as well.
CHECK_INTERVAL = 32

_MAX_FLOAT32 = float(np.finfo(np.float32).max)


def as_field(value: ArrayLike, name: str, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """A number, or an array of the given shape, as a float32 field [C, n, n].

    Raises `SolverError` if the array has another shape, or a value is not finite.
    """
    try:
        array = np.asarray(value, dtype=np.float32)
    except (TypeError, ValueError, OverflowError) as error:
        raise SolverError(
            f"{name} must be a number, or an array of shape {shape}, got {shown(value)}"
        ) from error
    if array.shape not in ((), shape):
        raise SolverError(f"{name} must be one number or have shape {shape}, got {array.shape}")
    array = np.broadcast_to(array, shape)
    if not np.isfinite(array).all():
        raise SolverError(
            f"{name} holds {(~np.isfinite(array)).sum()} values that are NaN or infinite"
        )
    return array


def require_finite(name: str, value: float, unit: str, least: float = -np.inf) -> None:
    """Raise `SolverError` unless a value is a finite number, of at least `least`."""
    largest = sys.float_info.max
    if not (isinstance(value, numbers.Real) and max(least, -largest) <= value <= largest):
        bound = "" if least == -np.inf else f", {least:g} or greater"
        raise SolverError(f"{name} must be a finite number{bound}, got {shown(value)} {unit}")


def count_substeps(dt: float, stable: float, requested: int | None) -> int:
    """Number of equal substeps for a step of dt [s], at most `stable` [s] long each.

    Parameters
    ----------
    dt, stable : float
        [s].
    requested : int or None
        The number that the caller wants; None: the fewest.

    Raises
    ------
    SolverError
        If the step would take far too many, or fewer are asked for than stability allows.
    """
    ratio = dt / stable * (1 - 1e-12)
    if not ratio < _MAX_SUBSTEPS:
        raise SolverError(
            f"a step must take at most {_MAX_SUBSTEPS} substeps, and a step of {dt:.4g} s would "
            f"take {ratio:.3g} substeps of the stable {stable:.4g} s: take shorter steps, or a "
            "material with slower waves"
        )
    fewest = max(1, int(np.ceil(ratio)))
    if requested is None:
        return fewest
    if not (_ONE_OR_MORE.holds(requested) and requested <= _MAX_SUBSTEPS):
        raise SolverError(
            f"substeps must be {_ONE_OR_MORE.words}, up to {_MAX_SUBSTEPS}, or None for the "
            f"fewest, got {shown(requested)}"
        )
    if requested < fewest:
        raise SolverError(
            f"{requested} substeps of {dt / max(requested, 1):.4g} s are longer than the stable "
            f"{stable:.4g} s; use {fewest} or more substeps, or leave the number out"
        )
    return requested


class FiniteGuard:
    """Reports once, with its place, time and source, that a field is no longer finite.

    The texels are at `positions`, [C, n, n, 3] [m].
    """

    def __init__(self, positions: NDArray[np.float64]) -> None:
        self._positions = positions
        self.clear()

    def clear(self) -> None:
        """Restart at rest."""
        self._fastest = -np.inf
        self._largest = ("", 0.0, "", 0.0)
        self._reported = False
        self._unchecked = 0

    def note(self, kind: str, value: float, unit: str, time: float, speed: float) -> None:
        """Remember a source if it is the largest so far.

        A source has a kind, a value with its unit, and a time [s], for instance "impulse", 2.0,
        "N s", 0.5. It gives a texel a speed [m/s].
        """
        if not speed <= self._fastest:
            self._fastest = speed
            self._largest = (kind, value, unit, time)

    def due(self, substeps: int) -> bool:
        """Whether the next check is due, after a number of further substeps."""
        self._unchecked += substeps
        if self._unchecked < CHECK_INTERVAL:
            return False
        self._unchecked = 0
        return True

    def check(self, field: NDArray[np.float32], name: str, time: float) -> None:
        """Raise `SolverError` if a field [C, n, n] is not finite, once."""
        if self._reported or np.isfinite(field.sum(dtype=np.float64)):
            return
        self._reported = True
        bad = ~np.isfinite(field)
        # bad values spread by a texel a substep on all sides, so they began in the middle
        places = self._positions[bad]
        middle = np.argmin(((places - places.mean(axis=0)) ** 2).sum(axis=1))
        chart, row, column = np.argwhere(bad)[middle]
        x, y, z = places[middle]
        where = f"at chart {chart}, row {row}, column {column}, ({x:.4g}, {y:.4g}, {z:.4g}) m"
        where += f" ({bad.sum()} of {bad.size} texels)"
        cause = "no source was given: the state held it"
        kind, value, unit, source_time = self._largest
        if kind:
            source = f"the {kind} of {value:.4g} {unit} at time {source_time:.6g} s"
            cause = f"the largest source is {source}, too much for float32: make it smaller"
        raise SolverError(
            f"{name} is no longer finite {where}, at time {time:.6g} s; {cause}, and `reset()` the "
            f"waves"
        )


def check_kick(velocities: NDArray[np.float64], impulse: float) -> float:
    """The largest of the velocities [m/s], [k], that an impulse [N s] gives to texels.

    Raises `SolverError` if the largest velocity is beyond float32.
    """
    fastest = float(np.abs(velocities).max(initial=0.0))
    if not fastest <= _MAX_FLOAT32:
        raise SolverError(
            f"impulse is {impulse:.4g} N s, which would move the surface at {fastest:.4g} m/s, "
            "beyond float32: give a smaller impulse, or the material a greater density"
        )
    return fastest
