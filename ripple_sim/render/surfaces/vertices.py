"""The triangles and vertices that a target is drawn with: small, round in outline, split at creases and seams."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.visuals import ambient_occlusion as occlusion
from ripple_sim.render.visuals.corners import normalized, smooth_normals, split_corners
from ripple_sim.render.visuals.texture_mapping import Mapping
from ripple_sim.solver import Mesh

from .charts import Charts, VertexColumns, shared_places, split_at_charts
from .rounded_parts import rounded_parts
from .surface import Surface
from .tessellation import Edges, edges_of, midpoints, tessellate
from .vertex_order import in_memory_order

_LEAST_FACES, _MOST_FACES = 8_000, 400_000
# Creases are split down to half a texel, as heights have no finer detail, but to no less than a quarter of other edges.
_CREASE, _CREASE_PARTS = 0.5, 4
# columns of the vertex attributes: along DIRECTION, the smooth normal, a vertex is displaced; COORDINATES are for the
# chart map
POSITION, DIRECTION, COORDINATES, NORMAL, BAKED, UV = (
    slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 15), slice(15, 17),
)  # fmt: skip


def tessellated(
    mesh: Mesh,
    charts: Charts,
    *,
    smooth: NDArray,
    max_length: float,
    max_faces: int,
    crease_length: float | None = None,
    baked: NDArray | None = None,
    corner_uv: NDArray | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Split a mesh's vertices where normals, texture or map coordinates jump, and its edges where they are long.

    Parameters
    ----------
    mesh : Mesh
    charts : Charts
    smooth : array, shape [n, 3]
        Smooth normals of the vertices.
    max_length, max_faces, crease_length
        As for `tessellate`.
    baked : array, shape [n, 3], optional
        Ambient visibility, thickness and inner ambient visibility.
    corner_uv : array, shape [m, 3, 2], optional
        Texture coordinates of the triangles' corners.

    Returns
    -------
    F, attributes, same
        As for `tessellate`; the attributes' columns are named above.
    """
    parts, V, normals = rounded_parts(mesh, charts.map)
    F = parts.F
    split = split_corners(V, F, None if corner_uv is None else parts.carry(corner_uv), parts.coordinates, normals)
    baked = np.zeros((len(mesh.V), 3)) if baked is None else baked
    if parts.V is not mesh.V:
        at_parts = np.zeros((len(V), 6))
        at_parts[F] = parts.carry(np.concatenate([smooth, baked], axis=1)[mesh.F])
        smooth, baked = normalized(at_parts[:, :3]), at_parts[:, 3:]
    _, same = np.unique(np.column_stack([split.vertices, split.normals]), axis=0, return_inverse=True)
    each = split.vertices
    attributes = [V[each], smooth[each], split.coordinates, split.normals, baked[each], split.uv]
    return tessellate(
        split.F,
        np.concatenate(attributes, axis=1),
        same.ravel(),
        position=POSITION,
        normal=NORMAL,
        max_length=max_length,
        max_faces=max_faces,
        crease_length=crease_length,
    )


class SurfaceVertices(NamedTuple):
    """The vertices of a surface; the last ones are the edges' midpoints.

    Attributes
    ----------
    F : int64 [m, 3]
        Triangles.
    attributes : float64 [n + k, ...]
        See the columns above.
    edges : Edges
        k of them.
    places : float64 [n + k, 2]
        On the page of charts [texels].
    lookups : float64 [n + k, 2]
        Where heights are looked up: the same for all vertices at one point.
    """

    F: NDArray[np.int64]
    attributes: NDArray[np.float64]
    edges: Edges
    places: NDArray[np.float64]
    lookups: NDArray[np.float64]


def surface_vertices(surface: Surface, max_length: float, max_faces: int) -> SurfaceVertices:
    """Tessellate a surface."""
    V, F = np.asarray(surface.V, dtype=np.float64), np.asarray(surface.F, dtype=np.int64)
    smooth, charts = smooth_normals(V, F), surface.charts
    uv = np.zeros((len(V), 2)) if surface.uv is None else np.asarray(surface.uv, dtype=np.float64)
    finer = tessellated(
        Mesh(V, F),
        charts,
        smooth=smooth,
        max_length=max_length,
        max_faces=int(np.clip(max_faces, _LEAST_FACES, _MOST_FACES)),
        crease_length=max(_CREASE * _texel_size(V, F, charts), max_length / _CREASE_PARTS),
        baked=np.stack(occlusion.bake(V, F, smooth), axis=1),
        corner_uv=uv[F] if uv.ndim == 2 else uv,
    )
    cut = split_at_charts(finer, VertexColumns(POSITION, NORMAL, COORDINATES), charts)
    faces, attributes, same, chart = in_memory_order(cut, POSITION)
    edges = edges_of(faces, same)
    attributes = np.concatenate([attributes, midpoints(edges, attributes, POSITION, NORMAL)])
    length = np.linalg.norm(attributes[:, DIRECTION], axis=1, keepdims=True)
    attributes[:, DIRECTION] /= np.maximum(length, 1e-12)
    chart = np.concatenate([chart, chart[edges.ends[:, 0]]])
    chart_uv = charts.map.uv(attributes[:, COORDINATES], chart)
    places = charts.page.places(chart, chart_uv)
    points = attributes[:, [*range(POSITION.start, DIRECTION.stop)]]
    return SurfaceVertices(faces, attributes, edges, places, shared_places(chart_uv, places, points))


def _texel_size(V: NDArray, F: NDArray, charts: Charts) -> float:
    """Mean distance of a surface's texels [m]."""
    area = 0.5 * np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1).sum()
    return float(np.sqrt(area / np.prod(charts.shape)))


def mapped_coordinates(vertices: NDArray[np.float64], mapping: Mapping) -> NDArray[np.float64]:
    """Texture coordinates of the vertices, [n, 3]; see `Mapping`."""
    if not mapping.own:
        return mapping.at(vertices[:, POSITION])
    u, v = vertices[:, UV].T
    # a surface counts v from the image's lower edge, MuJoCo from the upper edge
    return np.stack([u, 1.0 - v, np.zeros_like(u)], axis=1)
