"""From the triangles of a mesh to charts: components, cells, quads, relaxation."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .cells import centred_cells, spread_seeds
from .disks import disk_cells
from .distances import Metric
from .quads import Quads, cut_into_quads
from .refine import refined
from .relax import relaxed
from .seamless import SeamlessMap
from .sizes import cell_sizes
from .surface import Surface

CELLS = 96
_MOST_CELLS = 128  # of a mesh in parts of uneven sizes
_FEWEST = 0.5  # cells that the smallest part should have by its area; in truth it has four
_NEGLIGIBLE = 2e-3  # share of the area of a part for which no others are cut smaller
_RADIUS = 0.75  # of a cell, over the root of its share of the area
_REACH = 0.5  # of the radius at which a geodesic disk is wrapped round a limb
_SMALLEST = 0.85  # of the radius of cells elsewhere
_TRIANGLES = 2000  # of a mesh of one part, in units of the square of its longest edge


@dataclasses.dataclass(frozen=True, eq=False)
class PatchMap:
    """A surface laid out on charts.

    Attributes
    ----------
    surface : Surface
    seamless : SeamlessMap
    """

    surface: Surface
    seamless: SeamlessMap


def patch_map(V: NDArray[np.float64], F: NDArray[np.int64]) -> PatchMap:
    """Lay a manifold, oriented mesh out on charts, without a fold.

    Raises
    ------
    AtlasError
        If its triangles are too thin, or no cells are found.
    """
    quads = _joined([_component_quads(V, F, faces, count) for faces, count in _components(V, F)])
    return PatchMap(quads.surface, relaxed(quads))


def _components(V: NDArray[np.float64], F: NDArray[np.int64]) -> list[tuple[NDArray[np.int64], int]]:
    """Triangles of each connected component, and how many cells it gets."""
    links = coo_array((np.ones(F.size), (F.ravel(), np.roll(F, -1, axis=1).ravel())), shape=(len(V), len(V)))
    _, part = connected_components(links, directed=False)
    number, of = np.unique(part[F[:, 0]], return_inverse=True)
    areas = Surface.of(V, F).areas
    share = np.bincount(of, areas / areas.sum())
    # a small part has a few cells at least; where others have more, its texels are less tiny beside theirs
    small = share[share > _NEGLIGIBLE].min()
    count = np.maximum(1, np.rint(np.clip(_FEWEST / small, CELLS, _MOST_CELLS) * share)).astype(int)
    return [(np.flatnonzero(of == each), int(count[each])) for each in range(len(number))]


def _component_quads(V: NDArray[np.float64], F: NDArray[np.int64], faces: NDArray[np.int64], count: int) -> Quads:
    used, corners = np.unique(F[faces], return_inverse=True)
    whole = Surface.of(V[used], corners.reshape(-1, 3))
    longest = np.sqrt(whole.areas.sum() / (_TRIANGLES / CELLS * count))
    surface = refined(dataclasses.replace(whole, parent=faces), longest)
    metric, reach = Metric.of(surface), np.inf
    if count > 1:
        largest = _RADIUS * np.sqrt(whole.areas.sum() / count)
        metric, reach = metric.in_units(cell_sizes(metric, _REACH, (_SMALLEST * largest, largest))), 1.0
    return cut_into_quads(disk_cells(metric, centred_cells(metric, spread_seeds(metric, reach))))


def _joined(parts: list[Quads]) -> Quads:
    """Several surfaces as one."""
    if len(parts) == 1:
        return parts[0]
    vertices = np.cumsum([0, *(len(each.surface.V) for each in parts)])
    charts = np.cumsum([0, *(len(each.glued) for each in parts)])
    surface = Surface(
        np.concatenate([each.surface.V for each in parts]),
        np.concatenate([each.surface.F + first for each, first in zip(parts, vertices, strict=False)]),
        np.concatenate([each.surface.parent for each in parts]),
        np.concatenate([each.surface.inside for each in parts]),
    )
    glued = []
    for each, first in zip(parts, charts, strict=False):
        table = each.glued.copy()
        table[..., 0] += np.where(table[..., 0] >= 0, first, 0)
        glued.append(table)
    return Quads(
        surface,
        np.concatenate([each.chart + first for each, first in zip(parts, charts, strict=False)]),
        np.concatenate([each.places for each in parts]),
        np.concatenate(glued),
    )
