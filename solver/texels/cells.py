"""Finite elements of one cell of the texel mesh: link weights and area of a quad, a triangle, a strip.

A quad takes its gradient from its two diagonals (one-point integration), and a little stiffness against the one pattern
that this does not see, the hourglass + - + - (Flanagan and Belytschko 1981). That pattern is a second derivative: its
stiffness is free, as long as linear functions have none of it. In a quad that is no parallelogram they have: where the
map onto the charts has kinks, eigenvalues then converge with order 1 to 1.6 instead of 2, so that it is taken away.

The stiffness decides whether short waves lag behind or run ahead, and follows from the quad's shape. Linear triangles
give it far too much in a sheared quad: there waves ran ahead, by 3 % in the median over the elephant at N = 96.

Vectors of three coordinates, of one point or of many, in kernels and in NumPy.

Finite element of a polygon in space with any number of corners.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from ..kernel import Floats, kernel, shared

Numbers: TypeAlias = Any  # a float, or an array of them
Points: TypeAlias = Any  # coordinates [3] of a point, or [3, ...] of many


@shared
def or_one(x: Numbers) -> Numbers:
    """1 in place of 0: what is divided by it is 0 as well."""
    return x + (x == 0)


@shared
def dot(a: Points, b: Points) -> Numbers:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@shared
def cross_length(a: Points, b: Points) -> Numbers:
    """Length of the vector product."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return np.sqrt(x * x + y * y + z * z)


@shared
def between(a: Points, b: Points) -> Points:
    """Difference b - a."""
    return (b[0] - a[0], b[1] - a[1], b[2] - a[2])


# Stiffness of a square against the hourglass. At 1 waves lag along its sides as much as they lead along its diagonals,
# 1/2 makes the 5-point stencil, 1/3 an isotropic one, 1/4 allows the longest time step.
HOURGLASS = 0.4

# Elongated quads take up to this share of the hourglass stiffness that would begin to shorten their own time step.
SHARE = 0.75

# A quad whose diagonals have their middles further apart than the root of this, in units of the diagonals, counts as
# uneven. In an even one what linear functions have of the hourglass is of second order, and makes up for some of the
# waves' lag: on the sphere N = 64 is a third more exact with it.
UNEVEN = 1e-3

# A cell folded to a line would ask for an infinitely short time step: least area, in units of a square's as large.
LEAST_AREA = 0.02


@shared
def quad(sw: Points, se: Points, nw: Points, ne: Points) -> tuple[Numbers, ...]:
    """Weights of a quad's links: south, north, west and east side, diagonal sw-ne, diagonal se-nw; its area.

    With diagonals p, q and u_p, u_q the differences along them, area |gradient|^2 is
    (|q|^2 u_p^2 - 2 p.q u_p u_q + |p|^2 u_q^2) / 2 |p x q|, and 2 u_p u_q is the sum of squared differences along west
    and east, less that along south and north. The hourglass, less what the linear function of that gradient has of it,
    is (1 + a, -1 + b, -1 - b, 1 - a) at sw, se, nw, ne, where a p + b q is how far the quad is from a parallelogram.
    A quad in one point has neither.
    """
    p, q = between(sw, ne), between(se, nw)
    pp, qq, pq, cross = dot(p, p), dot(q, q), dot(p, q), cross_length(p, q)
    twice = or_one(2 * np.maximum(cross, LEAST_AREA / 2 * (pp + qq)))
    hourglass = (pp + qq != 0) * _hourglass(or_one(pp), or_one(qq), pq, twice / 4)
    a, b = _unevenness(p, q, between(between(sw, se), between(nw, ne)), twice / 2)
    return (
        pq / twice + hourglass * (1 + a) * (1 - b),
        pq / twice + hourglass * (1 - a) * (1 + b),
        hourglass * (1 + a) * (1 + b) - pq / twice,
        hourglass * (1 - a) * (1 - b) - pq / twice,
        qq / twice - hourglass * (1 - a * a),
        pp / twice - hourglass * (1 - b * b),
        quad_area(sw, se, nw, ne),
    )


@shared
def _unevenness(p: Points, q: Points, way: Points, cross: Numbers) -> tuple[Numbers, Numbers]:
    """Twice the way between the middles of the diagonals p, q, in units of these; next to none in an even quad.

    In a convex quad both numbers lie between -1 and 1.
    """
    pp, qq, pq, along_p, along_q = dot(p, p), dot(q, q), dot(p, q), dot(way, p), dot(way, q)
    a, b = (along_p * qq - along_q * pq) / cross**2, (along_q * pp - along_p * pq) / cross**2
    share = (a * a + b * b) / (a * a + b * b + UNEVEN)
    return np.minimum(np.maximum(share * a, -1.0), 1.0), np.minimum(np.maximum(share * b, -1.0), 1.0)


@shared
def triangle(a: Points, b: Points, c: Points) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """Cotangent weights of the links bc, ca, ab, and the area of a triangle (Pinkall and Polthier 1993)."""
    ab, ac, bc = between(a, b), between(a, c), between(b, c)
    double_area = cross_length(ab, ac)
    longest = np.maximum(np.maximum(dot(ab, ab), dot(ac, ac)), dot(bc, bc))
    twice = or_one(2 * np.maximum(double_area, LEAST_AREA * longest))
    return dot(ab, ac) / twice, -dot(ab, bc) / twice, dot(ac, bc) / twice, double_area / 2


@shared
def strip(a: Points, b: Points, beside_a: Points, beside_b: Points) -> Numbers:
    """Weight of the link between two texels at a free rim, by the strip from them to the rim's points beside them.

    Heights have no slope across a free rim (the natural condition). Their gradient in the strip is the difference of
    the two texels over their distance along the rim, at whatever angle the grid lines meet that.
    """
    rim, link = between(beside_a, beside_b), between(a, b)
    squared = dot(rim, rim)
    along = dot(rim, link) ** 2 / or_one(squared)
    least = LEAST_AREA * np.maximum(squared, dot(link, link))
    weight = quad_area(a, b, beside_a, beside_b) / or_one(np.maximum(along, least))
    return (squared != 0) * weight


@shared
def quad_area(sw: Points, se: Points, nw: Points, ne: Points) -> Numbers:
    """Area of a quad that need not be flat: that of its smaller triangulation.

    The flat area p x q / 2 misses what a fold holds, the other triangulation spans it twice.
    """
    south, west, north, east = between(sw, se), between(sw, nw), between(ne, nw), between(ne, se)
    rising = cross_length(south, east) + cross_length(north, west)
    falling = cross_length(south, west) + cross_length(north, east)
    return np.minimum(rising, falling) / 2


@shared
def _hourglass(pp: Numbers, qq: Numbers, pq: Numbers, area: Numbers) -> Numbers:
    """Hourglass stiffness of a quad of given area whose diagonals p and q have the products pp, qq and pq.

    In a parallelogram with the squared sides a >= b, the product d of its sides and the area J, a wave of wave number k
    has omega^2 = k^2 - k^4 (a + b) / 16 + k^4 H (J^2 + 3 d^2) / 8 J in the mean over its directions, to leading order:
    waves are in time on average at H = (a + b) J / 2 (J^2 + 3 d^2). Its time step begins to shorten at
    H = (a^2 - d^2) / 4 a J.
    """
    both_sides = (pp + qq) / 2
    a, d = (both_sides + np.abs(pq)) / 2, (pp - qq) / 4
    in_time = both_sides * area / (2 * (area * area + 3 * d * d))
    free = (a * a - d * d) / (4 * a * area)
    return np.minimum(in_time, np.maximum(SHARE * free, HOURGLASS * 2 * area / both_sides))


# A polygon flatter than this, in units of its size, counts as flat: many combinations of its corners then make the node
# in its middle. Its square is well above round-off.
_FLAT = 1e-5


@kernel
def polygon(corners: Floats) -> tuple[Floats, Floats]:
    """Link weights [k, k] (0 on the diagonal) and the corners' shares of the area [k] of a polygon in space [k, 3].

    A virtual node in the middle cuts it into triangles; it is an affine combination of the corners, so that linear
    functions stay exact, and is eliminated (Bunge, Herholz, Kazhdan and Botsch 2020).
    """
    count = len(corners)
    shares = _virtual_node(corners)
    middle = _middle(corners, shares)
    links, spokes, areas, inner = np.zeros((count, count)), np.zeros(count), np.zeros(count), 0.0
    for i in range(count):
        j = (i + 1) % count
        to_j, to_i, side, area = triangle(corners[i], corners[j], middle)
        spokes[j] += to_j
        spokes[i] += to_i
        links[i, j] += side
        links[j, i] += side
        areas[i] += area / 3
        areas[j] += area / 3
        inner += area / 3
    total = spokes.sum()
    for i in range(count):
        areas[i] += shares[i] * inner
        for j in range(count):
            if i != j:
                links[i, j] += shares[j] * spokes[i] + shares[i] * spokes[j] - shares[i] * shares[j] * total
    return links, areas


@kernel
def _virtual_node(corners: Floats) -> Floats:
    """Weights [k], of sum 1, of the point whose triangles with a polygon's sides have the least squared areas.

    Of all weights that make it the most even ones.
    """
    count = len(corners)
    mean = _middle(corners, np.full(count, 1 / count))
    # |x - c| x side, squared: x' A x - 2 b' x, with A = sum of |s|^2 1 - s s'
    squares, right, spread = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
    for i in range(count):
        here, side = between(mean, corners[i]), between(corners[i], corners[(i + 1) % count])
        squared, along = dot(side, side), dot(side, here)
        for a in range(3):
            squares[a, a] += squared
            right[a] += squared * here[a] - side[a] * along
            for b in range(3):
                squares[a, b] -= side[a] * side[b]
                spread[a, b] += here[a] * here[b]
    slope = _solved(spread, _solved(squares, right))
    weights = np.empty(count)
    for i in range(count):
        weights[i] = 1 / count + dot(slope, between(mean, corners[i]))
    return weights / weights.sum()


@kernel
def _middle(corners: Floats, weights: Floats) -> tuple[float, float, float]:
    """The point with such weights at the corners."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(len(corners)):
        x, y, z = x + weights[i] * corners[i, 0], y + weights[i] * corners[i, 1], z + weights[i] * corners[i, 2]
    return x, y, z


@kernel
def _solved(matrix: Floats, right: Points) -> tuple[float, float, float]:
    """Solution of a symmetric positive semidefinite system [3, 3]; next to 0 where this leaves it open."""
    ridge = _FLAT**2 * (matrix[0, 0] + matrix[1, 1] + matrix[2, 2]) + 1e-300
    first = matrix[0, 0] + ridge
    a, b = matrix[0, 1] / first, matrix[0, 2] / first
    second, coupling = matrix[1, 1] + ridge - a * matrix[0, 1], matrix[1, 2] - a * matrix[0, 2]
    c = coupling / second
    third = matrix[2, 2] + ridge - b * matrix[0, 2] - c * coupling
    p = right[1] - a * right[0]
    z = (right[2] - b * right[0] - c * p) / third
    y = p / second - c * z
    return right[0] / first - a * y - b * z, y, z
