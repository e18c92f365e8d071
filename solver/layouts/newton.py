"""Conjugate gradients for symmetric matrices of 2 x 2 blocks on the vertices and edges of a mesh."""

from __future__ import annotations

import numpy as np

from ..kernel import Floats, Ints32, kernel


@kernel
def solve(ends: Ints32, diagonal: Floats, blocks: Floats, gradient: Floats, steps: int, tolerance: float) -> Floats:
    """Solve H x = -gradient roughly, preconditioned by the inverse diagonal blocks; x has shape [n, 2].

    `diagonal` [n, 3] holds xx, xy, yy of a vertex; `blocks` [e, 4] holds xx, xy, yx, yy of the edge between the
    vertices `ends` [e, 2], rows belonging to the first one. Stops after `steps` iterations, or when the residual has
    fallen to `tolerance` of the first one.
    """
    n = len(gradient)
    x = np.zeros((n, 2))
    inverse = np.empty((n, 3))
    residual, image, direction = np.empty((n, 2)), np.empty((n, 2)), np.empty((n, 2))
    norm = 0.0
    for v in range(n):
        a, b, c = diagonal[v, 0], diagonal[v, 1], diagonal[v, 2]
        det = a * c - b * b
        if not det > 1e-14 * a * c:
            b, det = 0.0, a * c
        inverse[v, 0], inverse[v, 1], inverse[v, 2] = c / det, -b / det, a / det
        r, s = -gradient[v, 0], -gradient[v, 1]
        residual[v, 0], residual[v, 1] = r, s
        direction[v, 0], direction[v, 1] = inverse[v, 0] * r + inverse[v, 1] * s, inverse[v, 1] * r + inverse[v, 2] * s
        norm += r * direction[v, 0] + s * direction[v, 1]
    first_norm = norm
    for _ in range(steps):
        for v in range(n):
            p, q = direction[v, 0], direction[v, 1]
            image[v, 0] = diagonal[v, 0] * p + diagonal[v, 1] * q
            image[v, 1] = diagonal[v, 1] * p + diagonal[v, 2] * q
        for e in range(len(ends)):
            u, v = ends[e, 0], ends[e, 1]
            xx, xy, yx, yy = blocks[e, 0], blocks[e, 1], blocks[e, 2], blocks[e, 3]
            p, q, r, s = direction[u, 0], direction[u, 1], direction[v, 0], direction[v, 1]
            image[u, 0] += xx * r + xy * s
            image[u, 1] += yx * r + yy * s
            image[v, 0] += xx * p + yx * q
            image[v, 1] += xy * p + yy * q
        curvature = 0.0
        for v in range(n):
            curvature += direction[v, 0] * image[v, 0] + direction[v, 1] * image[v, 1]
        if not curvature > 0.0:
            break
        alpha, previous, norm = norm / curvature, norm, 0.0
        for v in range(n):
            x[v, 0] += alpha * direction[v, 0]
            x[v, 1] += alpha * direction[v, 1]
            residual[v, 0] -= alpha * image[v, 0]
            residual[v, 1] -= alpha * image[v, 1]
            r, s = residual[v, 0], residual[v, 1]
            image[v, 0], image[v, 1] = inverse[v, 0] * r + inverse[v, 1] * s, inverse[v, 1] * r + inverse[v, 2] * s
            norm += r * image[v, 0] + s * image[v, 1]
        if norm < tolerance * tolerance * first_norm:
            break
        beta = norm / previous
        for v in range(n):
            direction[v, 0] = image[v, 0] + beta * direction[v, 0]
            direction[v, 1] = image[v, 1] + beta * direction[v, 1]
    return x
