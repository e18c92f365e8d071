"""The cells of a texel mesh: finite elements, and where the special cells lie.

A quad takes its gradient from its two diagonals (one-point integration), and has a little stiffness
against the one pattern that the gradient does not see, the hourglass + - + - (Flanagan and
Belytschko 1981). This pattern is a second derivative: its stiffness may be chosen, as long as
linear functions have none of the pattern. In a quad that is no parallelogram they have some. Where
the map onto the charts has kinks, eigenvalues then converge with order 1 to 1.6 instead of 2, so
that the share of linear functions is taken out of the hourglass.

The stiffness decides whether short waves lag behind or run ahead, and follows from the quad's
shape. Linear triangles give it far too much in a sheared quad: there waves ran ahead, by 3 % in the
median over the elephant at N = 96.

Vectors are three coordinates, of one point or of many. `shared` functions run in NumPy in double
precision, where a surface is at rest, and in a kernel in single precision, where it moves;
`quads.glsl` is their twin on the GPU. Lengths are in units of about the length of a cell.

The few special cells, which are no plain quads, are strips at rims, and triangles and polygons in
corners. Their places, and the links and texels to which they add, are worked out once; their
weights then follow from wherever their corners are. Between the last texels and a rim lies a strip
of half a texel. Where the rim is free, heights in the strip change along the rim only, and its area
goes to the texels. There is no strip where the rim has no positions.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Ints, kernel, shared
from ..mesh.vectors import Vector, cross, dot, subtract
from .stencil import crossing_links
from .topology import TRIANGLE, TexelTopology

Numbers: TypeAlias = Any  # a float, or an array of them

# Numbers in single precision, which holds them exactly: they do not make single numbers double.
_ZERO = np.float32(0)
_QUARTER = np.float32(0.25)
_HALF = np.float32(0.5)
_ONE = np.float32(1)
_TWO = np.float32(2)
_THREE = np.float32(3)
_FOUR = np.float32(4)

# One over the stiffness of a square against the hourglass, which is 0.4. At 1 waves lag along its
# sides as much as they lead along its diagonals, 1/2 makes the 5-point stencil, 1/3 an isotropic
# one, 1/4 allows the longest time step.
PER_HOURGLASS = np.float32(2.5)

# Elongated quads take up to this share of the hourglass stiffness that would begin to shorten their
# own time step.
SHARE = np.float32(0.75)

# A quad counts as uneven where the middles of its diagonals are further apart than the root of one
# over this, in units of the diagonals. In an even quad the hourglass share of linear functions is
# of second order, and makes up for some of the lag of waves: on the sphere N = 64 is a third more
# exact with it.
EVEN = np.float32(1000)

# Least area of a cell, in units of the area of a square of its size: a cell that is folded to a
# line would need an infinitely short time step.
LEAST_AREA = np.float32(0.02)

# Detours fade out in quads where |p|^2 |q|^2 - (p.q)^2 is below this share of |p|^2 |q|^2, with
# diagonals p and q.
FADED = np.float32(0.02)

# Area of a cell in one point.
_TINY = 1e-12
TINY = np.float32(_TINY)
PER_TINY = np.float32(1 / _TINY)

# A polygon flatter than this, in units of its size, counts as flat: many combinations of its
# corners then make the node in its middle. The square of this is well above round-off.
_FLAT_POLYGON = 1e-5

# Row and column of the four corners of a cell at (r, c), from there.
CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))

# Links of a cell at (r, c), in the order of `quad`: number of the link, and row and column of the
# place where it is stored, from (r, c).
LINKS = ((0, 0, 0), (0, 1, 0), (1, 0, 0), (1, 0, 1), (2, 0, 0), (3, 0, 0))

# Corners of the four kinds of strips: two on the surface, which the first four links join kind by
# kind, and opposite the two beyond the rim.
_STRIPS = ((0, 1, 2, 3), (2, 3, 0, 1), (0, 2, 1, 3), (1, 3, 0, 2))

# No places.
_NOTHING = np.zeros(0, np.int64)


@shared
def cross_length(a: Vector, b: Vector) -> Numbers:
    """Length of the vector product."""
    normal = cross(a, b)
    return np.sqrt(dot(normal, normal))


@shared
def quad(e: Vector, n: Vector, p: Vector, detours: Vector) -> tuple[Numbers, ...]:
    """Weights of the six links of a quad, and its area.

    The links are the south, north, west and east side, the diagonal sw-ne and the diagonal se-nw.
    The corners se, nw and ne are at e, n and p from sw; `detours` are in the order of the links.
    With diagonals p, q and u_p, u_q the differences along them, area |gradient|^2 is (|q|^2 u_p^2 -
    2 p.q u_p u_q + |p|^2 u_q^2) / 2 |p x q|, and 2 u_p u_q is the sum of squared differences along
    west and east, less that along south and north. The hourglass, less what the linear function of
    that gradient has of it, is (1 + a, -1 + b, -1 - b, 1 - a) at sw, se, nw, ne, where a p + b q is
    how far the quad is from a parallelogram, and next to none in an even one. A quad in one point
    has neither.
    """
    q = subtract(n, e)
    north = subtract(p, n)
    east = subtract(p, e)
    pp = dot(p, p)
    qq = dot(q, q)
    pq = dot(p, q)
    flat = cross_length(p, q)
    # the way between the diagonals' middles, twice; in a convex quad a and b lie between -1 and 1
    way = subtract(north, e)
    # what detours add to the squares of sides and diagonals, and so to the products of diagonals
    to_south = detours[0] * dot(e, e)
    to_north = detours[1] * dot(north, north)
    to_west = detours[2] * dot(n, n)
    to_east = detours[3] * dot(east, east)
    to_pp = detours[4] * pp
    to_qq = detours[5] * qq
    to_pq = _HALF * (to_west + to_east - to_south - to_north)
    # detours fade out where they would leave no quad: in a quad p.q is less than |p| |q|
    most = (pp + to_pp) * (qq + to_qq)
    both = pq + to_pq
    fit = np.minimum(
        np.maximum((most - both * both) / (FADED * np.maximum(most, TINY)), _ZERO), _ONE
    )
    to_pp = fit * to_pp
    to_qq = fit * to_qq
    to_pq = fit * to_pq
    square = np.maximum(
        flat * flat + (to_pp * (qq + to_qq) + pp * to_qq - to_pq * (pq + pq + to_pq)), _ZERO
    )
    pp = pp + to_pp
    qq = qq + to_qq
    pq = pq + to_pq
    along_p = dot(way, p) + _HALF * fit * (to_east + to_north - to_south - to_west)
    along_q = dot(way, q) + _HALF * fit * (to_east + to_south - to_north - to_west)
    twice = np.maximum(_TWO * np.maximum(np.sqrt(square), _HALF * LEAST_AREA * (pp + qq)), TINY)
    square = _QUARTER * twice * twice
    a = (along_p * qq - along_q * pq) / square
    b = (along_q * pp - along_p * pq) / square
    uneven = EVEN * (a * a + b * b)
    share = uneven / (uneven + _ONE)
    a = np.minimum(np.maximum(share * a, -_ONE), _ONE)
    b = np.minimum(np.maximum(share * b, -_ONE), _ONE)
    skew = pq / twice
    h = hourglass(pp, qq, pq, _QUARTER * twice)
    return (
        skew + h * (_ONE + a) * (_ONE - b),
        skew + h * (_ONE - a) * (_ONE + b),
        h * (_ONE + a) * (_ONE + b) - skew,
        h * (_ONE - a) * (_ONE - b) - skew,
        qq / twice - h * (_ONE - a * a),
        pp / twice - h * (_ONE - b * b),
        quad_area(e, n, p),
    )


@shared
def hourglass(pp: Numbers, qq: Numbers, pq: Numbers, area: Numbers) -> Numbers:
    """Hourglass stiffness of a quad, from its area and the products of its diagonals p and q.

    In a parallelogram with the squared sides a >= b, the product d of its sides and the area J, a
    wave of wave number k has omega^2 = k^2 - k^4 (a + b) / 16 + k^4 H (J^2 + 3 d^2) / 8 J in the
    mean over its directions, to leading order: waves are in time on average at H = (a + b) J / 2
    (J^2 + 3 d^2). Its time step begins to shorten at H = (a^2 - d^2) / 4 a J.
    """
    both_sides = np.maximum(_HALF * (pp + qq), TINY)
    a = _HALF * (both_sides + np.abs(pq))
    d = _QUARTER * (pp - qq)
    in_time = both_sides * area / (_TWO * (area * area + _THREE * d * d))
    free = (a * a - d * d) / (_FOUR * a * area)
    least = np.minimum(
        in_time, np.maximum(SHARE * free, _TWO * area / (PER_HOURGLASS * both_sides))
    )
    return np.minimum(PER_TINY * (pp + qq), _ONE) * least


@shared
def quad_area(e: Vector, n: Vector, p: Vector) -> Numbers:
    """Area of a quad, see `quad`, which need not be flat: the smaller of its triangulations.

    The flat area p x q / 2 misses what a fold holds, the other triangulation spans it twice.
    """
    rising = cross_length(e, p) + cross_length(p, n)
    falling = cross_length(e, n) + cross_length(subtract(p, e), subtract(n, e))
    return _HALF * np.minimum(rising, falling)


@shared
def triangle(a: Vector, b: Vector, c: Vector) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """Cotangent weights of the links bc, ca, ab of a triangle, and its area.

    See Pinkall and Polthier 1993.
    """
    ab = subtract(b, a)
    ac = subtract(c, a)
    bc = subtract(c, b)
    double_area = cross_length(ab, ac)
    longest = np.maximum(np.maximum(dot(ab, ab), dot(ac, ac)), dot(bc, bc))
    twice = np.maximum(2 * np.maximum(double_area, LEAST_AREA * longest), _TINY)
    return dot(ab, ac) / twice, -dot(ab, bc) / twice, dot(ac, bc) / twice, double_area / 2


@kernel
def polygons(corners: Floats) -> tuple[Floats, Floats]:
    """Link weights and shares of the area of m polygons in space [3, k, m].

    Weights [k (k - 1) / 2, m] are of the links of corners 0-1, 0-2 and so on, 1-2 and so on; shares
    are [k, m].

    A virtual node in the middle cuts each polygon into triangles. It is an affine combination of
    the corners, so that linear functions stay exact, and is eliminated (Bunge, Herholz, Kazhdan and
    Botsch 2020).
    """
    _, count, number = corners.shape
    links = np.empty((count * (count - 1) // 2, number))
    areas = np.zeros((count, number))
    sides = np.empty(count)
    spokes = np.empty(count)
    for m in range(number):
        x = corners[:, :, m]
        shares = _virtual_node(x)
        middle = _mean(x, shares)
        inner = 0.0
        total = 0.0
        link = 0
        for i in range(count):
            spokes[i] = 0.0
        for i in range(count):
            j = (i + 1) % count
            to_j, to_i, sides[i], area = triangle(x[:, i], x[:, j], middle)
            spokes[j] += to_j
            spokes[i] += to_i
            areas[i, m] += area / 3
            areas[j, m] += area / 3
            inner += area / 3
        for i in range(count):
            total += spokes[i]
        for i in range(count):
            areas[i, m] += shares[i] * inner
            for j in range(i + 1, count):
                weight = (
                    shares[j] * spokes[i] + shares[i] * spokes[j] - shares[i] * shares[j] * total
                )
                if j == i + 1:
                    weight += sides[i]
                elif i == 0 and j == count - 1:
                    weight += sides[j]
                links[link, m] = weight
                link += 1
    return links, areas


@kernel(no_cpython_wrapper=True)
def _virtual_node(corners: Floats) -> Floats:
    """Weights [k], of sum 1, at the corners of a polygon [3, k] that make its virtual node.

    The triangles of this point with the sides of the polygon have the least sum of squared areas.
    Of all weights that make it these are the most even ones.
    """
    count = corners.shape[1]
    # |x - c| x side, squared: x' A x - 2 b' x, with A = sum of |s|^2 1 - s s'
    squares = np.zeros((3, 3))
    right = np.zeros(3)
    spread = np.zeros((3, 3))
    weights = np.empty(count)
    total = 0.0
    for i in range(count):
        weights[i] = 1 / count
    mean = _mean(corners, weights)
    for i in range(count):
        here = subtract(corners[:, i], mean)
        side = subtract(corners[:, (i + 1) % count], corners[:, i])
        squared = dot(side, side)
        along = dot(side, here)
        for a in range(3):
            squares[a, a] += squared
            right[a] += squared * here[a] - side[a] * along
            for b in range(3):
                squares[a, b] -= side[a] * side[b]
                spread[a, b] += here[a] * here[b]
    slope = _solved(spread, _solved(squares, (right[0], right[1], right[2])))
    for i in range(count):
        weights[i] = 1 / count + dot(slope, subtract(corners[:, i], mean))
        total += weights[i]
    for i in range(count):
        weights[i] /= total
    return weights


@kernel(no_cpython_wrapper=True)
def _mean(corners: Floats, weights: Floats) -> tuple[float, float, float]:
    """The point with such weights at the corners [3, k]."""
    x = 0.0
    y = 0.0
    z = 0.0
    for i in range(len(weights)):
        x = x + weights[i] * corners[0, i]
        y = y + weights[i] * corners[1, i]
        z = z + weights[i] * corners[2, i]
    return x, y, z


@kernel(no_cpython_wrapper=True)
def _solved(matrix: Floats, right: Vector) -> tuple[float, float, float]:
    """Solution of a symmetric positive semidefinite system [3, 3].

    It is next to 0 in directions that the system leaves open.
    """
    ridge = _FLAT_POLYGON**2 * (matrix[0, 0] + matrix[1, 1] + matrix[2, 2]) + 1e-300
    first = matrix[0, 0] + ridge
    a = matrix[0, 1] / first
    b = matrix[0, 2] / first
    second = matrix[1, 1] + ridge - a * matrix[0, 1]
    coupling = matrix[1, 2] - a * matrix[0, 2]
    c = coupling / second
    third = matrix[2, 2] + ridge - b * matrix[0, 2] - c * coupling
    p = right[1] - a * right[0]
    z = (right[2] - b * right[0] - c * p) / third
    y = p / second - c * z
    return right[0] / first - a * y - b * z, y, z


def conductance(coefficients: Sequence[Floats], softening: Sequence[Floats]) -> Floats:
    """Harmonic mean of the coefficients at the corners of cells, as of media in series.

    0 where a coefficient is 0. The mean is softened by the least of the factors at the corners.
    """
    with np.errstate(divide="ignore"):
        resistance = sum(1 / coefficient for coefficient in coefficients)
    least_factor = functools.reduce(np.minimum, softening)
    return len(coefficients) / resistance * least_factor


def at_corners(field: NDArray) -> list[NDArray]:
    """A field [..., r + 1, c + 1] at the four corners of each of r x c cells."""
    rows = field.shape[-2] - 1
    columns = field.shape[-1] - 1
    return [field[..., r : rows + r, c : columns + c] for r, c in CORNERS]


@dataclasses.dataclass(frozen=True, eq=False)
class SpecialCells:
    """Cells of one kind, k of them.

    Attributes
    ----------
    corners : int64 [j, k]
        Flat places of their corners in a field with halo.
    law : callable
        From corners [3, j, k] to geometric weights of the links [l, k], shares of the areas [s, k],
        and the areas [k].
    links : (int64 [m], int64 [m])
        Flat indices, among the weights [l, k], of weights that are added, and the flat places among
        a stencil's weights to which they are added.
    shares : (int64 [m], int64 [m])
        Flat indices, among the shares [s, k], of shares that are added, and the flat texels to
        which they are added.
    irregular : (int64 [m], int64 [m, 2])
        Flat indices, among the weights, of links beyond the nine points, and the texels at both
        ends.
    on_all_copies : bool
        Whether `links` lists every copy of a link that crosses a glued side.
    """

    corners: Ints
    law: Callable[[Floats], tuple[Floats, Floats, Floats]]
    links: tuple[Ints, Ints]
    shares: tuple[Ints, Ints]
    irregular: tuple[Ints, Ints] = (_NOTHING, np.zeros((0, 2), np.int64))
    on_all_copies: bool = False

    def weigh(self, places: Floats, scale: float) -> tuple[Floats, Floats, Floats]:
        """Weights of the links [l, k], shares of the areas [s, k] and the areas [k], both [m^2].

        `places` [3, p] are the positions of a field with halo [m], and `scale` is one over about
        the length of a cell [1/m].
        """
        links, shares, areas = self.law(scale * places[:, self.corners])
        return links, shares / scale**2, areas / scale**2


def special_cells(topology: TexelTopology, halo_positions: Floats) -> list[SpecialCells]:
    """All cells of a texel mesh but the quads between four texels."""
    kinds = (*_rim_cells(topology, halo_positions), _triangles(topology), *_polygons(topology))
    return [cells for cells in kinds if cells.corners.size]


def _rim_cells(topology: TexelTopology, halo_positions: Floats) -> Iterator[SpecialCells]:
    """Strips between the last texels and a rim; at a fixed rim they are whole quads."""
    n = topology.shape[1]
    rim = topology.rim
    exists = np.logical_and.reduce(at_corners(topology.halo >= 0))
    touches = np.logical_or.reduce(at_corners(rim))
    chart, r, c = cells = np.stack(np.nonzero(exists & touches))
    corners = np.stack(
        [(chart * (n + 2) + r + down) * (n + 2) + c + right for down, right in CORNERS]
    )
    finite = np.isfinite(halo_positions.reshape(-1, 3)[corners]).all(axis=(0, 2))
    cells = cells[:, finite]
    corners = corners[:, finite]
    at_rim = rim.reshape(-1)[corners]
    shown = topology.halo.reshape(-1)[corners]
    # the share of a corner beyond the rim goes to the texel beside it
    belongs = np.broadcast_to(np.arange(4)[:, None], corners.shape).copy()
    for i in range(4):
        for j in range(4):
            belongs[i, at_rim[i] & ~at_rim[j] & (shown[i] == shown[j])] = j
    texels = np.take_along_axis(corners, belongs, axis=0)
    shares = np.flatnonzero(topology.own.reshape(-1)[texels])
    to_texels = shares, topology.halo.reshape(-1)[texels.ravel()[shares]]
    if topology.fixed_rim:
        yield SpecialCells(corners, _whole_quads, _link_places(topology, cells, LINKS), to_texels)
        return
    yield SpecialCells(corners, _areas, (_NOTHING, _NOTHING), to_texels)
    for (i, j, p, q), link in zip(_STRIPS, LINKS[:4], strict=True):
        here = ~at_rim[i] & ~at_rim[j] & at_rim[p] & at_rim[q]
        places = _link_places(topology, cells[:, here], (link,))
        yield SpecialCells(corners[[i, j, p, q]][:, here], _strips, places, (_NOTHING, _NOTHING))


def _triangles(topology: TexelTopology) -> SpecialCells:
    """The triangles in corners of three charts.

    Each of the charts adds the share of its own texel there, the first corner.
    """
    n = topology.shape[1]
    width = topology.halo.shape[1]
    corner, chart = np.nonzero(topology.valence.T == TRIANGLE)
    r, c = np.array([[0, 0, n, n], [0, n, n, 0]])[:, corner]
    # in a chart with halo: row and column of the chart's own texel, and those beyond it
    row, next_row = np.where(r == 0, [[1], [0]], [r, r + 1])
    column, next_column = np.where(c == 0, [[1], [0]], [c, c + 1])
    corners = (chart * width + np.stack([row, row, next_row])) * width + np.stack(
        [column, next_column, column]
    )
    # the east or west side, and the north or south one
    links = _link_places(topology, np.stack([chart, r, c]), ((1, 0, c == 0), (0, r == 0, 0)))
    own = np.arange(len(chart)), topology.halo.reshape(-1)[corners[0]]
    return SpecialCells(corners, _triangle, links, own)


def _polygons(topology: TexelTopology) -> Iterator[SpecialCells]:
    """Polygons by their number of corners.

    Their sides are links of the nine points, their diagonals are not.
    """
    for count in sorted({len(polygon) for polygon in topology.polygons}):
        alike = [polygon for polygon in topology.polygons if len(polygon) == count]
        texels = np.stack(alike, axis=1)
        first, second = np.triu_indices(count, 1)
        pairs = np.stack([texels[first], texels[second]], axis=-1).reshape(-1, 2)
        link, places = crossing_links(topology).between(pairs)
        beside = np.setdiff1d(np.arange(len(pairs)), link)
        corners = topology.addresses[0][texels]
        shares = np.arange(texels.size), texels.ravel()
        yield SpecialCells(
            corners, _polygon, (link, places), shares, (beside, pairs[beside]), on_all_copies=True
        )


def _link_places(topology: TexelTopology, cells: Ints, links: Sequence[tuple]) -> tuple[Ints, Ints]:
    """Links [l, k] of cells [3, k] that are stored, and their places in a stencil's weights.

    Both are flat.
    """
    n = topology.shape[1]
    chart, r, c = cells
    stored = []
    places = []
    for link, down, right in links:
        row = r + down
        column = c + right
        stored.append((row <= n) & (column <= n))
        places.append(((4 * chart + link) * (n + 1) + row) * (n + 1) + column)
    is_stored = np.stack(stored)
    return np.flatnonzero(is_stored), np.stack(places)[is_stored]


def _whole_quads(x: Floats) -> tuple[Floats, Floats, Floats]:
    """Six links, and a quarter of the area to each corner."""
    *links, area = quad(*_from_first(x), (_ZERO,) * 6)
    return np.stack(links), np.tile(area / 4, (4, 1)), area


def _areas(x: Floats) -> tuple[Floats, Floats, Floats]:
    """Quads without links."""
    area = quad_area(*_from_first(x))
    return np.zeros((0, len(area))), np.tile(area / 4, (4, 1)), area


def _strips(x: Floats) -> tuple[Floats, Floats, Floats]:
    """The link of the first two corners, which are texels at a free rim.

    The other two corners are the points of the rim beside them. Heights have no slope across a free
    rim (the natural condition). Their gradient in the strip is the difference of the two texels
    over their distance along the rim, at whatever angle the grid lines meet the rim.
    """
    link = x[:, 1] - x[:, 0]
    rim = x[:, 3] - x[:, 2]
    area = quad_area(*_from_first(x))
    squared = dot(rim, rim)
    along = dot(rim, link) ** 2 / np.maximum(squared, _TINY)
    least = LEAST_AREA * np.maximum(squared, dot(link, link))
    weight = np.where(squared > 0, area / np.maximum(np.maximum(along, least), _TINY), 0.0)
    return weight[None], np.zeros((0, len(weight))), area


def _triangle(x: Floats) -> tuple[Floats, Floats, Floats]:
    """The links of the first corner with the third and the second, and its share."""
    _, to_third, to_second, area = triangle(x[:, 0], x[:, 1], x[:, 2])
    return np.stack([to_third, to_second]), area[None] / 3, area


def _polygon(x: Floats) -> tuple[Floats, Floats, Floats]:
    """The links between all pairs of corners."""
    links, shares = polygons(np.ascontiguousarray(x))
    return links, shares, shares.sum(axis=0)


def _from_first(x: Floats) -> tuple[Floats, Floats, Floats]:
    """Ways from the first of four corners to the others."""
    return x[:, 1] - x[:, 0], x[:, 2] - x[:, 0], x[:, 3] - x[:, 0]
