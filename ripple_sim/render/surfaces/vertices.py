"""The triangles and vertices that a target is drawn with: small, round in outline, split at creases and seams."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.visuals.corners import smooth_normals, split_corners
from ripple_sim.render.visuals.texture_mapping import Mapping

from . import ambient_occlusion as occlusion
from .surface import Surface
from .tessellation import Edges, edges_of, midpoints, tessellate

_LEAST_FACES, _MOST_FACES = 20_000, 400_000
# columns of the vertex attributes; along DIRECTION, the smooth normal, a vertex is displaced
POSITION, DIRECTION, SPHERE, NORMAL, BAKED, UV = (
    slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 14), slice(14, 16),
)  # fmt: skip


def tessellated(
    V: NDArray,
    F: NDArray,
    sphere: NDArray,
    *,
    smooth: NDArray,
    max_length: float,
    max_faces: int,
    baked: NDArray | None = None,
    corner_uv: NDArray | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Split a mesh's vertices where normals or texture coordinates jump, and its edges where they are long.

    Parameters
    ----------
    V, F : array, shape [n, 3] and [m, 3]
        Vertices [m] and triangles.
    sphere : array, shape [n, 3]
        Where the height map is looked up.
    smooth : array, shape [n, 3]
        Smooth normals of the vertices.
    max_length, max_faces
        As for `tessellate`.
    baked : array, shape [n, 2], optional
        Ambient visibility and thickness.
    corner_uv : array, shape [m, 3, 2], optional
        Texture coordinates of the triangles' corners.

    Returns
    -------
    F, attributes, same
        As for `tessellate`; the attributes' columns are named above.
    """
    split = split_corners(V, F, corner_uv)
    baked = np.zeros((len(V), 2)) if baked is None else baked
    _, same = np.unique(np.column_stack([split.vertices, split.normals]), axis=0, return_inverse=True)
    each = split.vertices
    attributes = [V[each], smooth[each], sphere[each], split.normals, baked[each], split.uv]
    return tessellate(
        split.F,
        np.concatenate(attributes, axis=1),
        same.ravel(),
        position=POSITION,
        normal=NORMAL,
        max_length=max_length,
        max_faces=max_faces,
    )


def surface_vertices(
    surface: Surface, max_length: float, max_faces: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], Edges]:
    """Triangles, vertex attributes (see the columns above) and edges of a surface, tessellated.

    The last vertices are the edges' midpoints.
    """
    V, F = np.asarray(surface.V, dtype=np.float64), np.asarray(surface.F, dtype=np.int64)
    smooth = smooth_normals(V, F)
    uv = np.zeros((len(V), 2)) if surface.uv is None else np.asarray(surface.uv, dtype=np.float64)
    faces, attributes, same = tessellated(
        V,
        F,
        surface.sphere,
        smooth=smooth,
        max_length=max_length,
        max_faces=int(np.clip(max_faces, _LEAST_FACES, _MOST_FACES)),
        baked=np.stack(occlusion.bake(V, F, smooth), axis=1),
        corner_uv=uv[F] if uv.ndim == 2 else uv,
    )
    edges = edges_of(faces, same)
    attributes = np.concatenate([attributes, midpoints(edges, attributes, POSITION, NORMAL)])
    length = np.linalg.norm(attributes[:, DIRECTION], axis=1, keepdims=True)
    attributes[:, DIRECTION] /= np.maximum(length, 1e-12)
    return faces, attributes, edges


def packed(vertices: NDArray[np.float64], *columns: slice) -> bytes:
    """Some columns of the vertices, side by side, as float32."""
    return np.concatenate([vertices[:, c] for c in columns], axis=1).astype(np.float32).tobytes()


def mapped_coordinates(vertices: NDArray[np.float64], mapping: Mapping) -> NDArray[np.float64]:
    """Texture coordinates of the vertices, [n, 3]; see `Mapping`."""
    if not mapping.own:
        return mapping.at(vertices[:, POSITION])
    u, v = vertices[:, UV].T
    # a surface counts v from the image's lower edge, MuJoCo from the upper edge
    return np.stack([u, 1.0 - v, np.zeros_like(u)], axis=1)
