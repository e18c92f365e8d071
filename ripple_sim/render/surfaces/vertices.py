"""The triangles and vertices that a target is drawn with: small, round in outline, split at creases and seams."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.visuals.primitives import corner_normals
from ripple_sim.render.visuals.texture_mapping import Mapping

from . import ambient_occlusion as occlusion
from .surface import Surface
from .tessellation import Edges, edges_of, midpoints, subdivide

_LEAST_FACES, _MOST_FACES = 20_000, 400_000
# columns of the vertex attributes
POSITION, DIRECTION, SPHERE, NORMAL, BAKED, UV = (
    slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 14), slice(14, 16),
)  # fmt: skip


def refined(
    surface: Surface, max_length: float, max_faces: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], Edges]:
    """Triangles, vertex attributes (see the columns above), split where normals or texture coordinates jump, and edges.

    The last vertices are the edges' midpoints.
    """
    V, F = np.asarray(surface.V, dtype=np.float64), np.asarray(surface.F, dtype=np.int64)
    smooth = np.zeros_like(V)
    smooth[F] = corner_normals(V, F, crease=180.0)
    baked = np.stack(occlusion.bake(V, F, smooth), axis=1)
    uv = np.zeros((len(V), 2)) if surface.uv is None else np.asarray(surface.uv, dtype=np.float64)
    corner_uv = uv[F] if uv.ndim == 2 else uv
    corners = np.concatenate([F[:, :, None], corner_normals(V, F), corner_uv], axis=2).reshape(-1, 6)
    unique, index = np.unique(corners, axis=0, return_inverse=True)
    _, same = np.unique(unique[:, :4], axis=0, return_inverse=True)
    vertex = unique[:, 0].astype(np.int64)
    attributes = np.concatenate(
        [V[vertex], smooth[vertex], surface.sphere[vertex], unique[:, 1:4], baked[vertex], unique[:, 4:]], axis=1
    )
    faces, attributes, same = subdivide(
        index.reshape(F.shape),
        attributes,
        same.ravel(),
        position=POSITION,
        normal=NORMAL,
        max_length=max_length,
        max_faces=int(np.clip(max_faces, _LEAST_FACES, _MOST_FACES)),
    )
    edges = edges_of(faces, same)
    attributes = np.concatenate([attributes, midpoints(edges, attributes, POSITION, NORMAL)])
    length = np.linalg.norm(attributes[:, DIRECTION], axis=1, keepdims=True)
    attributes[:, DIRECTION] /= np.maximum(length, 1e-12)
    return faces, attributes, edges


def packed(vertices: NDArray[np.float64], *columns: slice) -> bytes:
    """Some columns of the vertices, one behind the other, as float32."""
    return np.concatenate([vertices[:, c] for c in columns], axis=1).astype(np.float32).tobytes()


def mapped(vertices: NDArray[np.float64], mapping: Mapping) -> NDArray[np.float64]:
    """Coordinates of the picture, [n, 3]; see `Mapping`."""
    if not mapping.own:
        return mapping.at(vertices[:, POSITION])
    u, v = vertices[:, UV].T
    # a surface counts v from the picture's lower edge, MuJoCo's textures lie with the upper edge at 0
    return np.stack([u, 1.0 - v, np.zeros_like(u)], axis=1)
