"""Triangles on the surfaces of MuJoCo's primitive geoms."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

# Longest edge of a triangle over the size of the primitive.
_LONGEST_EDGE = 1 / 24
_CYLINDER_SIDES = 96


def primitive_triangles(kind: str, size: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices [m], [n, 3], on a primitive geom of a MuJoCo size, [3], and triangles, [m, 3]."""
    if kind == "sphere":
        kind, size = "ellipsoid", np.full(3, size[0])
    # trimesh merges vertices within a fixed distance: triangles are made at a size of about 1
    scale = 2.0 ** np.floor(np.log2(size.max()))
    V, F = _triangles(kind, size / scale)
    return scale * V, F


def _triangles(kind: str, size: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangles on a primitive whose largest size is from 1 to 2."""
    if kind == "ellipsoid":
        solid = trimesh.creation.icosphere(subdivisions=4)
        solid.apply_scale(size)
    elif kind == "capsule":
        solid = trimesh.creation.capsule(height=2 * size[1], radius=size[0], count=(48, 48))
        solid.apply_translation([0, 0, -solid.bounds.mean(axis=0)[2]])
    elif kind == "cylinder":
        solid = trimesh.creation.cylinder(radius=size[0], height=2 * size[1], sections=_CYLINDER_SIDES)
    else:
        solid = trimesh.creation.box(extents=2 * size)
    longest = float(np.max(solid.extents)) * _LONGEST_EDGE
    V, F = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, max_edge=longest)
    return _on_round_surface(kind, size, V), F


def _on_round_surface(kind: str, size: NDArray[np.float64], V: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vertices moved along the radius from the chords of a round solid onto its surface [m]."""
    if kind == "ellipsoid":
        return V / np.linalg.norm(V / size, axis=1, keepdims=True)
    if kind == "capsule":
        axis = np.clip(V[:, 2:], -size[1], size[1]) * [0.0, 0.0, 1.0]
        return axis + size[0] * (V - axis) / np.linalg.norm(V - axis, axis=1, keepdims=True)
    if kind == "cylinder":
        radius = np.linalg.norm(V[:, :2], axis=1)
        # the other vertices lie inside the flat ends
        on_side = radius > size[0] * (np.cos(np.pi / _CYLINDER_SIDES) - 1e-9)
        V = V.copy()
        V[on_side, :2] *= (size[0] / radius[on_side])[:, None]
    return V
