"""`smoothed`: the mean of a field round each texel."""

from __future__ import annotations

import numpy as np

from ..kernel import Floats
from .topology import TexelTopology

# Passes of the smoothing: a neighbourhood has a standard deviation of 1.4 texels.
_SMOOTHING_PASSES = 4


def smoothed(topology: TexelTopology, field: Floats) -> Floats:
    """Mean of a field [C, n, n] round each texel.

    By passes of the weights 1 2 1 along rows and columns.
    """
    exists = _sum_around(topology, np.ones_like(field))
    for _ in range(_SMOOTHING_PASSES):
        # in corners of other than four charts a texel lacks a neighbour
        field = _sum_around(topology, field) / exists
    return field


def _sum_around(topology: TexelTopology, field: Floats) -> Floats:
    """Sum of a field [C, n, n] round each texel, with the weights 1 2 1 along rows and columns."""
    around = topology.with_halo(field)
    rows = around[:, :-2] + 2 * around[:, 1:-1] + around[:, 2:]
    return rows[:, :, :-2] + 2 * rows[:, :, 1:-1] + rows[:, :, 2:]
