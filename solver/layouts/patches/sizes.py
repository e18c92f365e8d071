"""How large cells may be: smaller on limbs and round their ends, where a large one would be stretched."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from .cells import Cells, voronoi_cells
from .distances import Metric
from .surface import Surface

_SAMPLES = 500
_FULL = 0.5  # share of the area of a flat disk that a geodesic disk must have
_FEWEST = 12  # samples in a disk before it is judged
_GROWTH = 0.5  # of the size of cells along the surface


def cell_sizes(metric: Metric, reach: float, between: tuple[float, float]) -> NDArray[np.float64]:
    """Radius of the cells round each vertex [m], [n], between a least and a largest one.

    A cell has at most the share `reach` of the radius at which a geodesic disk round its middle has much less area than
    a flat one, being wrapped round a limb (of a tube that radius is nearly the girth) or over its end. The metric must
    be in metres.
    """
    total = np.cumsum(metric.masses)
    count = min(_SAMPLES, len(total))
    seeds = np.unique(np.searchsorted(total, (np.arange(count) + 0.5) / count * total[-1]))
    cells = voronoi_cells(metric, np.minimum(seeds, len(total) - 1))
    distance = dijkstra(_coarse_graph(metric.surface, cells), directed=False)
    order = np.argsort(distance, axis=1, kind="stable")
    radius = np.take_along_axis(distance, order, axis=1)
    area = np.cumsum(np.bincount(cells.label, metric.masses, len(seeds))[order], axis=1)
    full = area >= _FULL * np.pi * radius**2
    full[:, :_FEWEST] = True
    wrapped = np.where(full.all(axis=1), np.inf, radius[np.arange(len(seeds)), full.argmin(axis=1)])
    size = np.clip(reach * wrapped, *between)
    return (size + _GROWTH * distance).min(axis=1)[cells.label]


def _coarse_graph(surface: Surface, cells: Cells) -> csr_array:
    """Cells linked to their neighbours, by the shortest way from seed to seed along an edge between them [m]."""
    count, ends = len(cells.seeds), surface.edges.ends
    between = cells.label[ends[:, 0]] != cells.label[ends[:, 1]]
    pairs = np.sort(cells.label[ends[between]], axis=1)
    length = cells.distance[ends[between]].sum(axis=1) + surface.edge_lengths[between]
    order = np.lexsort((length, pairs[:, 1], pairs[:, 0]))
    key = (pairs @ [count, 1])[order]
    kept = order[np.concatenate([[True], key[1:] != key[:-1]])]
    return csr_array(coo_array((length[kept], tuple(pairs[kept].T)), shape=(count, count)))
