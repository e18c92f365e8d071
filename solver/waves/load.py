"""Loads: forces on some texels, held over a step."""

from __future__ import annotations

import dataclasses
import functools
import threading
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverError
from ..kernel import Floats, Ints, kernel


@dataclasses.dataclass(frozen=True, eq=False)
class Load:
    """Constant forces on some texels.

    Attributes
    ----------
    texels : int64 [k]
        Flat texel indices (chart n + row) n + column; a texel may occur more than once.
    forces : float64 [k]
        [N], positive inwards.
    """

    texels: NDArray[np.int64]
    forces: NDArray[np.float64]

    @classmethod
    def none(cls) -> Load:
        """No force anywhere."""
        return cls(np.zeros(0, np.int64), np.zeros(0))

    @classmethod
    def together(cls, loads: Sequence[Load]) -> Load:
        """Several loads at once."""
        loads = [load for load in loads if len(load.texels)]
        if not loads:
            return cls.none()
        if len(loads) == 1:
            return loads[0]
        return cls(np.concatenate([each.texels for each in loads]), np.concatenate([each.forces for each in loads]))

    def merged(self, size: int) -> Load:
        """The same with every texel once, on an atlas of so many texels.

        Raises
        ------
        SolverError
            If a texel is not one of the atlas.
        """
        texels = self.texels
        if len(texels) and not 0 <= texels.min() <= texels.max() < size:
            raise SolverError(
                f"texels go from {texels.min()} to {texels.max()}; valid are indices from 0 to {size - 1}"
            )
        if (texels[1:] > texels[:-1]).all():
            return self
        texels, (forces,) = add_up_by(slot_scratch(size), texels, self.forces[None])
        return Load(texels, forces)


def slot_scratch(size: int) -> NDArray[np.int64]:
    """Scratch for `add_up_by`, which cleans it up: a sum must not cost more on a larger grid. One for each thread."""
    return _slot_scratch(size, threading.get_ident())


@functools.lru_cache(maxsize=8)
def _slot_scratch(size: int, thread: int) -> NDArray[np.int64]:
    return np.full(size, -1)


@kernel
def add_up_by(place: Ints, texels: Ints, values: Floats) -> tuple[Ints, Floats]:
    """Sum the values [m, k] of equal texels [k]: each texel once, in order of first appearance, and its sums."""
    once = np.empty_like(texels)
    sums = np.zeros_like(values)
    count = 0
    for i in range(len(texels)):
        t = texels[i]
        if place[t] < 0:
            place[t] = count
            once[count] = t
            count += 1
        for row in range(len(values)):
            sums[row, place[t]] += values[row, i]
    for i in range(count):
        place[once[i]] = -1
    return once[:count].copy(), sums[:, :count].copy()
