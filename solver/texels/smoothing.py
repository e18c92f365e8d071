"""Smooth fields on the texels, and masks with soft edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .topology import TexelTopology

# Passes of the smoothing: a neighbourhood has a standard deviation of 1.4 texels.
_PASSES = 4


def smoothed(topology: TexelTopology, field: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of a field [C, n, n] round each texel, by passes of the weights 1 2 1 along rows and columns."""
    exists = _sum_around(topology, np.ones_like(field))
    for _ in range(_PASSES):
        # in corners of other than four charts a texel lacks a neighbour
        field = _sum_around(topology, field) / exists
    return field


def _sum_around(topology: TexelTopology, field: NDArray[np.float64]) -> NDArray[np.float64]:
    around = topology.with_halo(field)
    rows = around[:, :-2] + 2 * around[:, 1:-1] + around[:, 2:]
    return rows[:, :, :-2] + 2 * rows[:, :, 1:-1] + rows[:, :, 2:]
