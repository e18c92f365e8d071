"""Voronoi cells: every vertex of a surface belongs to the nearest of a few seeds, along the surface."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from .distances import Metric
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
        From that seed, in the units of the metric.
    """

    seeds: NDArray[np.int64]
    label: NDArray[np.int64]
    distance: NDArray[np.float64]


def spread_seeds(metric: Metric, reach: float) -> NDArray[np.int64]:
    """Vertices of which one lies within reach of every vertex, on one connected component.

    Each is the farthest from those before.
    """
    graph = metric.graph
    seeds = [int(np.argmax(dijkstra(graph, indices=0)))]
    distance = dijkstra(graph, indices=seeds[0])
    while distance.max() > reach:
        seeds.append(int(np.argmax(distance)))
        distance = np.minimum(distance, dijkstra(graph, indices=seeds[-1], limit=distance.max()))
    return np.array(seeds)


def voronoi_cells(metric: Metric, seeds: NDArray[np.int64]) -> Cells:
    """The vertices nearest to each seed."""
    distance, _, source = dijkstra(metric.graph, indices=seeds, min_only=True, return_predecessors=True)
    number = np.full(len(metric.unit), -1)
    number[seeds] = np.arange(len(seeds))
    label = _gathered(metric.surface, number[source], seeds)
    return Cells(seeds, label, distance)


def centred_cells(metric: Metric, seeds: NDArray[np.int64]) -> Cells:
    """Cells whose seeds moved to their middles a few times (Lloyd 1982)."""
    V, mass = metric.surface.V, metric.masses
    for _ in range(_LLOYD_STEPS):
        cells = voronoi_cells(metric, seeds)
        total = np.bincount(cells.label, mass)
        middle = np.stack([np.bincount(cells.label, mass * V[:, k]) / total for k in range(3)], axis=1)
        square = ((V - middle[cells.label]) ** 2).sum(axis=1)
        order = np.lexsort((square, cells.label))
        moved = order[np.searchsorted(cells.label[order], np.arange(len(seeds)))]
        if (moved == seeds).all():
            break
        seeds = moved
    return voronoi_cells(metric, seeds)


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
