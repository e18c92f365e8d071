"""Voronoi cells: every vertex of a surface belongs to the nearest of a few seeds, along the surface."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from .surface import Surface

_LLOYD_STEPS = 8
_MOST_PASSES = 50


@dataclasses.dataclass(frozen=True, eq=False)
class Cells:
    """Vertices shared out among seeds.

    Attributes
    ----------
    seeds : int64 [k]
        Vertices.
    label : int64 [n]
        Number of the seed whose cell each vertex belongs to. A cell hangs together along edges.
    distance : float64 [n]
        From that seed, in the units of the graph of distances.
    """

    seeds: NDArray[np.int64]
    label: NDArray[np.int64]
    distance: NDArray[np.float64]


def spread_seeds(graph: csr_array, reach: float) -> NDArray[np.int64]:
    """Vertices of which one lies within reach of every vertex, on one connected component.

    Each is the farthest from those before.
    """
    seeds = [int(np.argmax(dijkstra(graph, indices=0)))]
    distance = dijkstra(graph, indices=seeds[0])
    while distance.max() > reach:
        seeds.append(int(np.argmax(distance)))
        distance = np.minimum(distance, dijkstra(graph, indices=seeds[-1], limit=distance.max()))
    return np.array(seeds)


def voronoi_cells(surface: Surface, graph: csr_array, seeds: NDArray[np.int64]) -> Cells:
    """The vertices nearest to each seed."""
    distance, _, source = dijkstra(graph, indices=seeds, min_only=True, return_predecessors=True)
    number = np.full(len(surface.V), -1)
    number[seeds] = np.arange(len(seeds))
    label = _gathered(surface, number[source], seeds)
    return Cells(seeds, label, distance)


def centred_cells(
    surface: Surface, graph: csr_array, seeds: NDArray[np.int64], sizes: NDArray[np.float64]
) -> Cells:
    """Cells whose seeds moved to their middles a few times (Lloyd 1982), in the metric scaled by their sizes [n]."""
    mass = lumped_areas(surface) / sizes**2
    for _ in range(_LLOYD_STEPS):
        cells = voronoi_cells(surface, graph, seeds)
        total = np.bincount(cells.label, mass)
        middle = np.stack([np.bincount(cells.label, mass * surface.V[:, k]) / total for k in range(3)], axis=1)
        square = ((surface.V - middle[cells.label]) ** 2).sum(axis=1)
        order = np.lexsort((square, cells.label))
        moved = order[np.searchsorted(cells.label[order], np.arange(len(seeds)))]
        if (moved == seeds).all():
            break
        seeds = moved
    return voronoi_cells(surface, graph, seeds)


def lumped_areas(surface: Surface) -> NDArray[np.float64]:
    """Area that belongs to each vertex [m^2], [n]."""
    return np.bincount(surface.F.ravel(), np.repeat(surface.areas / 3, 3), len(surface.V)) + np.finfo(np.float64).tiny


def _gathered(surface: Surface, label: NDArray[np.int64], seeds: NDArray[np.int64]) -> NDArray[np.int64]:
    """Give vertices that hang on their cell by no edge to a neighbour's."""
    ends, size = surface.edges.ends, len(surface.V)
    for _ in range(_MOST_PASSES):
        inner = label[ends[:, 0]] == label[ends[:, 1]]
        links = coo_array((np.ones(inner.sum()), tuple(ends[inner].T)), shape=(size, size))
        part = connected_components(links, directed=False)[1]
        stray = part != part[seeds][label]
        beside = stray[ends[:, 0]] != stray[ends[:, 1]]
        if not beside.any():
            break
        first = stray[ends[beside, 0]]
        lone, kept = np.where(first, ends[beside].T, ends[beside, ::-1].T)
        label = label.copy()
        label[lone] = label[kept]
    return label
