"""A connected component of a mesh, cut into cells and these into quads: square charts, laid out.

Triangles between cells' middles are joined in pairs to quads, so that charts are large. Where as
many quads meet round a cell's middle as its curvature asks for, the map onto the charts is strained
least. By Gauss and Bonnet a cone where v quads meet has the curvature (4 - v) pi / 2; so v should
be 4 less the curvature of the cell in right angles. Any pairing follows from another by alternating
paths: joints are closed and opened in turn (Berge 1957). All short ones are tried, until none makes
the pairing better.

Chart a of a cell and the next one b round a corner lie at the same side of a triangle between
cells' middles, which is called by a: from the middle of a's cell to that of b's. Beyond it lies
another triangle, or, at a rim, the two charts round a corner, which are joined too.
"""

from __future__ import annotations

import contextlib
import dataclasses
from typing import NamedTuple

import numpy as np

from ...errors import AtlasError
from ...kernel import Bools, Floats, Ints, kernel
from ...mesh.topology import counting_sort
from .cells import BorderedCells, Metric, cell_sizes, centred_cells, spread_seeds
from .charts import (
    Fans,
    Path,
    Sides,
    charts_of,
    corner_charts,
    fans_of,
    glued_sides,
    on_paths,
    square_border,
    with_even_corners,
)
from .disks import disk_cells, flattened, signed_areas
from .surface import TriangleSurface, halved_chords, refined

# Least number of quads that meet round the middle of a cell.
FEWEST = 3

# Costs of a pairing of triangles; a quad too many or too few round a middle costs 1.
# Each quad that is missing to `FEWEST` costs this in addition.
_COST_MISSING = 100.0

# Each quad too many or too few beyond the first costs this in addition.
_COST_EXTRA = 2.0

# The squared logarithm of the ratio of a quad's diagonals costs this.
_COST_SHAPE = 0.5

# Joints that an alternating path closes, at most.
_MAX_PATH_JOINTS = 11

# Joints that a path closes, at most, if triangles would stay unpaired otherwise.
_MAX_PATH_JOINTS_LAST_TRY = 16

# Passes over all joints that make a pairing better.
_MAX_PAIRING_PASSES = 20

# Cost that a change of a pairing must save.
_MIN_GAIN = 1e-6

# Cells of a mesh that has texels enough for them.
CELLS = 96

# If quads are large, so many times as many cells are cut.
_LARGE_CELL_FACTOR = 1.5

# Corners of an average cell, and thus its small quads.
_CORNERS_PER_CELL = 6

# Largest radius of cells, over the square root of a cell's share of the area.
_LARGEST_RADIUS = 0.75

# Radius of a cell on a limb, over the radius at which a geodesic disk is wrapped round the limb.
_LIMB_SHARE = 0.5

# Smallest radius of cells, over the largest.
_SMALLEST_SHARE = 0.85

# Length of a surface over its width, times the number of its cells, at most. At 88**2 laying charts
# takes a minute.
_MAX_LENGTH_TIMES_CELLS = 100**2

# Area of a surface of `CELLS` cells, in squares of its longest edge after refinement.
_AREA_IN_EDGE_SQUARES = 2000

# If round-off folds a triangle, so many times as many cells are tried: other cuts may fold none.
_OTHER_COUNTS = (2, 3, 5)


class Pairing(NamedTuple):
    """Triangles and the joints between them, of which some are closed.

    Where the number of triangles is odd, there is a node more, which lies beyond all rims.
    """

    start: Ints  # [t + 1], where the joints of each begin
    joint: Ints  # by triangle
    ends: Ints  # [k, 2], triangles on either side of each joint
    middles: Ints  # [k, 2], cells of which a closed joint takes a quad each; -1: none
    cost: Floats  # [k], of a closed joint
    closed: Ints  # [t], joint; -1
    quads: Ints  # [cells], round each middle
    wanted: Floats  # [cells]
    passed: Bools  # [t], by the path that is tried


def chosen_joints(
    triangles: Ints,
    middles: Ints,
    shape: Floats,
    triangle_count: int,
    corners: Ints,
    wanted: Floats,
) -> Ints | None:
    """Close one joint of each triangle; each cell's middle gets about as many quads as wanted.

    A joint is a side between triangles, over which these may be joined.

    Parameters
    ----------
    triangles : int64 [k, 2]
        On either side; -1 where there lies none, and where the triangle may stay alone.
    middles : int64 [k, 2]
        Cells at the ends.
    shape : float64 [k]
        Logarithm of the ratio of the diagonals of the quad.
    corners : int64 [cells]
        How many meet round each cell's middle before any are joined.
    wanted : float64 [cells]
        How many should.

    Returns
    -------
    int64 [l] or None
        At most one with a triangle that stays alone; None if no way is found with three quads round
        every middle.
    """
    kept = np.flatnonzero((triangles[:, 1] >= 0) | (triangle_count % 2 == 1))
    ends = triangles[kept]
    inner = ends[:, 1] >= 0
    nodes = triangle_count + triangle_count % 2
    if not nodes:
        return kept[:0]
    ends = np.where(ends < 0, triangle_count, ends)
    start, order = counting_sort(ends.T.ravel(), np.arange(ends.size), nodes)
    taken = np.where(inner[:, None], middles[kept], -1)
    cost = np.where(inner, _COST_SHAPE * shape[kept] ** 2, 0.0)
    closed = np.full(nodes, -1)
    passed = np.zeros(nodes, bool)
    pairing = Pairing(
        start, order % len(kept), ends, taken, cost, closed, corners.copy(), wanted, passed
    )
    if not _paired(pairing) or pairing.quads.min() < FEWEST:
        return None
    return kept[np.unique(pairing.closed)]


def _paired(pairing: Pairing) -> bool:
    """Find a pairing and make it better; whether no triangle is left."""
    for most in (1, _MAX_PATH_JOINTS, _MAX_PATH_JOINTS_LAST_TRY):
        for node in range(len(pairing.closed)):
            if pairing.closed[node] < 0:
                _augment(pairing, node, most, np.inf)
    if (pairing.closed < 0).any():
        return False
    for _ in range(_MAX_PAIRING_PASSES):
        joints = range(len(pairing.ends))
        better = [_improve(pairing, e) for e in joints if pairing.closed[pairing.ends[e, 0]] != e]
        if not any(better):
            break
    return True


@kernel
def _improve(pairing: Pairing, e: int) -> bool:
    """Close an open joint, and pair what that leaves; whether that is better."""
    a, b = pairing.ends[e]
    f = pairing.closed[a]
    g = pairing.closed[b]
    cost = (
        _set_joint(pairing, f, False) + _set_joint(pairing, g, False) + _set_joint(pairing, e, True)
    )
    left = pairing.ends[f, 0] + pairing.ends[f, 1] - a
    pairing.passed[a] = pairing.passed[b] = True
    better = _augment(pairing, left, _MAX_PATH_JOINTS, -_MIN_GAIN - cost)
    pairing.passed[a] = pairing.passed[b] = False
    if not better:
        _set_joint(pairing, e, False)
        _set_joint(pairing, f, True)
        _set_joint(pairing, g, True)
    return better


@kernel
def _augment(pairing: Pairing, node: int, most: int, limit: float) -> bool:
    """Pair a triangle, and another unpaired one, along the best path if it costs less than `limit`.

    All alternating paths that close up to `most` joints are tried, depth first.
    """
    path = np.empty(most, np.int64)
    best_path = np.empty(most, np.int64)
    cost = np.empty(most)
    nodes = np.empty(most, np.int64)
    following = np.empty(most, np.int64)
    nodes[0] = node
    following[0] = pairing.start[node]
    cost[0] = 0.0
    length = 0
    best = np.inf
    best_length = 0
    pairing.passed[node] = True
    while length >= 0:
        if following[length] == pairing.start[nodes[length] + 1]:
            length -= 1
            if length >= 0:  # back over a closed joint and an open one
                e = path[length]
                beyond = nodes[length + 1]
                other = pairing.ends[e, 0] + pairing.ends[e, 1] - nodes[length]
                _change(pairing, e, 1)
                _change(pairing, pairing.closed[other], -1)
                pairing.passed[other] = pairing.passed[beyond] = False
            continue
        e = pairing.joint[following[length]]
        following[length] += 1
        other = pairing.ends[e, 0] + pairing.ends[e, 1] - nodes[length]
        if pairing.passed[other]:
            continue
        f = pairing.closed[other]
        path[length] = e
        if f < 0:
            total = cost[length] + _change(pairing, e, -1)
            _change(pairing, e, 1)
            if total < best:
                best = total
                best_length = length + 1
                for i in range(best_length):
                    best_path[i] = path[i]
        elif length + 1 < most:
            beyond = pairing.ends[f, 0] + pairing.ends[f, 1] - other
            pairing.passed[other] = pairing.passed[beyond] = True
            cost[length + 1] = cost[length] + _change(pairing, f, 1) + _change(pairing, e, -1)
            length += 1
            nodes[length] = beyond
            following[length] = pairing.start[beyond]
    pairing.passed[node] = False
    if not best < limit:
        return False
    for i in range(best_length):
        e = best_path[i]
        other = pairing.ends[e, 0] + pairing.ends[e, 1] - node
        f = pairing.closed[other]
        if f >= 0:
            node = pairing.ends[f, 0] + pairing.ends[f, 1] - other
            _set_joint(pairing, f, False)
        _set_joint(pairing, e, True)
    return True


@kernel
def _set_joint(pairing: Pairing, e: int, close: bool) -> float:
    """Join or part the triangles at a joint; return what that costs."""
    pairing.closed[pairing.ends[e, 0]] = pairing.closed[pairing.ends[e, 1]] = e if close else -1
    return _change(pairing, e, -1 if close else 1)


@kernel
def _change(pairing: Pairing, e: int, quads: int) -> float:
    """Quads more or fewer round the middles at a joint; return what that costs."""
    cost = -quads * pairing.cost[e]
    for k in range(2):
        v = pairing.middles[e, k]
        if v >= 0:
            for sign in (-1.0, 1.0):
                count = pairing.quads[v]
                off = abs(count - pairing.wanted[v])
                cost += sign * (
                    off + _COST_EXTRA * max(off - 1.0, 0.0) + _COST_MISSING * max(FEWEST - count, 0)
                )
                if sign < 0.0:
                    pairing.quads[v] += quads
    return cost


def joined(surface: TriangleSurface, chart: Ints, sides: list[Sides]) -> list[Sides] | None:
    """Join the charts of cells to larger ones: their sides, or None if that is not possible."""
    glued = glued_sides(sides)
    fans, rest = fans_of(sides, glued)
    # charts of one cell begin at its middle
    cell = np.unique([chart_sides[0][0] for chart_sides in sides], return_inverse=True)[1]
    at_rim = (glued[..., 0] < 0)[:, 1:3]
    if not at_rim[rest].any(axis=1).all():
        return None
    triangles, middles, shape, side = _joints(surface.V, sides, glued, fans)
    wanted = 4 - _curvatures(surface, cell[chart]) + np.bincount(cell, at_rim.all(axis=1))
    chosen = chosen_joints(triangles, cell[middles], shape, len(fans), np.bincount(cell), wanted)
    if chosen is None:
        return None
    is_alone = triangles[chosen, 1] < 0
    joined_sides = side[chosen[~is_alone]]
    lone_sides = side[chosen[is_alone]]
    large = [_two_triangles(sides, glued, a) for a in joined_sides]
    large += [_lone_triangle(sides, glued, a) for a in lone_sides]
    # beyond the side of a lone triangle the charts at the rim stay apart
    large += _at_rim(sides, glued, rest, glued[lone_sides, 0, 0])
    glued_to_itself = glued_sides(large)[..., 0] == np.arange(len(large))[:, None]
    return None if glued_to_itself.any() else large


def _curvatures(surface: TriangleSurface, cell: Ints) -> Floats:
    """Curvature of each cell and its rim [right angles]; `cell` [m] is each triangle's."""
    total = np.bincount(surface.F.ravel(), surface.angles.ravel(), len(surface.V))
    missing = np.where(surface.at_rim, np.pi, 2 * np.pi) - total
    share = (missing / total)[surface.F] * surface.angles
    return np.bincount(cell, share.sum(axis=1)) / (np.pi / 2)


def _two_triangles(sides: list[Sides], glued: Ints, a: int) -> Sides:
    """The quad of two triangles that are joined over the side a."""
    b = glued[a, 1, 0]
    beyond = glued[a, 0, 0]
    return (
        _whole(sides, glued, b),
        _whole(sides, glued, glued[b, 1, 0]),
        _whole(sides, glued, beyond),
        _whole(sides, glued, glued[beyond, 1, 0]),
    )


def _lone_triangle(sides: list[Sides], glued: Ints, a: int) -> Sides:
    """The quad of a triangle that stays alone: its fourth corner is the middle of the side a."""
    b = glued[a, 1, 0]
    return (
        sides[a][0],
        sides[b][3],
        _whole(sides, glued, b),
        _whole(sides, glued, glued[b, 1, 0]),
    )


def _joints(
    V: Floats, sides: list[Sides], glued: Ints, fans: Fans
) -> tuple[Ints, Ints, Floats, Ints]:
    """Joints as `chosen_joints` takes them, with charts in the place of their cells.

    The last array has the chart that calls each joint.
    """
    fan = np.full(len(sides), -1)
    fan[np.array(fans, np.int64).reshape(-1, 3)] = np.arange(len(fans))[:, None]
    joints = []
    for a in np.flatnonzero(fan >= 0).tolist():
        b = int(glued[a, 1, 0])
        beyond = int(glued[a, 0, 0])
        if fan[beyond] >= 0:
            # the triangle beyond calls the side by another chart: it counts once
            if a >= glued[beyond, 2, 0]:
                continue
            # two triangles with two sides in common would be glued to themselves
            common_sides = (fan[glued[fans[fan[a]], 0, 0]] == fan[beyond]).sum()
            if common_sides != 1:
                continue
        joints.append((a, b, glued[b, 1, 0], glued[beyond, 1, 0], beyond))
    first, second, third, fourth, other = np.array(joints, dtype=np.int64).reshape(-1, 5).T
    middle = V[[chart_sides[0][0] for chart_sides in sides]]
    along = np.linalg.norm(middle[first] - middle[second], axis=1)
    across = np.linalg.norm(middle[third] - middle[fourth], axis=1)
    shape = np.log(np.maximum(across, 1e-300) / np.maximum(along, 1e-300))
    return (
        np.stack([fan[first], fan[other]], axis=1),
        np.stack([first, second], axis=1),
        shape,
        first,
    )


def _whole(sides: list[Sides], glued: Ints, a: int) -> Path:
    """The side of a triangle, from middle to middle."""
    return np.concatenate([sides[a][0], sides[glued[a, 1, 0]][3][1:]])


def _at_rim(sides: list[Sides], glued: Ints, rest: list[int], apart: Ints) -> list[Sides]:
    """Charts at the rim: the two round a corner are joined, unless they have to stay apart.

    `apart` has the second charts of the corners whose two charts stay apart.
    """
    new = []
    for b in rest:
        a = int(glued[b, 2, 0])
        before = int(glued[b, 1, 0])
        if a < 0 and before < 0:
            new.append(sides[b])
        elif a >= 0:
            # chart a has the rim before the corner, and b behind it
            if b in apart or a in apart:
                new += [sides[a], sides[b]]
            else:
                rim = np.concatenate([sides[b][1], sides[a][2][1:]])
                new.append((rim, sides[a][3], _whole(sides, glued, a), sides[b][0]))
    return new


@dataclasses.dataclass(frozen=True, eq=False)
class Quads:
    """A surface laid out on charts, without a fold.

    Attributes
    ----------
    surface : TriangleSurface
    chart : int64 [m]
        On which each triangle lies.
    places : float64 [m, 3, 2]
        Column and row of its corners, from 0 to 1 across the chart.
    glued : int64 [C, 4, 2]
        Chart and side beyond each side; -1 at a rim.
    cut : bool [n]
        Vertices that were not there before the surface was cut.
    """

    surface: TriangleSurface
    chart: Ints
    places: Floats
    glued: Ints
    cut: Bools


def cut_into_quads(cells: BorderedCells) -> Quads:
    """Cut cells into quads, one for each corner, even them out, and lay out each as a square.

    Raises `AtlasError` if round-off folds a triangle: they are too thin.
    """
    return _laid_out(cells, *with_even_corners(*corner_charts(cells)))


def cut_into_large_quads(cells: BorderedCells) -> Quads | None:
    """Cut cells into about as many quads as cells; None if that is not possible.

    Two cells that go all round a limb have no such quads, for instance.

    Raises `AtlasError` if round-off folds a triangle: they are too thin.
    """
    surface, chart, sides = corner_charts(cells)
    large = joined(surface, chart, sides)
    return None if large is None else _laid_out(cells, surface, large)


def _laid_out(cells: BorderedCells, surface: TriangleSurface, sides: list[Sides]) -> Quads:
    chart = charts_of(surface, sides)
    surface, origin = halved_chords(surface, chart, on_paths(surface, sides))
    chart = chart[origin]
    places = flattened(surface, chart, square_border(surface, sides))
    folded = int((signed_areas(places) <= 0).sum())
    if folded:
        raise AtlasError(f"{folded} triangles of the surface are too thin to be laid out flat")
    return Quads(
        surface, chart, places, glued_sides(sides), np.arange(len(surface.V)) >= cells.uncut
    )


def quads_of(part: TriangleSurface, count: int, large: bool) -> Quads:
    """The quads of a number of cells, large ones if wanted and possible.

    Otherwise there are about as many small ones.

    Raises `AtlasError` if round-off folds a triangle with every choice of cells.
    """
    quads = large_quads_of(part, count) if large else None
    if quads is not None:
        return quads
    cell_count = count
    if large:
        cell_count = max(1, round(count * _LARGE_CELL_FACTOR / _CORNERS_PER_CELL))
    try:
        return cut_into_quads(_cells_of(part, cell_count))
    except AtlasError:
        for times in _OTHER_COUNTS:
            with contextlib.suppress(AtlasError):
                return cut_into_quads(_cells_of(part, times * cell_count))
        raise


def large_quads_of(part: TriangleSurface, count: int) -> Quads | None:
    """Large quads, about as many as cells or some more.

    None if the surface has none or is too long, or round-off folds one of them.
    """
    most_cells = int(_MAX_LENGTH_TIMES_CELLS / _length(part))
    cell_count = max(count, min(round(_LARGE_CELL_FACTOR * count), most_cells))
    try:
        return cut_into_large_quads(_cells_of(part, cell_count))
    except AtlasError:
        return None


def _length(part: TriangleSurface) -> float:
    """Length of a surface over its width."""
    return float(np.ptp(part.V, axis=0).max()) ** 2 / part.areas.sum()


def _cells_of(part: TriangleSurface, count: int) -> BorderedCells:
    """About `count` cells of a surface, or as many as a very long surface allows.

    Raises `AtlasError` if it is too long for a single cell.
    """
    area = part.areas.sum()
    most_cells = int(_MAX_LENGTH_TIMES_CELLS / _length(part))
    if most_cells < 1:
        raise AtlasError(
            f"the surface is about {_length(part):.2g} times as long as wide, too long for charts: "
            f"shorten what sticks out of it, or scale it alike along all axes"
        )
    count = min(count, most_cells)
    longest_edge = np.sqrt(area / (_AREA_IN_EDGE_SQUARES / CELLS * count))  # [m]
    metric = Metric.of(refined(part, longest_edge))
    reach = np.inf  # a single cell covers all
    if count > 1:
        largest = _LARGEST_RADIUS * np.sqrt(area / count)  # [m]
        bounds = _SMALLEST_SHARE * largest, largest
        sizes = cell_sizes(metric, _LIMB_SHARE, bounds, count)
        metric = metric.in_units(sizes)
        reach = 1.0
    return disk_cells(metric, centred_cells(metric, spread_seeds(metric, reach)))
