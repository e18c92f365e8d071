"""Proof that a sphere map is a bijection, its stretch, and the rotation that suits the cube.

A map is rotated under the cube until the atlas's narrowest texels are as wide as possible. On the
sphere a texel is 1.09 of the mean width at the middle of a chart and 0.77, in one direction, at the
middle of an edge of the cube. Where the map itself is narrow, at the roots of limbs, this decides
how long the time step may be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...kernel import Floats, kernel
from ...mesh.topology import triangle_areas
from ...mesh.vectors import Vector, cross, dot, row, subtract

# A triple product counts as positive above this share of the product of two sides: round-off.
_MIN_TRIPLE_PRODUCT = 4.0 * float(np.finfo(np.float64).eps)

# Greatest difference of a squared length from 1, and of the sum of solid angles from 4 pi [sr].
_UNIT_TOLERANCE = 1e-9
_SOLID_ANGLE_TOLERANCE = 1e-6

# Rotations that are tried. The cube's own symmetries make that 8 degrees from one to the next.
_ROTATIONS = 400

# Power of the squared narrowness whose sum stands for the greatest narrowness.
_SHARPNESS = 8

# Least squared width of a texel: triangles without area are no narrow texels.
_MIN_SQUARED_WIDTH = 1e-6

# Vertices that add up to this share of the narrowness need not be looked at.
_NEGLIGIBLE_SHARE = 1e-2

# Constants of the super-Fibonacci spirals (Alexa 2022): phi^2 = 2 and psi^4 = psi + 4.
_SPIRAL_PHI = np.sqrt(2)
_SPIRAL_PSI = 1.533751168755204288


@dataclass(frozen=True)
class Certificate:
    """The result of `certify`.

    A map whose triangles all keep their orientation and together cover the sphere's 4 pi once is a
    bijection: a point covered twice would make the sum of solid angles larger.
    """

    flipped: int  # triangles whose triple product is not positive
    solid_angle: float  # sum over all triangles, signed [sr]
    valid: bool


def certify(F: NDArray[np.integer], S: Floats) -> Certificate:
    """Check a sphere map S (unit vectors, shape [n, 3]) of the triangles F, shape [m, 3]."""
    a, b, c = (S[F[:, j]].T for j in range(3))
    ab = subtract(b, a)
    ac = subtract(c, a)
    triple = dot(a, cross(ab, ac))
    sides = np.sqrt(dot(ab, ab) * dot(ac, ac))
    flipped = int(np.count_nonzero(~(triple > _MIN_TRIPLE_PRODUCT * sides)))
    solid_angle = float(np.sum(solid_angles(F, S)))
    is_on_sphere = bool(np.all(np.abs(dot(S.T, S.T) - 1) < _UNIT_TOLERANCE))
    covers_once = abs(solid_angle - 4 * np.pi) < _SOLID_ANGLE_TOLERANCE
    return Certificate(flipped, solid_angle, flipped == 0 and is_on_sphere and covers_once)


def solid_angles(F: NDArray[np.integer], S: Floats) -> Floats:
    """Signed solid angle of each spherical triangle [sr], [m].

    The formula is that of van Oosterom and Strackee (1983).
    """
    a, b, c = (S[F[:, j]].T for j in range(3))
    triple = dot(a, cross(subtract(b, a), subtract(c, a)))
    return 2 * np.arctan2(triple, 1 + dot(a, b) + dot(b, c) + dot(c, a))


def stretch(V: Floats, F: NDArray[np.integer], S: Floats) -> Floats:
    """Per triangle sqrt(real area / sphere area), real area scaled to 4 pi, shape [m].

    How many times wider than in an ideal even grid the texels are there.
    """
    real = triangle_areas(V, F)
    on_sphere = np.maximum(solid_angles(F, S), np.finfo(np.float64).tiny)
    return np.sqrt(4 * np.pi / np.sum(real) * real / on_sphere)


def align(V: Floats, F: NDArray[np.integer], S: Floats) -> Floats:
    """Rotate a sphere map S [n, 3] of the mesh V [n, 3], F [m, 3] so that texels are not narrow.

    The mesh has the area 4 pi.
    """
    metric, area = _vertex_metrics(F, V, S)
    trace = metric[:, 0] + metric[:, 1] + metric[:, 2]
    squares = np.sum(metric[:, :3] ** 2, axis=1) + 2 * np.sum(metric[:, 3:] ** 2, axis=1)
    determinant = (trace * trace - squares) / 2
    # the larger eigenvalue of the 2 x 2 matrices; over the determinant, it is one over the smaller
    upper = 0.5 * (trace + np.sqrt(np.maximum(trace * trace - 4 * determinant, 0)))
    inverse_square = upper / np.maximum(determinant, _MIN_SQUARED_WIDTH * upper)
    narrowness = area * inverse_square**_SHARPNESS
    # the narrowest vertices, which make up nearly all of the sum
    order = np.argsort(-narrowness, kind="stable")
    needed = (1 - _NEGLIGIBLE_SHARE) * np.sum(narrowness)
    count = int(np.searchsorted(np.cumsum(narrowness[order]), needed)) + 1
    narrow = order[:count]
    least = np.inf
    best_rotation = np.eye(3)
    for rotation in spread_rotations(_ROTATIONS):
        total = _narrowness(rotation, S[narrow], metric[narrow], area[narrow], least)
        if total < least:
            least = total
            best_rotation = rotation
    return S @ best_rotation.T


def spread_rotations(count: int) -> Floats:
    """Rotation matrices [count, 3, 3] spread evenly over all, by super-Fibonacci spirals.

    Alexa (2022) describes the spirals.
    """
    s = np.arange(count) + 0.5
    inner = np.sqrt(s / count)
    outer = np.sqrt(1 - s / count)
    alpha = 2 * np.pi * s / _SPIRAL_PHI
    beta = 2 * np.pi * s / _SPIRAL_PSI
    # a unit quaternion x, y, z, w
    x = inner * np.sin(alpha)
    y = inner * np.cos(alpha)
    z = outer * np.sin(beta)
    w = outer * np.cos(beta)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0))


def _vertex_metrics(F: NDArray[np.integer], V: Floats, S: Floats) -> tuple[Floats, Floats]:
    """Squared real length of the sphere's tangents at each vertex, and the area of each vertex [n].

    It is a symmetric matrix xx yy zz xy xz yz [n, 6], averaged over the triangles at the vertex.

    The average lets a sliver count no more than it covers.
    """
    # two sides of each triangle, on the sphere and on the real surface
    e = subtract(S[F[:, 1]].T, S[F[:, 0]].T)
    g = subtract(S[F[:, 2]].T, S[F[:, 0]].T)
    real_e = subtract(V[F[:, 1]].T, V[F[:, 0]].T)
    real_g = subtract(V[F[:, 2]].T, V[F[:, 0]].T)
    normal = cross(e, g)
    square = dot(normal, normal)
    # these over the square: one along e and zero along g, and vice versa
    p = cross(g, normal)
    q = cross(normal, e)
    ee = dot(real_e, real_e)
    eg = dot(real_e, real_g)
    gg = dot(real_g, real_g)
    share = np.sqrt(square) / 6.0
    scale = share / (square * square)

    def at_vertices(values: Floats) -> Floats:
        return np.bincount(F.ravel(), np.repeat(values, 3), len(V)).astype(np.float64)

    area = at_vertices(share)
    sums = []
    for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        entry = ee * p[a] * p[b] + eg * (p[a] * q[b] + q[a] * p[b]) + gg * q[a] * q[b]
        sums.append(at_vertices(scale * entry))
    return np.stack(sums, axis=1) / area[:, None], area


@kernel
def _product(m: Floats, a: Vector, b: Vector) -> float:
    """A . M b for a symmetric matrix M given as xx yy zz xy xz yz, [6]."""
    return (
        m[0] * a[0] * b[0]
        + m[1] * a[1] * b[1]
        + m[2] * a[2] * b[2]
        + m[3] * (a[0] * b[1] + a[1] * b[0])
        + m[4] * (a[0] * b[2] + a[2] * b[0])
        + m[5] * (a[1] * b[2] + a[2] * b[1])
    )


@kernel
def _narrowness(rotation: Floats, S: Floats, metric: Floats, area: Floats, limit: float) -> float:
    """Sum over the sphere of (1 / least width of a texel)^16.

    The cube's axes are the rows of `rotation`. Once the sum is above `limit` the rest is left out.
    """
    total = 0.0
    for v in range(len(S)):
        p = row(S, v)
        x = dot(row(rotation, 0), p)
        y = dot(row(rotation, 1), p)
        z = dot(row(rotation, 2), p)
        local = (x, y, z)
        # the axis of the chart, and those of its columns and rows
        main = 0 if abs(x) >= max(abs(y), abs(z)) else 1 if abs(y) >= abs(z) else 2
        along = (main + 1) % 3
        across = (main + 2) % 3
        depth = abs(local[main])
        # The point p is the direction (u, v, 1) depth. Its slope in the texel's angle, arctan u, is
        # (e_u - u depth p) / cos^2.
        s = local[along]
        t = local[across]
        a = s / depth
        b = t / depth
        du = depth * (1.0 + a * a)
        dv = depth * (1.0 + b * b)
        e = row(rotation, along)
        g = row(rotation, across)
        first = (du * (e[0] - s * p[0]), du * (e[1] - s * p[1]), du * (e[2] - s * p[2]))
        second = (dv * (g[0] - t * p[0]), dv * (g[1] - t * p[1]), dv * (g[2] - t * p[2]))
        m = metric[v]
        ee = _product(m, first, first)
        gg = _product(m, second, second)
        eg = _product(m, first, second)
        trace = ee + gg
        determinant = ee * gg - eg * eg
        upper = 0.5 * (trace + np.sqrt(max(trace * trace - 4.0 * determinant, 0.0)))
        inverse_square = upper / max(determinant, _MIN_SQUARED_WIDTH * upper)
        total += area[v] * inverse_square**_SHARPNESS
        if total > limit:
            break
    return total
