"""How large cells may be: smaller on limbs and round their ends, where a large one would be stretched."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from .cells import lumped_areas, voronoi_cells
from .surface import Surface

_SAMPLES = 500
_FULL = 0.5  # share of the area of a flat disk that a geodesic disk must have
_FEWEST = 12  # samples in a disk before it is judged
_GROWTH = 0.5  # of the size of cells along the surface


def cell_sizes(surface: Surface, graph: csr_array, largest: float, reach: float, smallest: float) -> NDArray[np.float64]:
    """Radius of the cells round each vertex [m], [n].

    A cell has at most the share `reach` of the radius at which a geodesic disk round its seed has much less area than a
    flat one, being wrapped round a limb (on a tube that radius is its girth) or over its end.
    """
    count = min(_SAMPLES, len(surface.V))
    mass = lumped_areas(surface)
    total = np.cumsum(mass)
    seeds = np.unique(np.searchsorted(total, (np.arange(count) + 0.5) / count * total[-1]))
    seeds = np.minimum(seeds, len(surface.V) - 1)
    cells = voronoi_cells(surface, graph, seeds)
    areas = np.bincount(cells.label, mass, len(seeds))
    between = dijkstra(_coarse_graph(surface, cells.label, cells.distance, len(seeds)), directed=False)
    order = np.argsort(between, axis=1)
    radius = np.take_along_axis(between, order, axis=1)
    covered = np.cumsum(areas[order], axis=1)
    flat = np.pi * radius**2
    full = (covered >= _FULL * flat) | (np.arange(len(seeds)) < _FEWEST)
    first = np.where(full.all(axis=1), full.shape[1] - 1, np.argmin(full, axis=1))
    limit = np.where(full.all(axis=1), np.inf, np.take_along_axis(radius, first[:, None], axis=1)[:, 0])
    size = np.clip(reach * limit, smallest, largest)
    size = (size[None] + _GROWTH * between).min(axis=1)
    return size[cells.label]


def _coarse_graph(
    surface: Surface, label: NDArray[np.int64], distance: NDArray[np.float64], count: int
) -> csr_array:
    """Cells linked to their neighbours, by the shortest way from seed to seed along an edge between them [m]."""
    ends = surface.edges.ends
    between = label[ends[:, 0]] != label[ends[:, 1]]
    pairs = np.sort(label[ends[between]], axis=1)
    length = distance[ends[between]].sum(axis=1) + surface.edge_lengths[between]
    order = np.lexsort((length, pairs[:, 1], pairs[:, 0]))
    key = (pairs @ [count, 1])[order]
    kept = order[np.concatenate([[True], key[1:] != key[:-1]])]
    return csr_array(coo_array((length[kept], tuple(pairs[kept].T)), shape=(count, count)))
