"""Levels of detail of a sphere map, and the Newton system on them."""

import numpy as np
import pytest
import trimesh

from ripple_sim.solver.layouts.sphere_map.decimation import corner_table
from ripple_sim.solver.layouts.sphere_map.energy import Reference, total_energy
from ripple_sim.solver.layouts.sphere_map.hessian import assemble, tangents
from ripple_sim.solver.layouts.sphere_map.level import build_level


def icosphere(subdivisions):
    mesh = trimesh.creation.icosphere(subdivisions)
    return np.array(mesh.vertices), np.array(mesh.faces)


def crumpled():
    V, F = icosphere(3)
    return V + 0.2 * np.random.default_rng(0).standard_normal(V.shape), F


def whole_level(V, F):
    """The finest level of a mesh and its reference triangles."""
    table = corner_table(F, len(V))
    level = build_level(table, np.arange(len(V)), np.arange(len(F)))
    area = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) / 2
    sides = np.stack([V[F[:, (j + 2) % 3]] - V[F[:, (j + 1) % 3]] for j in range(3)], axis=1)
    dots = np.stack([-np.sum(sides[:, (j + 1) % 3] * sides[:, (j + 2) % 3], axis=1) for j in range(3)], axis=1)
    cotangent = dots / (2 * area[:, None])
    return level, Reference(area, (cotangent / (2 * area[:, None])).ravel())


def assembled(level, S, reference):
    n = len(S)
    gradient, diagonal, blocks = np.empty((n, 2)), np.empty((n, 3)), np.empty((len(level.ends), 4))
    x, y = tangents(S)
    energy = assemble(level, S, reference, x, y, gradient, diagonal, blocks)
    assert energy == pytest.approx(total_energy(level.tail, S, reference), rel=1e-12)
    frames = np.stack([x, y], axis=1)
    H = np.zeros((n, 2, n, 2))
    for v, (xx, xy, yy) in enumerate(diagonal):
        H[v, :, v, :] = [[xx, xy], [xy, yy]]
    for (u, v), block in zip(level.ends, blocks.reshape(-1, 2, 2), strict=True):
        H[u, :, v, :] = block
        H[v, :, u, :] = block.T
    return frames, gradient, diagonal, blocks, H.reshape(2 * n, 2 * n)
