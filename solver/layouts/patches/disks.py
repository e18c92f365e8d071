"""Cells become disks with three corners and more, laid out flat in convex polygons without a fold.

Seeds are added and taken away until all cells are disks. In the plane each inner vertex is a mean
of its neighbours with positive weights, so that the map is one to one (Tutte 1963, Floater 2003),
whatever the weights; mean-value weights follow the shape of the triangles.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import splu

from ...errors import AtlasError
from ...kernel import Floats, Ints
from .cells import BorderedCells, Metric, VoronoiCells, centred_cells, cut_borders, voronoi_cells
from .surface import TriangleSurface

# Rounds that mend cells, at most.
_MAX_MENDING_ROUNDS = 200

# Least number of cells of a closed surface.
_MIN_CELLS_CLOSED = 4

# Least number of corners of a cell.
_MIN_CORNERS = 3

# Least length of a step along a path, over the longest step of the path, and in all [m].
_MIN_STEP_SHARE = 1e-6
_MIN_STEP = 1e-300

# Bounds of the tangent of half an angle: beyond them triangles are so bad that round-off would fold
# them.
_MIN_HALF_TANGENT = 1e-3
_MAX_HALF_TANGENT = 1e3


def disk_cells(metric: Metric, cells: VoronoiCells) -> BorderedCells:
    """Cells of one connected component, cut apart, each a disk with at least three corners.

    A cell that is no disk gets a seed half-way round its shortest loop that does not shrink to a
    point; one with fewer corners gets a further neighbour on its border or, if that was tried
    before, loses its seed. Cells with new neighbours are centred anew, and mended once more. Raises
    `AtlasError` if none are found.
    """
    mended, bordered = _mended(metric, cells)
    if len(mended.seeds) > len(cells.seeds):
        _, bordered = _mended(metric, centred_cells(metric, mended.seeds))
    return bordered


def _mended(metric: Metric, cells: VoronoiCells) -> tuple[VoronoiCells, BorderedCells]:
    """Cells that are disks with three corners, and the same with their borders cut.

    They have more or other seeds than `cells`.
    """
    surface = metric.surface
    # seeds of cells that have already been given a neighbour for the sake of corners
    tried = set[int]()
    for _ in range(_MAX_MENDING_ROUNDS):
        no_disks = np.flatnonzero(_euler(surface, cells) != 1)
        if len(no_disks):
            far_sides = [_far_side(surface, cells, cell) for cell in no_disks.tolist()]
            new = np.setdiff1d(far_sides, cells.seeds)
            if not len(new):
                break
            cells = voronoi_cells(metric, np.concatenate([cells.seeds, new]))
            continue
        if len(cells.seeds) < _MIN_CELLS_CLOSED and not surface.edges.rim.any():
            cells = voronoi_cells(metric, np.union1d(cells.seeds, np.argmax(cells.distance)))
            continue
        bordered = cut_borders(metric, cells)
        few_corners = np.flatnonzero([len(arcs) < _MIN_CORNERS for arcs in bordered.arcs])
        if not len(few_corners):
            return cells, bordered
        cells = _with_corners(metric, cells, few_corners, tried)
    raise AtlasError("no cells found that are disks with three corners")


def _with_corners(metric: Metric, cells: VoronoiCells, few: Ints, tried: set[int]) -> VoronoiCells:
    """Mend cells with too few corners: each gets a neighbour.

    If that was `tried` before, they lose their seeds instead.
    """
    new: list[int] = []
    gone: list[int] = []
    ends = metric.surface.edges.ends
    for cell in few.tolist():
        seed = int(cells.seeds[cell])
        if seed not in tried or len(cells.seeds) - len(gone) <= _MIN_CELLS_CLOSED:
            tried.add(seed)
            # farthest of the vertices of other cells that have a neighbour in this one
            own = cells.label == cell
            beside = np.zeros(len(cells.label), bool)
            beside[ends[own[ends].any(axis=1)]] = True
            new.append(int(np.argmax(np.where(beside & ~own, cells.distance, -1.0))))
        else:
            gone.append(cell)
    return voronoi_cells(metric, np.union1d(np.delete(cells.seeds, gone), new).astype(np.int64))


def _euler(surface: TriangleSurface, cells: VoronoiCells) -> Ints:
    """Euler characteristic of each cell: its vertices, and the edges and triangles between them."""
    count = len(cells.seeds)
    label = cells.label
    ends = label[surface.edges.ends]
    corners = label[surface.F]
    edges = ends[ends[:, 0] == ends[:, 1], 0]
    triangles = corners[(corners[:, 0] == corners[:, 1]) & (corners[:, 1] == corners[:, 2]), 0]
    vertex_count = np.bincount(label, minlength=count)
    edge_count = np.bincount(edges, minlength=count)
    triangle_count = np.bincount(triangles, minlength=count)
    return vertex_count - edge_count + triangle_count


def _far_side(surface: TriangleSurface, cells: VoronoiCells, cell: int) -> int:
    """Vertex farthest along the shortest loop in a cell that does not shrink to a point.

    Edges that close no such loop are those of a tree of shortest paths, and those of a tree of
    triangles, longest loops first (Erickson and Whittlesey 2005). All that lies outside the cell
    counts as one triangle.
    """
    edges = surface.edges
    own = cells.label == cell
    links = np.flatnonzero(own[edges.ends].all(axis=1))
    ends = edges.ends[links]
    lengths = np.maximum(surface.edge_lengths[links], np.finfo(np.float64).tiny)
    graph = csr_array(coo_array((lengths, tuple(ends.T)), shape=(len(own), len(own))))
    distance, before = dijkstra(
        graph, directed=False, indices=cells.seeds[cell], return_predecessors=True
    )
    tree = (before[ends[:, 0]] == ends[:, 1]) | (before[ends[:, 1]] == ends[:, 0])
    loop = distance[ends].sum(axis=1) + lengths
    inner = own[surface.F].all(axis=1)
    number = np.append(np.where(inner, np.cumsum(inner), 0), 0)  # 0: outside
    beside = number[edges.sides[links] // 3]  # -1 at a rim: the last
    longest_first = np.argsort(-loop, kind="stable")
    order = longest_first[~tree[longest_first]]
    closing = _last_closing(beside[order], int(inner.sum()) + 1)
    if closing < 0:
        return int(np.argmax(np.where(own, cells.distance, -1.0)))
    closing_ends = ends[order[closing]]
    return int(closing_ends[np.argmax(distance[closing_ends])])


def _last_closing(pairs: Ints, count: int) -> int:
    """The last pair [k, 2] of triangles that earlier pairs have joined already; -1 without one.

    There are `count` triangles.
    """
    root = list(range(count))
    closing = -1
    for number, (a, b) in enumerate(pairs.tolist()):
        while root[a] != a:
            root[a] = a = root[root[a]]
        while root[b] != b:
            root[b] = b = root[root[b]]
        if a == b:
            closing = number
        root[a] = b
    return closing


# The vertices on the borders of parts: part and vertex, each [b], and place [b, 2].
Border = tuple[Ints, Ints, Floats]


def flattened(surface: TriangleSurface, part: Ints, border: Border) -> Floats:
    """Places [m, 3, 2] of the triangles' corners, each part [m] laid out inside its border.

    A part that round-off folds with mean-value weights is laid out with equal ones.
    """
    size = len(surface.V)
    key, corners = np.unique(part[:, None] * size + surface.F, return_inverse=True)
    fixed = np.full(len(key), -1)
    on_border, vertex, place = border
    fixed[np.searchsorted(key, on_border * size + vertex)] = np.arange(len(vertex))
    start = np.where(fixed[:, None] >= 0, place[fixed], np.nan)
    # mean-value weights: in corner k of a triangle, of its next vertex and of the one before
    triangles = surface.V[surface.F]
    sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    to_neighbours = np.stack([sides, np.roll(sides, 1, axis=1)], axis=2)
    lengths = np.maximum(to_neighbours, np.finfo(np.float64).tiny)
    half_tangents = np.clip(np.tan(surface.angles / 2), _MIN_HALF_TANGENT, _MAX_HALF_TANGENT)
    weights = half_tangents[:, :, None] / lengths
    places = _solved(corners, weights, start)[corners]
    folded = np.isin(part, part[signed_areas(places) <= 0])
    if folded.any():
        weights[folded] = 1.0
        places = _solved(corners, weights, start)[corners]
    return places


def signed_areas(places: Floats) -> Floats:
    """Areas [m] of flat triangles [m, 3, 2], positive where they are counter-clockwise."""
    u = places[:, 1] - places[:, 0]
    v = places[:, 2] - places[:, 0]
    return (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2


def along(V: Floats, paths: list[Ints]) -> Floats:
    """How far along its path each vertex lies, from 0 to 1, one path after the other."""
    sizes = np.array([len(path) for path in paths])
    inside = np.arange(sizes.max()) < sizes[:, None]
    # a row a path, so that sums do not depend on the paths before
    vertices = np.zeros(inside.shape, np.int64)
    vertices[inside] = np.concatenate(paths)
    x, y, z = np.moveaxis(np.diff(V[vertices], axis=1), 2, 0)
    steps = np.where(inside[:, 1:], np.sqrt(x * x + y * y + z * z), 0.0)
    least = _MIN_STEP_SHARE * steps.max(axis=1, initial=0.0) + _MIN_STEP
    widened = np.where(inside[:, 1:], np.maximum(steps, least[:, None]), 0.0)
    lengths = np.cumsum(widened, axis=1)
    shares = np.concatenate([np.zeros((len(paths), 1)), lengths / lengths[:, -1:]], axis=1)
    return shares[inside]


def _solved(corners: Ints, weights: Floats, start: Floats) -> Floats:
    """Places [n, 2] of all vertices; places that are NaN in `start` are computed."""
    free = np.isnan(start[:, 0])
    count = int(free.sum())
    number = np.cumsum(free) - 1
    row = np.repeat(corners, 2, axis=1).ravel()
    column = np.stack([np.roll(corners, -1, axis=1), np.roll(corners, 1, axis=1)], axis=2).ravel()
    chosen = free[row]
    row = row[chosen]
    column = column[chosen]
    weight = weights.ravel()[chosen]
    weight /= np.bincount(row, weight, len(start))[row]
    is_inner = free[column]
    # each vertex less the mean of its free neighbours is the share of those on the border
    every = np.arange(count)
    entries = np.concatenate([np.ones(count), -weight[is_inner]])
    rows = np.concatenate([every, number[row[is_inner]]])
    columns = np.concatenate([every, number[column[is_inner]]])
    system = coo_array((entries, (rows, columns)), shape=(count, count)).tocsc()
    at_border = number[row[~is_inner]]
    share = weight[~is_inner, None] * start[column[~is_inner]]
    known = np.stack([np.bincount(at_border, share[:, k], count) for k in range(2)], axis=1)
    places = start.copy()
    # the matrix has a symmetric pattern and a dominant diagonal: it needs no pivots
    factors = splu(system, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    places[free] = factors.solve(known)
    return places
