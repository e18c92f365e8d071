"""Weighted sums of heights or velocities after every substep: what sensors and sounds listen to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats32, Ints, kernel


class Probes(NamedTuple):
    """Weighted sums of heights or velocities after every substep: a sensor's points, or a sound."""

    begins: Ints  # where the texels and weights of each sum begin, [k + 1]
    texels: Ints  # flat indices of texels; in a backend addresses in a field
    weights: Floats32
    heights: NDArray[np.bool_]  # whether each sum is of heights, else of velocities, [k]

    @classmethod
    def together(cls, probes: Sequence[Probes]) -> Probes:
        """The sums of several probes, one after the other."""
        counts = np.concatenate([np.diff(group.begins) for group in probes])
        return cls(
            begins=np.append(0, np.cumsum(counts)),
            texels=np.concatenate([group.texels for group in probes]),
            weights=np.concatenate([group.weights for group in probes]),
            heights=np.concatenate([group.heights for group in probes]),
        )

    def of(self, height: NDArray, velocity: NDArray) -> NDArray[np.float64]:
        """The sums [k] of fields [C, n, n]; every sum has a texel."""
        return np.where(self.heights, self._sums(height), self._sums(velocity))

    def _sums(self, field: NDArray) -> NDArray[np.float64]:
        """The sums [k] of one field [C, n, n]."""
        weighted = self.weights * field.reshape(-1)[self.texels]
        return np.add.reduceat(weighted, self.begins[:-1])


class ProbedSums(NamedTuple):
    """Probes, and the sums that they took."""

    probes: Probes
    sums: Floats32  # [substeps, k]


@kernel(no_cpython_wrapper=True)
def take_sums(
    probes: Probes, h: Floats32, v: Floats32, dent: Floats32, drifted: np.float32, sums: Floats32
) -> None:
    """Fill in the sums [k] of a substep.

    Its heights have drifted for `drifted` [s] beyond the time of its velocities.
    """
    for i in range(len(sums)):
        total = 0.0
        for j in range(probes.begins[i], probes.begins[i + 1]):
            at = probes.texels[j]
            value = v[at]
            if probes.heights[i]:
                value = h[at] - drifted * v[at]
                if len(dent):
                    value += dent[at]
            total += probes.weights[j] * value
        sums[i] = total
