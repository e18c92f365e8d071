"""Voronoi cells: every vertex belongs to the nearest of a few seeds, measured along the surface.

How large cells may be: smaller on limbs and round their ends, where a large one would be stretched.
Then they are cut apart, along smooth borders with corners and arcs between these.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from ...kernel import Bools, Floats, Ints
from ...mesh.topology import SPLITS
from .surface import AB, BC, CA, MIDDLE, A, B, C, Patterns, TriangleSurface

# Length of a link over the longest link, at least: graphs know no links of length 0.
_MIN_LINK_LENGTH = 1e-12

# Steps in which seeds move to the middles of their cells.
_LLOYD_STEPS = 8

# Passes that give stray vertices to the cell of a neighbour.
_MAX_STRAY_PASSES = 50

# How to cut triangles between two cells, of which one has a single vertex, and between three cells.
_CUTS: Patterns = {
    **{number: SPLITS[number] for number in (3, 6, 5)},
    7: (
        (A, AB, MIDDLE),
        (AB, B, MIDDLE),
        (B, BC, MIDDLE),
        (BC, C, MIDDLE),
        (C, CA, MIDDLE),
        (CA, A, MIDDLE),
    ),
}

# Share of an edge on either side of a border, at least.
_MIN_EDGE_SHARE = 0.1

# Angle at the rim below which a cell gets a corner there [rad].
_MAX_CORNER_ANGLE = np.radians(125)

# Places on a surface at which the size of cells is judged, at most, and for each cell.
_MAX_SIZE_SAMPLES = 500
_SIZE_SAMPLES_PER_CELL = 40

# Area of a geodesic disk over the area of a flat one, below which the disk counts as wrapped.
_MIN_DISK_AREA = 0.5

# Samples that a disk must hold before it is judged.
_MIN_DISK_SAMPLES = 12

# Growth of the size of cells along the surface [m/m].
_SIZE_GROWTH = 0.5


@dataclasses.dataclass(frozen=True, eq=False)
class Metric:
    """Distances along a surface, in units of a length that differs from place to place.

    Attributes
    ----------
    surface : TriangleSurface
    graph : csr_array [n, n]
        Links between near vertices with their lengths in these units.
    unit : float64 [n]
        At each vertex [m].
    """

    surface: TriangleSurface
    graph: csr_array
    unit: Floats

    @classmethod
    def of(cls, surface: TriangleSurface) -> Metric:
        """Distances in metres."""
        return cls(surface, distance_graph(surface), np.ones(len(surface.V)))

    def in_units(self, unit: Floats) -> Metric:
        """The metric in other units [n] [m]; a link takes the mean of the units at both ends."""
        row = np.repeat(np.arange(len(unit)), np.diff(self.graph.indptr))
        column = self.graph.indices
        lengths = (
            self.graph.data * (self.unit[row] + self.unit[column]) / (unit[row] + unit[column])
        )
        return Metric(
            self.surface, csr_array((lengths, column, self.graph.indptr), self.graph.shape), unit
        )

    @functools.cached_property
    def edge_lengths(self) -> Floats:
        """Lengths of the surface's edges, none of them 0, [e]."""
        lengths = self.surface.edge_lengths / self.unit[self.surface.edges.ends].mean(axis=1)
        return np.maximum(lengths, np.finfo(np.float64).tiny)

    @functools.cached_property
    def masses(self) -> Floats:
        """Area that belongs to each vertex, [n]."""
        surface = self.surface
        lumped = np.bincount(surface.F.ravel(), np.repeat(surface.areas / 3, 3), len(surface.V))
        return lumped / self.unit**2 + np.finfo(np.float64).tiny


def distance_graph(surface: TriangleSurface) -> csr_array:
    """Links between near vertices with their lengths [m].

    They run along edges, and straight across an edge between the two vertices opposite to it.
    """
    edges = surface.edges
    V = surface.V
    F = surface.F
    inner = np.flatnonzero(~edges.rim)
    triangle, side = np.divmod(edges.sides[inner].T, 3)
    p, q = F[triangle, (side + 2) % 3]
    a, b = V[edges.ends[inner]].transpose(1, 0, 2)
    length = surface.edge_lengths[inner]
    along = (b - a) / np.maximum(length, np.finfo(np.float64).tiny)[:, None]
    # laid flat about the edge, p lies on one side and q on the other
    xp, yp = _along_and_across(V[p] - a, along)
    xq, yq = _along_and_across(V[q] - a, along)
    crossing = xp + (xq - xp) * yp / np.maximum(yp + yq, np.finfo(np.float64).tiny)
    straight = (crossing > 0) & (crossing < length) & (p != q)
    ends = np.concatenate([edges.ends, np.stack([p, q], axis=1)[straight]])
    lengths = np.concatenate([surface.edge_lengths, np.hypot(xp - xq, yp + yq)[straight]])
    return _linked(ends, np.maximum(lengths, _MIN_LINK_LENGTH * lengths.max()), len(V))


def _linked(ends: Ints, lengths: Floats, count: int) -> csr_array:
    """Graph of `count` nodes, with the shortest of the links [k, 2] between each two nodes."""
    low = ends.min(axis=1)
    high = ends.max(axis=1)
    key = low * count + high
    order = np.lexsort((lengths, key))
    kept = order[np.diff(key[order], prepend=-1) != 0]
    pairs = np.concatenate([low[kept], high[kept]]), np.concatenate([high[kept], low[kept]])
    return csr_array(coo_array((np.tile(lengths[kept], 2), pairs), shape=(count, count)))


def _along_and_across(offset: Floats, along: Floats) -> tuple[Floats, Floats]:
    """Parts of offsets [k, 3] along a direction and across it."""
    x = np.einsum("ij,ij->i", offset, along)
    square = np.einsum("ij,ij->i", offset, offset)
    return x, np.sqrt(np.maximum(square - x * x, 0.0))


@dataclasses.dataclass(frozen=True, eq=False)
class VoronoiCells:
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

    seeds: Ints
    label: Ints
    distance: Floats


def spread_seeds(metric: Metric, reach: float) -> Ints:
    """Vertices such that every vertex has one of them within reach, on one component.

    Each is the farthest from those before.
    """
    graph = metric.graph
    seeds = [int(np.argmax(dijkstra(graph, indices=0)))]
    distance = dijkstra(graph, indices=seeds[0])
    while distance.max() > reach:
        seeds.append(int(np.argmax(distance)))
        distance = np.minimum(distance, dijkstra(graph, indices=seeds[-1], limit=distance.max()))
    return np.array(seeds)


def voronoi_cells(metric: Metric, seeds: Ints) -> VoronoiCells:
    """Share out the vertices: each belongs to the nearest seed."""
    distance, _, source = dijkstra(
        metric.graph, indices=seeds, min_only=True, return_predecessors=True
    )
    number = np.full(len(metric.unit), -1)
    number[seeds] = np.arange(len(seeds))
    label = number[source]
    ends = metric.surface.edges.ends
    # vertices that hang on their cell by no edge are given to a neighbour's
    for _ in range(_MAX_STRAY_PASSES):
        inner = label[ends[:, 0]] == label[ends[:, 1]]
        links = coo_array((np.ones(inner.sum()), tuple(ends[inner].T)), shape=metric.graph.shape)
        part = connected_components(links, directed=False)[1]
        stray = part != part[seeds][label]
        beside = stray[ends[:, 0]] != stray[ends[:, 1]]
        if not beside.any():
            break
        first = stray[ends[beside, 0]]
        lone, kept = np.where(first, ends[beside].T, ends[beside, ::-1].T)
        label[lone] = label[kept]
    return VoronoiCells(seeds, label, distance)


def centred_cells(metric: Metric, seeds: Ints) -> VoronoiCells:
    """Cells whose seeds moved to their middles a few times (Lloyd 1982)."""
    V = metric.surface.V
    mass = metric.masses
    for _ in range(_LLOYD_STEPS):
        cells = voronoi_cells(metric, seeds)
        total = np.bincount(cells.label, mass)
        middle = np.stack(
            [np.bincount(cells.label, mass * V[:, k]) / total for k in range(3)], axis=1
        )
        square = ((V - middle[cells.label]) ** 2).sum(axis=1)
        order = np.lexsort((square, cells.label))
        moved = order[np.searchsorted(cells.label[order], np.arange(len(seeds)))]
        if (moved == seeds).all():
            break
        seeds = moved
    return voronoi_cells(metric, seeds)


@dataclasses.dataclass(frozen=True, eq=False)
class BorderedCells:
    """A surface cut along the borders of cells.

    Attributes
    ----------
    surface : TriangleSurface
    cell : int64 [m]
        To which each triangle belongs.
    arcs : list of lists of int64 [l]
        Of each cell, counter-clockwise, the vertices along its border from one corner to the next,
        both included.
    uncut : int
        How many vertices there were before the cut: the first ones.
    """

    surface: TriangleSurface
    cell: Ints
    arcs: list[list[Ints]]
    uncut: int


def cut_borders(metric: Metric, cells: VoronoiCells) -> BorderedCells:
    """Cut the triangles between cells that are disks, and find the cells' corners.

    In an inner corner three cells meet, in one at the rim two; at the rim a cell has corners of its
    own where that is sharp, and as many more as it lacks to three.
    """
    surface = metric.surface
    ends = surface.edges.ends
    label = cells.label[ends]
    distance = cells.distance[ends]
    between = label[:, 0] != label[:, 1]
    place = np.clip(
        0.5 + (distance[:, 1] - distance[:, 0]) / (2 * metric.edge_lengths),
        _MIN_EDGE_SHARE,
        1 - _MIN_EDGE_SHARE,
    )
    cut = surface.subdivided(np.where(between, place, np.nan), _CUTS).surface
    # each triangle has a vertex of the surface before, and all of those are of its cell
    cell = np.pad(cells.label, (0, len(cut.V) - len(surface.V)), constant_values=-1)[cut.F].max(
        axis=1
    )
    count = len(cells.seeds)
    meeting = np.bincount(np.unique(cut.F * count + cell[:, None]) // count, minlength=len(cut.V))
    angle = np.bincount(cut.F.ravel(), cut.angles.ravel(), len(cut.V))
    corner = np.where(cut.at_rim, (meeting >= 2) | (angle < _MAX_CORNER_ANGLE), meeting >= 3)
    # the vertex that follows each along the rim, counter-clockwise about the surface
    following = np.full(len(cut.V), -1)
    triangle, side = np.divmod(cut.edges.sides[cut.edges.rim, 0], 3)
    following[cut.F[triangle, side]] = cut.F[triangle, (side + 1) % 3]
    arcs = [
        _arcs(cut.V, loop, corner[loop], following[loop] == np.roll(loop, -1))
        for loop in _border_loops(cut, cell, count)
    ]
    return BorderedCells(cut, cell, arcs, len(surface.V))


def _border_loops(surface: TriangleSurface, cell: Ints, count: int) -> list[Ints]:
    """The vertices round each cell, counter-clockwise."""
    sides = surface.edges.sides
    beside = np.where(sides < 0, -1, cell[sides // 3])
    border = sides[beside[:, 0] != beside[:, 1]].ravel()
    triangle, side = np.divmod(border[border >= 0], 3)
    tail = surface.F[triangle, side]
    head = surface.F[triangle, (side + 1) % 3]
    following: list[dict[int, int]] = [{} for _ in range(count)]
    for c, u, v in zip(cell[triangle].tolist(), tail.tolist(), head.tolist(), strict=True):
        following[c][u] = v
    loops = []
    for step in following:
        loop = [min(step)]
        vertex = step[loop[0]]
        while vertex != loop[0]:
            loop.append(vertex)
            vertex = step[vertex]
        loops.append(np.array(loop))
    return loops


def _arcs(V: Floats, loop: Ints, corner: Bools, on_rim: Bools) -> list[Ints]:
    """Cut a loop into arcs at its corners.

    If it has too few corners, more are put on its rim, far from the others.
    """
    corner = corner.copy()
    length = np.linalg.norm(np.roll(V[loop], -1, axis=0) - V[loop], axis=1)
    place = np.cumsum(length) - length
    whole = length.sum()
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


def cell_sizes(
    metric: Metric, reach: float, between: tuple[float, float], cell_count: int
) -> Floats:
    """Radius of about `cell_count` cells round each vertex [m], [n], between two bounds.

    A cell has at most the share `reach` of the radius at which a geodesic disk round its middle has
    much less area than a flat one, being wrapped round a limb (of a tube that radius is nearly the
    girth) or over its end. The metric must be in metres.
    """
    total = np.cumsum(metric.masses)
    count = min(_MAX_SIZE_SAMPLES, _SIZE_SAMPLES_PER_CELL * cell_count, len(total))
    seeds = np.unique(np.searchsorted(total, (np.arange(count) + 0.5) / count * total[-1]))
    cells = voronoi_cells(metric, np.minimum(seeds, len(total) - 1))
    # from seed to seed, by the shortest way along an edge between neighbouring cells
    ends = metric.surface.edges.ends
    apart = cells.label[ends[:, 0]] != cells.label[ends[:, 1]]
    length = cells.distance[ends[apart]].sum(axis=1) + metric.surface.edge_lengths[apart]
    distance = dijkstra(_linked(cells.label[ends[apart]], length, len(seeds)))
    order = np.argsort(distance, axis=1, kind="stable")
    radius = np.take_along_axis(distance, order, axis=1)
    area = np.cumsum(np.bincount(cells.label, metric.masses, len(seeds))[order], axis=1)
    full = area >= _MIN_DISK_AREA * np.pi * radius**2
    full[:, :_MIN_DISK_SAMPLES] = True
    wrapped = np.where(full.all(axis=1), np.inf, radius[np.arange(len(seeds)), full.argmin(axis=1)])
    size = np.clip(reach * wrapped, *between)
    return (size + _SIZE_GROWTH * distance).min(axis=1)[cells.label]
