"""Finite elements of one cell of the texel mesh: link weights and area of a quad, a triangle, a strip.

A quad takes its gradient from its two diagonals (one-point integration), and a little stiffness against the one pattern
that this does not see, the hourglass + - + - (Flanagan and Belytschko 1981). That pattern is a second derivative: its
stiffness is free, as long as linear functions have none of it. In a quad that is no parallelogram they have: where the
map onto the charts has kinks, eigenvalues then converge with order 1 to 1.6 instead of 2, so that it is taken away.

The stiffness decides whether short waves lag behind or run ahead, and follows from the quad's shape. Linear triangles
give it far too much in a sheared quad: there waves ran ahead, by 3 % in the median over the elephant at N = 96.
"""

from __future__ import annotations

import numpy as np

from ..kernel import shared
from .vectors import Numbers, Points, between, cross_length, dot, or_one

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
