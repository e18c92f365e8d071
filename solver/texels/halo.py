"""Addresses in padded faces: where own texels lie in memory, and which texel each place of the ring shows."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.texels.cube_map.convention import padded_indices


@functools.lru_cache(maxsize=8)
def padded_addresses(resolution: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Flat addresses in a padded field [6, N + 2, N + 2].

    Returns
    -------
    inside : [6 N^2]
        Address of every own texel, by flat texel index.
    ring : [k]
        Addresses of the ring's places (without its corners, where no texel exists).
    source : [k]
        Address of the own texel that each of them shows.
    """
    index = padded_indices(resolution)
    own = np.zeros(index.shape, dtype=bool)
    own[:, 1:-1, 1:-1] = True
    address = np.arange(index.size).reshape(index.shape)
    ring = ~own & (index >= 0)
    inside = address[own]
    return inside, address[ring], inside[index[ring]]
