"""From the triangles of a mesh to charts: components, cells, quads, relaxation."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..energy import FIXED
from .collapse import without_cuts
from .cones import move_tips
from .energy import shapes_of
from .quads import CELLS, Quads, large_quads_of, part_of, quads_of
from .relaxation import relax_all, sweep_all
from .seamless import SeamlessMap, seamless_map, transitions
from .surface import Surface

_MOST = 4 / 3  # times as many has a mesh in parts of uneven sizes
_FEWEST = 0.5  # cells that the smallest part should have by its area; in truth it has four
_NEGLIGIBLE = 2e-3  # share of the area of a part for which no others are cut smaller
_MISJUDGED, _TRIES = 0.1, 3  # by so much more or less than its share of charts a part is cut again, so often

_ROUGH, _FINE = 5e-3, 2e-3  # before the tips move and after: stop when a step saves less than this share of the energy
_MOST_MOVES = 5  # of a tip, by an edge each


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


def patch_map(V: NDArray[np.float64], F: NDArray[np.int64], cells: int = CELLS) -> PatchMap:
    """Lay a manifold, oriented mesh out on charts, without a fold; on about so many cells of four to six charts.

    Where the largest part allows it charts are large, one for each of some more cells.

    Raises
    ------
    AtlasError
        If its triangles are too thin, or no cells are found.
    """
    parts, counts, shares = _components(V, F, cells)
    widest = int(shares.argmax())
    first = large_quads_of(parts[widest], counts[widest])
    large = first is not None
    quads = [
        first if first is not None and i == widest else quads_of(part, counts[i], large) for i, part in enumerate(parts)
    ]
    wanted = shares * sum(len(each.glued) for each in quads)
    for i in np.flatnonzero(shares > _NEGLIGIBLE) if len(parts) > 1 else ():
        quads[i] = _recut(parts[i], quads[i], counts[i], wanted[i], large)
    whole = _joined(quads)
    surface, seamless = without_cuts(whole.surface, seamless_map(whole), whole.cut)
    relax(surface.V, seamless)
    return PatchMap(surface, seamless)


def relax(V: NDArray[np.float64], seamless: SeamlessMap) -> None:
    """Even out areas and take away shear, in place, as far as the map's cones allow; V [n, 3] are its vertices [m].

    Cells are small and flat enough for that from where the quads lie; no step folds a triangle.
    """
    across = transitions(seamless.glued)
    shapes = shapes_of(V, seamless.F, len(seamless.glued))
    relax_all(seamless, shapes, across, _ROUGH)
    tips = np.flatnonzero(seamless.freedom == FIXED)
    for i in range(_MOST_MOVES):
        tips = move_tips(seamless, shapes, across, tips)
        if not len(tips):
            break
        sweep_all(seamless, shapes, across, i % 2 == 0)
    relax_all(seamless, shapes, across, _FINE)


def _recut(part: Surface, quads: Quads, count: int, wanted: float, large: bool) -> Quads:
    """Cut a part again that has come to more or less than the charts that its area should have; the best of the tries.

    Cells are mended until they are disks with corners enough, which changes their number.
    """
    best = quads
    for _ in range(_TRIES):
        charts = len(quads.glued)
        count, before = max(1, round(count * float(np.sqrt(wanted / charts)))), count
        if abs(charts / wanted - 1) < _MISJUDGED or count == before:
            break
        quads = quads_of(part, count, large)
        best = min(best, quads, key=lambda each: abs(np.log(len(each.glued) / wanted)))
    return best


def _components(
    V: NDArray[np.float64], F: NDArray[np.int64], cells: int
) -> tuple[list[Surface], list[int], NDArray[np.float64]]:
    """Each connected component, how many cells it gets, and its share of the area."""
    links = coo_array((np.ones(F.size), (F.ravel(), np.roll(F, -1, axis=1).ravel())), shape=(len(V), len(V)))
    _, part = connected_components(links, directed=False)
    number, of = np.unique(part[F[:, 0]], return_inverse=True)
    areas = Surface.of(V, F).areas
    share = np.bincount(of, areas / areas.sum()).astype(np.float64)
    # a small part has a few cells at least; where others have more, its texels are less tiny beside theirs
    small = share[share >= min(_NEGLIGIBLE, share.max())].min()
    count = np.maximum(1, np.rint(np.clip(_FEWEST / small, cells, _MOST * cells) * share)).astype(int)
    return [part_of(V, F, np.flatnonzero(of == each)) for each in range(len(number))], count.tolist(), share


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
        np.concatenate([each.cut for each in parts]),
    )
