"""Fields with halo: each chart surrounded by copies of the texels beyond its border."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .topology import TexelTopology


def fill_halo(topology: TexelTopology, field: NDArray) -> None:
    """Fill in the halo of a field [C, n + 2, n + 2, ...] from its texels.

    Where no texel lies, in corners of other than four charts, comes the mean of the three next to it: bilinear
    interpolation is then continuous where three charts meet. Beyond a rim the last texels are repeated.
    """
    addresses = topology.addresses
    flat = field.reshape(topology.halo.size, *field.shape[3:])
    flat[addresses.ghosts] = flat[addresses.sources]
    last = field.shape[1] - 1
    for r, r_in in ((0, 1), (last, last - 1)):
        for c, c_in in ((0, 1), (last, last - 1)):
            missing = topology.halo[:, r, c] < 0
            mean = (field[:, r_in, c_in] + field[:, r_in, c] + field[:, r, c_in]) / field.dtype.type(3)
            field[missing, r, c] = mean[missing]


def with_filled_halo(topology: TexelTopology, field: NDArray[np.float32]) -> NDArray[np.float32]:
    """A field [C, n, n, ...] surrounded by its halo; see `fill_halo`."""
    around = topology.with_halo(field)
    fill_halo(topology, around)
    return around
