"""Smooth surfaces as meshes: closed, open, with a handle, in parts."""

from collections.abc import Callable

import numpy as np
import trimesh

from ripple_sim.solver import Mesh

# radii of a torus and of its tube
RING = 1.0
TUBE = 0.4


def grid(
    n: int, place: Callable, *, closed: tuple[bool, bool] = (False, False)
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles over n x n squares; place takes two arrays from 0 to 1 to x, y, z."""
    counts = [n if each else n + 1 for each in closed]
    a, b = np.meshgrid(*(np.arange(count) / n for count in counts), indexing="ij")
    V = np.stack(np.broadcast_arrays(*place(a, b)), axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    ring = (0, 0), (1, 0), (1, 1), (0, 1)
    corner = [((i + k) % counts[0] * counts[1] + (j + m) % counts[1]).ravel() for k, m in ring]
    return V, np.concatenate(
        [np.stack([corner[k] for k in each], axis=1) for each in ((0, 1, 2), (0, 2, 3))]
    )


def square(n: int) -> Mesh:
    """Unit square."""
    return Mesh.from_arrays(*grid(n, lambda x, y: (x, y, 0 * x)))


def disk(n: int) -> Mesh:
    """Unit disk."""

    def place(a: np.ndarray, b: np.ndarray) -> tuple:
        x = 2 * a - 1
        y = 2 * b - 1
        return x * np.sqrt(1 - y * y / 2), y * np.sqrt(1 - x * x / 2), 0 * x

    return Mesh.from_arrays(*grid(n, place))


def torus(n: int) -> Mesh:
    """Torus about the z axis."""

    def place(a: np.ndarray, b: np.ndarray) -> tuple:
        u = 2 * np.pi * a
        v = 2 * np.pi * b
        rho = RING + TUBE * np.cos(v)
        return rho * np.cos(u), rho * np.sin(u), TUBE * np.sin(v)

    return Mesh.from_arrays(*grid(n, place, closed=(True, True)))


def sphere(subdivisions: int) -> Mesh:
    """Unit sphere."""
    solid = trimesh.creation.icosphere(subdivisions)
    return Mesh.from_arrays(solid.vertices, solid.faces)


def joined(*meshes: Mesh) -> Mesh:
    """Several meshes as one."""
    first = np.cumsum([0, *(len(each.V) for each in meshes)])
    F = [each.F + k for each, k in zip(meshes, first, strict=False)]
    return Mesh.from_arrays(np.concatenate([each.V for each in meshes]), np.concatenate(F))


def moved(mesh: Mesh, offset: tuple[float, float, float], size: float = 1.0) -> Mesh:
    """A mesh elsewhere."""
    return Mesh.from_arrays(size * mesh.V + np.array(offset), mesh.F)
