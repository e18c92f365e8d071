"""The finite elements of a texel mesh: the stiffness of its quads, triangles and polygons.

The gradient of a quad comes from its two diagonals (one-point integration). The quad also has a
little stiffness against the one pattern that this gradient does not see, the hourglass + - + -
(Flanagan and Belytschko 1981). The pattern is a second derivative, so its stiffness may be chosen,
provided that linear functions contain none of the pattern. In a quad that is no parallelogram they
contain some. If this share stayed, eigenvalues would converge with order 1 to 1.6 instead of 2
where the map onto the charts has kinks. So the share is subtracted from the hourglass.

The hourglass stiffness follows from the quad's shape, and decides whether short waves are too slow
or too fast. Linear triangles would make it far too large in a sheared quad: waves were 3 % too fast
in the median over the elephant at N = 96.

Vectors are three coordinates, of one point or of many. `shared` functions run in NumPy in double
precision, where a surface is at rest, and in a kernel in single precision, where it moves;
`quads.glsl` is their twin on the GPU. Lengths are in units of about the length of a cell.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from ..kernel import Floats, kernel, shared
from ..mesh.vectors import Vector, cross, dot, subtract

Numbers: TypeAlias = Any  # a float, or an array of them

# Numbers in single precision: products with single-precision numbers then stay in single precision.
ZERO = np.float32(0)
_QUARTER = np.float32(0.25)
_HALF = np.float32(0.5)
_ONE = np.float32(1)
_TWO = np.float32(2)
_THREE = np.float32(3)
_FOUR = np.float32(4)

# One over the hourglass stiffness of a square, which is 0.4. A stiffness of 1 makes waves as much
# too slow along the sides as too fast along the diagonals, 1/2 gives the 5-point stencil, 1/3 an
# isotropic stencil, and 1/4 the longest time step.
PER_HOURGLASS = np.float32(2.5)

# Hourglass stiffness of an elongated quad, at most, over the stiffness at which the quad's own time
# step would begin to get shorter.
MAX_HOURGLASS_SHARE = np.float32(0.75)

# A quad counts as uneven if the distance between the middles of its diagonals is more than
# 1 / sqrt(EVENNESS), in units of the diagonals. In an even quad the hourglass share of linear
# functions is of second order, and compensates a part of the error of wave speeds: on the sphere
# the error at N = 64 is a third smaller with it.
EVENNESS = np.float32(1000)

# Area of a cell, at least, in units of the area of a square of its size: a cell folded to a line
# would need an infinitely short time step.
MIN_AREA = np.float32(0.02)

# Detours fade out in quads where |p|^2 |q|^2 - (p.q)^2 is below this share of |p|^2 |q|^2, with
# diagonals p and q.
DETOUR_FADE = np.float32(0.02)

# Area of a cell whose corners are one point.
TINY_AREA = 1e-12
TINY = np.float32(TINY_AREA)
PER_TINY = np.float32(1 / TINY_AREA)

# A polygon flatter than this, in units of its size, counts as flat: many combinations of its
# corners then make the node in its middle. The square of this is well above round-off.
_FLAT_POLYGON = 1e-5


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

    Gradient: with diagonals p, q and the differences u_p, u_q along them, area |gradient|^2 is
    (|q|^2 u_p^2 - 2 p.q u_p u_q + |p|^2 u_q^2) / 2 |p x q|. There 2 u_p u_q is the sum of the
    squared differences along west and east, less the sum along south and north.

    Hourglass: (1 + a, -1 + b, -1 - b, 1 - a) at sw, se, nw, ne. It is (1, -1, -1, 1) less the share
    that the linear function with the same gradient has of it. The vector a p + b q is the distance
    from a parallelogram, which hardly counts in an even quad.

    A quad in one point has no stiffness of either kind.
    """
    q = subtract(n, e)
    north = subtract(p, n)
    east = subtract(p, e)
    pp = dot(p, p)
    qq = dot(q, q)
    pq = dot(p, q)
    cross_pq = cross_length(p, q)
    # twice the way between the diagonals' middles; in a convex quad a and b lie between -1 and 1
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
    limit = (pp + to_pp) * (qq + to_qq)
    new_pq = pq + to_pq
    room = limit - new_pq * new_pq
    fit = np.minimum(np.maximum(room / (DETOUR_FADE * np.maximum(limit, TINY)), ZERO), _ONE)
    to_pp = fit * to_pp
    to_qq = fit * to_qq
    to_pq = fit * to_pq
    # |p x q|^2 = |p|^2 |q|^2 - (p.q)^2, and what detours add to it
    to_square = to_pp * (qq + to_qq) + pp * to_qq - to_pq * (pq + pq + to_pq)
    square = np.maximum(cross_pq * cross_pq + to_square, ZERO)
    pp = pp + to_pp
    qq = qq + to_qq
    pq = pq + to_pq
    along_p = dot(way, p) + _HALF * fit * (to_east + to_north - to_south - to_west)
    along_q = dot(way, q) + _HALF * fit * (to_east + to_south - to_north - to_west)
    thick = np.maximum(np.sqrt(square), _HALF * MIN_AREA * (pp + qq))
    twice = np.maximum(_TWO * thick, TINY)  # 2 |p x q|, four times the area
    square = _QUARTER * twice * twice
    a = (along_p * qq - along_q * pq) / square
    b = (along_q * pp - along_p * pq) / square
    uneven = EVENNESS * (a * a + b * b)
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
    of_square = _TWO * area / (PER_HOURGLASS * both_sides)
    stiffness = np.minimum(in_time, np.maximum(MAX_HOURGLASS_SHARE * free, of_square))
    return np.minimum(PER_TINY * (pp + qq), _ONE) * stiffness


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
    twice = np.maximum(2 * np.maximum(double_area, MIN_AREA * longest), TINY_AREA)
    return dot(ab, ac) / twice, -dot(ab, bc) / twice, dot(ac, bc) / twice, double_area / 2


@kernel
def polygons(corners: Floats) -> tuple[Floats, Floats]:
    """Link weights and shares of the area of m polygons in space [3, k, m].

    Weights [k (k - 1) / 2, m] are of the links of corners 0-1, 0-2 and so on, 1-2 and so on; shares
    of the area are [k, m].

    A virtual node in the middle cuts each polygon into triangles. It is an affine combination of
    the corners, so that linear functions stay exact, and is eliminated (Bunge, Herholz, Kazhdan and
    Botsch 2020). With the weights w_i of the corners in the node, and the cotangent weights s_i of
    the spokes from the corners to the node, the elimination gives the link of the corners i and j
    the weight w_j s_i + w_i s_j - w_i w_j sum s. A side of the polygon has its own weight, too.
    """
    _, count, number = corners.shape
    links = np.empty((count * (count - 1) // 2, number))
    areas = np.zeros((count, number))
    sides = np.empty(count)
    spokes = np.empty(count)
    for m in range(number):
        x = corners[:, :, m]
        shares = _virtual_node(x)
        node = _mean(x, shares)
        node_area = 0.0
        total = 0.0
        link = 0
        for i in range(count):
            spokes[i] = 0.0
        for i in range(count):
            j = (i + 1) % count
            to_j, to_i, sides[i], area = triangle(x[:, i], x[:, j], node)
            spokes[j] += to_j
            spokes[i] += to_i
            areas[i, m] += area / 3
            areas[j, m] += area / 3
            node_area += area / 3
        for i in range(count):
            total += spokes[i]
        for i in range(count):
            areas[i, m] += shares[i] * node_area
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
    # the sum over the sides s, from corners c, of |(x - c) x s|^2 is x' A x - 2 b' x + const., with
    # A = sum of |s|^2 1 - s s' (`squares`) and b = sum of |s|^2 c - s (s.c) (`right`)
    squares = np.zeros((3, 3))
    right = np.zeros(3)
    spread = np.zeros((3, 3))
    weights = np.empty(count)
    total = 0.0
    for i in range(count):
        weights[i] = 1 / count
    mean = _mean(corners, weights)
    for i in range(count):
        corner = subtract(corners[:, i], mean)
        side = subtract(corners[:, (i + 1) % count], corners[:, i])
        squared = dot(side, side)
        along = dot(side, corner)
        for a in range(3):
            squares[a, a] += squared
            right[a] += squared * corner[a] - side[a] * along
            for b in range(3):
                squares[a, b] -= side[a] * side[b]
                spread[a, b] += corner[a] * corner[b]
    # the most even weights are linear in the corners' places
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
    """Solution of a symmetric positive semidefinite system [3, 3], by elimination.

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

    It is 0 where a coefficient is 0, and is multiplied by the least of the softening factors at the
    corners.
    """
    with np.errstate(divide="ignore"):
        resistance = sum(1 / coefficient for coefficient in coefficients)
    least_factor = functools.reduce(np.minimum, softening)
    return len(coefficients) / resistance * least_factor
