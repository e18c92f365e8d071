"""Levels of detail of a sphere map, and the Newton system on them."""

import numpy as np
import pytest

from ripple_sim.solver.layouts import Reference, System
from ripple_sim.solver.layouts.sphere_map import (
    SPHERE,
    assemble,
    build_level,
    corner_table,
    total_energy,
)


def whole_level(V, F):
    """The finest level of a mesh and its reference triangles."""
    table = corner_table(F, len(V))
    level = build_level(table, np.arange(len(V)), np.arange(len(F)))
    area = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) / 2
    sides = np.stack([V[F[:, (j + 2) % 3]] - V[F[:, (j + 1) % 3]] for j in range(3)], axis=1)
    dots = np.stack(
        [-np.sum(sides[:, (j + 1) % 3] * sides[:, (j + 2) % 3], axis=1) for j in range(3)], axis=1
    )
    cotangent = dots / (2 * area[:, None])
    return level, Reference(area, (cotangent / (2 * area[:, None])).ravel(), SPHERE)


def assembled(level, S, reference):
    """The tangents [n, 2, 3] at a map's vertices, the Newton system, and its Hessian."""
    n = len(S)
    system = System.zeros(n, len(level.ends))
    x = np.empty_like(S)
    y = np.empty_like(S)
    energy = assemble(level, S, reference, x, y, system)
    assert energy == pytest.approx(total_energy(level.tail, S, reference), rel=1e-12)
    H = np.zeros((n, 2, n, 2))
    for v, (xx, xy, yy) in enumerate(system.diagonal):
        H[v, :, v, :] = [[xx, xy], [xy, yy]]
    for (u, v), block in zip(level.ends, system.blocks.reshape(-1, 2, 2), strict=True):
        H[u, :, v, :] = block
        H[v, :, u, :] = block.T
    return np.stack([x, y], axis=1), system, H.reshape(2 * n, 2 * n)
