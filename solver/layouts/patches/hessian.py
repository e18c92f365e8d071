"""Gradient and Hessian of the energy of a seamless map, the latter made positive semidefinite triangle by triangle.

In the basis of its singular vectors, the Hessian of a function f(s1, s2) of a 2 x 2 matrix falls into a 2 x 2 block of
second derivatives, and two numbers: for the antisymmetric change and for the symmetric one off the diagonal.
"""

from __future__ import annotations

import numpy as np

from ...kernel import Floats, Ints, kernel
from .energy import Reference, density_derivatives
from .frames import turned
from .seamless import COLUMN, FREE, ROW, SeamlessMap, corner_place


@kernel
def assemble(
    seamless: SeamlessMap,
    reference: Reference,
    edge: Ints,
    ends: Ints,
    gradient: Floats,
    diagonal: Floats,
    blocks: Floats,
) -> None:
    """Fill gradient [n, 2], and the Hessian's blocks of vertices [n, 3] and edges [e, 4]; see `conjugate_gradients`.

    All are in the vertices' own frames.
    """
    gradient[:] = 0.0
    diagonal[:] = 0.0
    blocks[:] = 0.0
    slopes, modes, curvature = np.empty((3, 2)), np.empty((4, 3, 2)), np.empty(4)
    for f in range(len(seamless.F)):
        _triangle(seamless, reference, f, slopes, modes, curvature)
        for k in range(3):
            v, back = seamless.F[f, k], (4 - seamless.turn[f, k]) % 4
            x, y = turned(slopes[k, 0], slopes[k, 1], back)
            gradient[v, 0] += x
            gradient[v, 1] += y
            for m in range(4):
                x, y = turned(modes[m, k, 0], modes[m, k, 1], back)
                modes[m, k, 0], modes[m, k, 1] = x, y
                diagonal[v, 0] += curvature[m] * x * x
                diagonal[v, 1] += curvature[m] * x * y
                diagonal[v, 2] += curvature[m] * y * y
        for k in range(3):
            e, j = edge[f, k], (k + 1) % 3
            p, q = (k, j) if ends[e, 0] == seamless.F[f, k] else (j, k)
            for m in range(4):
                a, b = modes[m, p], modes[m, q]
                blocks[e, 0] += curvature[m] * a[0] * b[0]
                blocks[e, 1] += curvature[m] * a[0] * b[1]
                blocks[e, 2] += curvature[m] * a[1] * b[0]
                blocks[e, 3] += curvature[m] * a[1] * b[1]
    _hold(seamless, ends, gradient, diagonal, blocks)


@kernel
def _hold(seamless: SeamlessMap, ends: Ints, gradient: Floats, diagonal: Floats, blocks: Floats) -> None:
    """Take out the directions in which vertices may not move."""
    for v in range(len(gradient)):
        freedom = seamless.freedom[v]
        if freedom != FREE:
            diagonal[v, 1] = 0.0
            if freedom != COLUMN:
                gradient[v, 0], diagonal[v, 0] = 0.0, 1.0
            if freedom != ROW:
                gradient[v, 1], diagonal[v, 2] = 0.0, 1.0
    for e in range(len(ends)):
        first, second = seamless.freedom[ends[e, 0]], seamless.freedom[ends[e, 1]]
        for i in range(2):
            for j in range(2):
                if not ((first >> i) & 1 and (second >> j) & 1):
                    blocks[e, 2 * i + j] = 0.0


@kernel
def _triangle(
    seamless: SeamlessMap, reference: Reference, f: int, slopes: Floats, modes: Floats, curvature: Floats
) -> None:
    """Gradient [3, 2] at the corners of a triangle, and its Hessian: the sum of c m m', modes [4, 3, 2]."""
    area, cotangent = reference.area[f], reference.cotangent[f]
    # a flat copy of the triangle, by its cotangents: side ab along x
    total = cotangent[0] + cotangent[1]
    length = np.sqrt(2.0 * area * max(total, 1e-12))
    height = 2.0 * area / length
    foot = cotangent[0] * height
    # gradients of the corners' hat functions
    hats = np.empty((3, 2))
    hats[1, 0], hats[1, 1] = 1.0 / length, -foot / (length * height)
    hats[2, 0], hats[2, 1] = 0.0, 1.0 / height
    hats[0, 0], hats[0, 1] = -hats[1, 0] - hats[2, 0], -hats[1, 1] - hats[2, 1]
    a = b = c = d = 0.0
    for k in range(3):
        x, y = corner_place(seamless, f, k)
        a, b = a + x * hats[k, 0], b + x * hats[k, 1]
        c, d = c + y * hats[k, 0], d + y * hats[k, 1]
    # singular values of (a b; c d) = U S V', rotations by half sums and differences of two angles
    sum_length, sum_angle = np.hypot(a + d, c - b) / 2, np.arctan2(c - b, a + d)
    rest_length, rest_angle = np.hypot(a - d, c + b) / 2, np.arctan2(c + b, a - d)
    s1, s2 = sum_length + rest_length, sum_length - rest_length
    left, right = (sum_angle + rest_angle) / 2, (rest_angle - sum_angle) / 2
    cl, sl, cr, sr = np.cos(left), np.sin(left), np.cos(right), np.sin(right)
    _, wd, wj, wdd, wdj, wjj = density_derivatives(s1 * s1 + s2 * s2, s1 * s2, reference.power)
    f1, f2 = 2 * s1 * wd + s2 * wj, 2 * s2 * wd + s1 * wj
    f11 = 2 * wd + 4 * s1 * s1 * wdd + 4 * s1 * s2 * wdj + s2 * s2 * wjj
    f22 = 2 * wd + 4 * s2 * s2 * wdd + 4 * s1 * s2 * wdj + s1 * s1 * wjj
    f12 = wj + 4 * s1 * s2 * wdd + 2 * (s1 * s1 + s2 * s2) * wdj + s1 * s2 * wjj
    mean, half, angle = (f11 + f22) / 2, np.hypot((f11 - f22) / 2, f12), np.arctan2(2 * f12, f11 - f22) / 2
    curvature[0], curvature[1] = area * max(mean + half, 0.0), area * max(mean - half, 0.0)
    curvature[2] = area * max(wd + wj / 2, 0.0)
    curvature[3] = area * max(wd - wj / 2, 0.0)
    ca, sa = np.cos(angle), np.sin(angle)
    for k in range(3):
        # the hat's gradient along the right singular vectors
        p, q = cr * hats[k, 0] + sr * hats[k, 1], -sr * hats[k, 0] + cr * hats[k, 1]
        slopes[k, 0] = area * (cl * f1 * p - sl * f2 * q)
        slopes[k, 1] = area * (sl * f1 * p + cl * f2 * q)
        # changes (first: along U; second: across) of S for the four modes
        for m, u, v in ((0, ca * p, sa * q), (1, -sa * p, ca * q), (2, -q, p), (3, q, p)):
            modes[m, k, 0], modes[m, k, 1] = cl * u - sl * v, sl * u + cl * v
