"""Cells cut apart: smooth borders between them, and the corners and arcs of these."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .distances import Metric
from .surface import AB, BC, CA, MIDDLE, A, B, C, Surface, Triangle

# Triangles between two cells, the one vertex on its side of the border; and between three.
_CUTS: dict[int, tuple[Triangle, ...]] = {
    3: ((AB, B, BC), (A, AB, BC), (A, BC, C)),
    6: ((BC, C, CA), (B, BC, CA), (B, CA, A)),
    5: ((CA, A, AB), (C, CA, AB), (C, AB, B)),
    7: ((A, AB, MIDDLE), (AB, B, MIDDLE), (B, BC, MIDDLE), (BC, C, MIDDLE), (C, CA, MIDDLE), (CA, A, MIDDLE)),
}
_LEAST_SHARE = 0.1  # of an edge on either side of a border
_SHARP = np.radians(125)  # angles at the rim that get a corner


@dataclasses.dataclass(frozen=True, eq=False)
class BorderedCells:
    """A surface cut along the borders of cells.

    Attributes
    ----------
    surface : Surface
    cell : int64 [m]
        To which each triangle belongs.
    arcs : list of lists of int64 [l]
        Of each cell, counter-clockwise, the vertices along its border from one corner to the next, both included.
    uncut : int
        How many vertices there were before the cut: the first ones.
    """

    surface: Surface
    cell: NDArray[np.int64]
    arcs: list[list[NDArray[np.int64]]]
    uncut: int

    def short_of_corners(self) -> NDArray[np.int64]:
        """Cells with fewer than three corners."""
        return np.flatnonzero([len(each) < 3 for each in self.arcs])


def cut_borders(metric: Metric, cells: Cells) -> BorderedCells:
    """Cut the triangles between cells that are disks, and find the cells' corners.

    In an inner corner three cells meet, in one at the rim two; at the rim a cell has corners of its own where that is
    sharp, and as many more as it lacks to three.
    """
    surface = metric.surface
    ends = surface.edges.ends
    label, distance = cells.label[ends], cells.distance[ends]
    between = label[:, 0] != label[:, 1]
    place = np.clip(0.5 + (distance[:, 1] - distance[:, 0]) / (2 * metric.edge_lengths), _LEAST_SHARE, 1 - _LEAST_SHARE)
    cut = surface.subdivided(np.where(between, place, np.nan), _CUTS).surface
    # each triangle has a vertex of the surface before, and all of those are of its cell
    of_vertex = np.concatenate([cells.label, np.full(len(cut.V) - len(cells.label), -1)])
    cell = of_vertex[cut.F].max(axis=1)
    corner, rim_side = _corners(cut, cell), _rim_sides(cut)
    arcs = []
    for loop in _border_loops(cut, cell, len(cells.seeds)):
        on_rim = rim_side[loop] == np.roll(loop, -1)
        arcs.append(_arcs(cut.V, loop, corner[loop], on_rim))
    return BorderedCells(cut, cell, arcs, len(surface.V))


def _corners(surface: Surface, cell: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Vertices in which three cells meet, two at a rim, or one at a sharp corner of the rim."""
    count = int(cell.max()) + 1
    pairs = np.unique(surface.F * count + cell[:, None])
    meeting = np.bincount(pairs // count, minlength=len(surface.V))
    angle = np.bincount(surface.F.ravel(), surface.angles.ravel(), len(surface.V))
    return np.where(surface.at_rim, (meeting >= 2) | (angle < _SHARP), meeting >= 3)


def _rim_sides(surface: Surface) -> NDArray[np.int64]:
    """The vertex that follows each along the rim, counter-clockwise about the surface; -1 elsewhere."""
    following = np.full(len(surface.V), -1)
    triangle, side = np.divmod(surface.edges.sides[surface.edges.rim, 0], 3)
    following[surface.F[triangle, side]] = surface.F[triangle, (side + 1) % 3]
    return following


def _border_loops(surface: Surface, cell: NDArray[np.int64], count: int) -> list[NDArray[np.int64]]:
    """The vertices round each cell, counter-clockwise."""
    sides = surface.edges.sides
    beside = np.where(sides < 0, -1, cell[sides // 3])
    border = sides[beside[:, 0] != beside[:, 1]].ravel()
    triangle, side = np.divmod(border[border >= 0], 3)
    tail, head = surface.F[triangle, side], surface.F[triangle, (side + 1) % 3]
    following: list[dict[int, int]] = [{} for _ in range(count)]
    for c, u, v in zip(cell[triangle].tolist(), tail.tolist(), head.tolist(), strict=True):
        following[c][u] = v
    loops = []
    for step in following:
        loop = [min(step)]
        while (v := step[loop[-1]]) != loop[0]:
            loop.append(v)
        loops.append(np.array(loop))
    return loops


def _arcs(
    V: NDArray[np.float64], loop: NDArray[np.int64], corner: NDArray[np.bool_], on_rim: NDArray[np.bool_]
) -> list[NDArray[np.int64]]:
    """Cut a loop at its corners; more are put on its rim, far from the others, where it has too few."""
    corner = corner.copy()
    length = np.linalg.norm(np.roll(V[loop], -1, axis=0) - V[loop], axis=1)
    place, whole = np.cumsum(length) - length, length.sum()
    free = on_rim & np.roll(on_rim, 1)
    while corner.sum() < (4 if on_rim.all() else 3):
        candidates = np.flatnonzero(free & ~corner)
        if not len(candidates):
            break
        taken = place[corner] if corner.any() else place[:1]
        gap = np.abs(place[candidates][:, None] - taken)
        corner[candidates[np.minimum(gap, whole - gap).min(axis=1).argmax()]] = True
    at = np.flatnonzero(corner)
    if not len(at):
        return []
    turned = np.roll(loop, -at[0])
    ends = [*(at[1:] - at[0]), len(loop)]
    turned = np.append(turned, turned[0])
    return [turned[start : end + 1] for start, end in zip([0, *ends[:-1]], ends, strict=True)]
