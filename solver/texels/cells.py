"""Finite elements of one cell of the texel mesh: link weights and area of a quad, a triangle, a polygon, a strip.

A quad takes its gradient from its two diagonals (one-point integration), and a little stiffness against the one pattern
that this does not see, the hourglass + - + - (Flanagan and Belytschko 1981). That pattern is a second derivative: its
stiffness is free, as long as linear functions have none of it. In a quad that is no parallelogram they have: where the
map onto the charts has kinks, eigenvalues then converge with order 1 to 1.6 instead of 2, so that it is taken away.

The stiffness decides whether short waves lag behind or run ahead, and follows from the quad's shape. Linear triangles
give it far too much in a sheared quad: there waves ran ahead, by 3 % in the median over the elephant at N = 96.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

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

Numbers: TypeAlias = Any  # a float, or an array of them
Points: TypeAlias = Any  # coordinates [3] of a point, or [3, ...] of many


def quad(sw: Points, se: Points, nw: Points, ne: Points) -> tuple[Numbers, ...]:
    """Weights of a quad's links: south, north, west and east side, diagonal sw-ne, diagonal se-nw; its area.

    With diagonals p, q and u_p, u_q the differences along them, area |gradient|^2 is
    (|q|^2 u_p^2 - 2 p.q u_p u_q + |p|^2 u_q^2) / 2 |p x q|, and 2 u_p u_q is the sum of squared differences along west
    and east, less that along south and north. The hourglass, less what the linear function of that gradient has of it,
    is (1 + a, -1 + b, -1 - b, 1 - a) at sw, se, nw, ne, where a p + b q is how far the quad is from a parallelogram.
    A quad in one point has neither.
    """
    p, q = _between(sw, ne), _between(se, nw)
    pp, qq, pq, cross = _dot(p, p), _dot(q, q), _dot(p, q), _cross_length(p, q)
    twice = _or_one(2 * np.maximum(cross, LEAST_AREA / 2 * (pp + qq)))
    hourglass = np.where(pp + qq == 0, 0.0, _hourglass(_or_one(pp), _or_one(qq), pq, twice / 4))
    a, b = _unevenness(p, q, _between(_between(sw, se), _between(nw, ne)), twice / 2)
    return (
        pq / twice + hourglass * (1 + a) * (1 - b),
        pq / twice + hourglass * (1 - a) * (1 + b),
        hourglass * (1 + a) * (1 + b) - pq / twice,
        hourglass * (1 - a) * (1 - b) - pq / twice,
        qq / twice - hourglass * (1 - a * a),
        pp / twice - hourglass * (1 - b * b),
        quad_area(sw, se, nw, ne),
    )


def _unevenness(p: Points, q: Points, way: Points, cross: Numbers) -> tuple[Numbers, Numbers]:
    """Twice the way between the middles of the diagonals p, q, in units of these; next to none in an even quad.

    In a convex quad both numbers lie between -1 and 1.
    """
    pp, qq, pq, along_p, along_q = _dot(p, p), _dot(q, q), _dot(p, q), _dot(way, p), _dot(way, q)
    a, b = (along_p * qq - along_q * pq) / cross**2, (along_q * pp - along_p * pq) / cross**2
    share = (a * a + b * b) / (a * a + b * b + UNEVEN)
    return np.clip(share * a, -1.0, 1.0), np.clip(share * b, -1.0, 1.0)


def triangle(a: Points, b: Points, c: Points) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """Cotangent weights of the links bc, ca, ab, and the area of a triangle (Pinkall and Polthier 1993)."""
    ab, ac, bc = _between(a, b), _between(a, c), _between(b, c)
    double_area = _cross_length(ab, ac)
    longest = np.maximum(np.maximum(_dot(ab, ab), _dot(ac, ac)), _dot(bc, bc))
    twice = _or_one(2 * np.maximum(double_area, LEAST_AREA * longest))
    return _dot(ab, ac) / twice, -_dot(ab, bc) / twice, _dot(ac, bc) / twice, double_area / 2


def strip(a: Points, b: Points, beside_a: Points, beside_b: Points) -> Numbers:
    """Weight of the link between two texels at a free rim, by the strip from them to the rim's points beside them.

    Heights have no slope across a free rim (the natural condition). Their gradient in the strip is the difference of
    the two texels over their distance along the rim, at whatever angle the grid lines meet that.
    """
    rim, link = _between(beside_a, beside_b), _between(a, b)
    squared = _dot(rim, rim)
    along = _dot(rim, link) ** 2 / _or_one(squared)
    least = LEAST_AREA * np.maximum(squared, _dot(link, link))
    weight = quad_area(a, b, beside_a, beside_b) / _or_one(np.maximum(along, least))
    return np.where(squared == 0, 0.0, weight)


def polygon(corners: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Link weights [..., k, k] (0 on the diagonal) and the corners' shares of the area [..., k] of polygons in space.

    A virtual node in the middle cuts each into triangles; it is an affine combination of the corners [..., k, 3], so
    that linear functions stay exact, and is eliminated (Bunge, Herholz, Kazhdan and Botsch 2020).
    """
    count = corners.shape[-2]
    shares = _virtual_node(corners)
    points = [np.moveaxis(corners[..., i, :], -1, 0) for i in range(count)]
    middle = np.moveaxis((shares[..., None, :] @ corners)[..., 0, :], -1, 0)
    weights = np.zeros((*corners.shape[:-2], count + 1, count + 1))
    areas = np.zeros((*corners.shape[:-2], count + 1))
    for i in range(count):
        j = (i + 1) % count
        to_j, to_middle, to_i, area = triangle(points[i], points[j], middle)
        for a, b, weight in ((j, count, to_j), (count, i, to_middle), (i, j, to_i)):
            weights[..., a, b] += weight
            weights[..., b, a] += weight
        for corner in (i, j, count):
            areas[..., corner] += area / 3
    prolong = np.concatenate([np.broadcast_to(np.eye(count), (*shares.shape, count)), shares[..., None, :]], axis=-2)
    diagonal = weights.sum(axis=-1)[..., None] * np.eye(count + 1)
    links = -np.swapaxes(prolong, -1, -2) @ (diagonal - weights) @ prolong
    links[..., np.arange(count), np.arange(count)] = 0.0
    return links, areas[..., :count] + shares * areas[..., count:]


def _virtual_node(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights [..., k], of sum 1, of the point whose triangles with a polygon's sides have the least squared areas."""
    sides = np.roll(corners, -1, axis=-2) - corners
    # |x - c| x side, squared: x' A x - 2 b' x, with A = sum of |s|^2 1 - s s'
    squared = (sides**2).sum(axis=-1)[..., None, None]
    projectors = squared * np.eye(3) - sides[..., :, None] * sides[..., None, :]
    best = _least_squares(projectors.sum(axis=-3), np.einsum("...ijk,...ik->...j", projectors, corners))
    mean = corners.mean(axis=-2)
    ones = np.ones((*corners.shape[:-2], 1, corners.shape[-2]))
    system = np.concatenate([np.swapaxes(corners - mean[..., None, :], -1, -2), ones], axis=-2)
    weights = _least_squares(system, np.concatenate([best - mean, ones[..., 0, :1]], axis=-1))
    return weights / weights.sum(axis=-1, keepdims=True)


def _least_squares(system: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """The shortest x with the least |system x - right|, also of many."""
    return (np.linalg.pinv(system, rcond=max(system.shape[-2:]) * np.finfo(np.float64).eps) @ right[..., None])[..., 0]


def _or_one(x: Numbers) -> Numbers:
    """1 in place of 0: what is divided by it is 0 as well."""
    return np.where(x == 0, 1.0, x)


def _dot(a: Points, b: Points) -> Numbers:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross_length(a: Points, b: Points) -> Numbers:
    """Length of the vector product."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return np.sqrt(x * x + y * y + z * z)


def _between(a: Points, b: Points) -> Points:
    """Difference b - a."""
    return (b[0] - a[0], b[1] - a[1], b[2] - a[2])


def quad_area(sw: Points, se: Points, nw: Points, ne: Points) -> Numbers:
    """Area of a quad that need not be flat: that of its smaller triangulation.

    The flat area p x q / 2 misses what a fold holds, the other triangulation spans it twice.
    """
    south, west, north, east = _between(sw, se), _between(sw, nw), _between(ne, nw), _between(ne, se)
    rising = _cross_length(south, east) + _cross_length(north, west)
    falling = _cross_length(south, west) + _cross_length(north, east)
    return np.minimum(rising, falling) / 2


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
