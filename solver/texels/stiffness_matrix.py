"""A stencil as a sparse matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from .links import LINK_ENDS, link_exists, ties_to_rim
from .stencil import Stencil


def stiffness_matrix(stencil: Stencil) -> csr_array:
    """A stencil as a matrix [T, T] whose product with a field is minus the stencil's value."""
    topology = stencil.topology
    rows, columns, weights = [], [], []
    for link, (a, b) in enumerate(LINK_ENDS):
        for end, other in ((a, b), (b, a)):
            own = link_exists(topology, link) & topology.own[end]
            rows.append(topology.halo[end][own])
            columns.append(topology.halo[other][own])
            weights.append(stencil.weights[:, link][own])
    irregular = stencil.irregular
    if irregular is not None:
        rows.append(np.repeat(irregular.texels, np.diff(irregular.begins)))
        columns.append(irregular.others)
        weights.append(irregular.weights)
    row, column, weight = np.concatenate(rows), np.concatenate(columns), np.concatenate(weights)
    size = topology.texel_count
    diagonal = np.bincount(row, weight, size) + _ties_to_rim(stencil)
    texels = np.arange(size)
    entries = np.concatenate([-weight, diagonal])
    places = np.concatenate([row, texels]), np.concatenate([column, texels])
    return csr_array(coo_array((entries, places), shape=(size, size)))


def _ties_to_rim(stencil: Stencil) -> NDArray[np.float64]:
    """Sum of the weights that tie each texel to a fixed rim, [T]."""
    topology = stencil.topology
    sums = np.zeros(topology.texel_count)
    for link, (a, b) in enumerate(LINK_ENDS):
        for end in (a, b):
            tied = ties_to_rim(topology, link) & topology.own[end]
            sums += np.bincount(topology.halo[end][tied], stencil.weights[:, link][tied], topology.texel_count)
    return sums
