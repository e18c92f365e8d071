"""Halos of charts: copies of the texels beyond each chart's border, and sampling between texels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ..kernel import Floats, Floats32, Ints
from .topology import TexelTopology


def fill_halo(topology: TexelTopology, field: NDArray) -> None:
    """Fill in the halo of a field [C, n + 2, n + 2, ...] from its texels.

    Places without a texel, in corners of other than four charts, get the mean of the three texels
    next to them: bilinear interpolation is then continuous where three charts meet. Beyond a rim
    the last texels are repeated.
    """
    _, ghosts, sources = topology.addresses
    flat = field.reshape(topology.halo.size, *field.shape[3:])
    flat[ghosts] = flat[sources]
    last = field.shape[1] - 1
    for r, r_in in ((0, 1), (last, last - 1)):
        for c, c_in in ((0, 1), (last, last - 1)):
            missing = topology.halo[:, r, c] < 0
            total = field[:, r_in, c_in] + field[:, r_in, c] + field[:, r, c_in]
            mean = total / field.dtype.type(3)
            field[missing, r, c] = mean[missing]


def with_filled_halo(topology: TexelTopology, field: Floats32) -> Floats32:
    """A field [C, n, n, ...] surrounded by its halo; see `fill_halo`."""
    around = topology.with_halo(field)
    fill_halo(topology, around)
    return around


def sampling_matrix(topology: TexelTopology, chart: Ints, row: Floats, column: Floats) -> csr_array:
    """Matrix that takes a flattened field [C n^2] to its values at chart points.

    Chart, row and column are each [k]; see `Atlas.locate`. In a corner where other than four charts
    meet, the other texels share the weight of the missing one.
    """
    r = np.floor(row).astype(np.int64)
    c = np.floor(column).astype(np.int64)
    s = row - r
    t = column - c
    i, j = np.array([[0, 0, 1, 1], [0, 1, 0, 1]])[:, :, None]
    texel = topology.halo[chart, r + 1 + i, c + 1 + j]
    share = np.where(texel < 0, 0, [(1 - s) * (1 - t), (1 - s) * t, s * (1 - t), s * t])
    share /= share.sum(axis=0)
    places = np.tile(np.arange(len(chart)), 4), np.maximum(texel, 0).ravel()
    return csr_array((share.ravel(), places), shape=(len(chart), topology.texel_count))
