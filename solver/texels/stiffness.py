"""Stiffness weights and lumped areas of a texel mesh.

Vertices are the texel centres. Cells are the quads between four texels, also across glued sides, a triangle in each
corner of three charts, and a polygon in corners of five and more. Only real-space coordinates enter. Between the last
texels and a rim lies a strip of half a texel: where the rim is free, heights in it change along the rim only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .cell_sums import Cells, assemble
from .irregular import IrregularLinks
from .links import CrossingLinks, mean_of_copies
from .polygon_cell import polygon
from .stencil import Stencil
from .topology import TexelTopology


def lumped_areas(topology: TexelTopology, halo_positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Area of the texel mesh that belongs to each texel [m^2], [C, n, n]; for the positions see `TexelMesh`."""
    return _assembled(topology, halo_positions, None, None)[1]


def stiffness_stencil(
    topology: TexelTopology,
    halo_positions: NDArray[np.float64],
    coefficient: NDArray[np.float64],
    softening: NDArray[np.float64] | None = None,
) -> Stencil:
    """Stiffness weights of -div(coefficient grad).

    Parameters
    ----------
    topology : TexelTopology
    halo_positions : [C, n + 2, n + 2, 3]
        Texel positions with halo [m], see `TexelMesh`.
    coefficient : [C, n, n]
        Averaged harmonically over the corners of every cell, as media in series: the operator stays symmetric, and a
        region where it is 0 is cut off at its edge.
    softening : [C, n, n], optional
        Factors up to 1: the stiffness of every cell is multiplied by the least of those at its corners.

    Returns
    -------
    Stencil
        Its value at a texel is the area integral of div(coefficient grad h).
    """
    weights = _assembled(topology, halo_positions, coefficient, softening)[0]
    weights = mean_of_copies(topology, weights)
    if not topology.polygons:
        return Stencil(topology, weights)
    soft = np.ones(topology.shape) if softening is None else softening
    return _with_polygons(topology, halo_positions, coefficient.reshape(-1), soft.reshape(-1), weights)


def _assembled(
    topology: TexelTopology,
    halo_positions: NDArray[np.float64],
    coefficient: NDArray[np.float64] | None,
    softening: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights [C, 4, n + 1, n + 1], each copy of a link with what its own chart sees, and areas [C, n, n]."""
    charts, n, _ = topology.shape
    weights, areas = np.zeros((charts, 4, n + 1, n + 1)), np.zeros((charts, n, n))
    ones = np.ones(topology.halo.shape)
    k, s = (ones if field is None else topology.with_halo(field) for field in (coefficient, softening))
    assemble(
        Cells(halo_positions, k, s, topology.halo, topology.rim, topology.valence, topology.fixed_rim), weights, areas
    )
    if topology.polygons:
        points = _texel_positions(halo_positions)
        for texels in topology.polygons:
            areas.reshape(-1)[texels] += polygon(points[texels])[1]
    return weights, areas


def _texel_positions(halo_positions: NDArray[np.float64]) -> NDArray[np.float64]:
    return halo_positions[:, 1:-1, 1:-1].reshape(-1, 3)


def _with_polygons(
    topology: TexelTopology,
    halo_positions: NDArray[np.float64],
    coefficient: NDArray[np.float64],
    softening: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> Stencil:
    """Add the polygons' links: their sides to the stencil, their diagonals beside it."""
    points, crossing = _texel_positions(halo_positions), CrossingLinks.of(topology)
    ends, values = [], []
    for texels in topology.polygons:
        k = coefficient[texels]
        conductance = len(k) / (1 / k).sum() if k.all() else 0.0
        first, second = np.triu_indices(len(texels), 1)
        links = conductance * softening[texels].min() * polygon(points[texels])[0][first, second]
        pairs = np.stack([texels[first], texels[second]], axis=1)
        beside = crossing.add(weights, pairs, links)
        ends.append(pairs[beside])
        values.append(links[beside])
    return Stencil(topology, weights, IrregularLinks.of(np.concatenate(ends), np.concatenate(values)))
