"""Watches that the waves stay finite, and names the source that was too much for them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverError
from ..texels.atlas import Atlas
from .finite import where_not_finite

# A look at all heights takes a fifth of a substep: one in so many substeps is less than a hundredth. Nobody sees the
# heights in between without a look of their own.
EVERY = 32

_GREATEST = float(np.finfo(np.float32).max)


class Source(NamedTuple):
    """What was given to the waves: "impulse", 2.0, "N s"; when [s]; and how fast it moves a texel at most [m/s]."""

    kind: str
    value: float
    unit: str
    time: float
    speed: float

    def __str__(self) -> str:
        return f"the {self.kind} of {self.value:.4g} {self.unit} at time {self.time:.6g} s"


class FiniteGuard:
    """Reports once, with its place, time and source, that a field is no longer finite.

    Parameters
    ----------
    atlas : Atlas
    """

    def __init__(self, atlas: Atlas) -> None:
        self._atlas = atlas
        self.clear()

    def clear(self) -> None:
        """Begin anew, at rest."""
        self._largest: Source | None = None
        self._reported = False
        self._unseen = 0

    def note(self, source: Source) -> None:
        """Remember a source, if it is the largest."""
        if self._largest is None or not source.speed <= self._largest.speed:
            self._largest = source

    def due(self, substeps: int) -> bool:
        """Whether it is time for a look, after so many more substeps."""
        self._unseen += substeps
        if self._unseen < EVERY:
            return False
        self._unseen = 0
        return True

    def check(self, field: NDArray[np.float32], name: str, time: float) -> None:
        """Raise `SolverError` if a field [C, n, n] is not finite, the first time."""
        if self._reported:
            return
        where = where_not_finite(self._atlas, field)
        if where is None:
            return
        self._reported = True
        cause = "no source was given: the state held it"
        if self._largest is not None:
            cause = f"the largest source is {self._largest}, too much for float32: make it smaller"
        raise SolverError(f"{name} is no longer finite {where}, at time {time:.6g} s; {cause}, and `reset()` the waves")


def check_kick(velocities: NDArray[np.float64], kind: str, value: float, unit: str) -> float:
    """The greatest of the velocities [k] that a source gives at once [m/s].

    Raises
    ------
    SolverError
        If it is beyond float32.
    """
    fastest = float(np.abs(velocities).max(initial=0.0))
    if not fastest <= _GREATEST:
        raise SolverError(
            f"{kind} is {value:.4g} {unit}, which would move the surface at {fastest:.4g} m/s, beyond float32; "
            "valid is a smaller one, or a greater density of the material"
        )
    return fastest
