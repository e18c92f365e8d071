"""`surface_vertices`: the triangles and vertices with which a `Surface` is drawn.

They are small, round in outline, and split at creases and seams. The mesh of the surface is cut
into the parts of its chart map, tessellated, cut where triangles leave a chart, and ordered for
vertex caches.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.bounds import balls_about
from ripple_sim.render.visuals.corners import (
    bake,
    corner_normals,
    normalized,
    smooth_normals,
    split_corners,
)
from ripple_sim.render.visuals.texture_mapping import TextureMapping
from ripple_sim.solver import Mesh
from ripple_sim.solver.cache import ResultCache, content_key
from ripple_sim.solver.mesh.topology import Edges, edges_of
from ripple_sim.solver.texels.chart_map import ChartMap
from ripple_sim.solver.texels.parts_mesh import PartsMesh, parts_mesh

from .surface import Charts, Surface, shared_places, split_at_charts
from .tessellation import (
    COORDINATES,
    DIRECTION,
    POSITION,
    UV,
    bulges,
    coarse_mesh,
    midpoints,
    tessellate,
    welded,
)

_SAME_NORMAL = 1e-4  # normals at a vertex that differ by less are one
_MORTON_BITS = 10  # of a coordinate, in the code of a Morton curve

# Bounds of the number of triangles of a target, whatever the frame's size asks for.
_MIN_FACES = 8_000
_MAX_FACES = 400_000

# Creases are split down to this many texels, as heights have no finer detail, but not into more
# parts than this for each other edge.
_CREASE_LENGTH = 0.5
_MAX_CREASE_PARTS = 4

_BALLS = 16  # that together bound the mesh
_COARSE_VERTICES = 600  # of the mesh that the floor sees: texels of its map are about as far apart

# Distance in features between the two sides of a thin body, over the bounding radius.
_SIDE_DISTANCE = 0.1

_MAX_CACHED_FACES = 100_000  # of a surface that is kept for later: 30 MB


def rounded_parts(
    mesh: Mesh, chart_map: ChartMap
) -> tuple[PartsMesh, NDArray[np.float64], NDArray[np.float64]]:
    """Cut a mesh into the parts of its chart map, as round as before.

    Return also the vertices of the parts [n, 3] [m] and their corner normals [m, 3, 3], which are
    carried over from the mesh. The parts of a triangle bulge out as the triangle itself would: as
    the quadratic patch whose edges have the midpoints of `tessellate`, flat where the normals are.
    """
    parts = parts_mesh(chart_map, mesh)
    normals = corner_normals(mesh.V, mesh.F)
    if parts.V is mesh.V:
        return parts, mesh.V, normals
    # how far the midpoint of each triangle's side from corner k to k + 1 bulges out [m], [m, 3, 3]
    vertices, F, split_normals, _, _ = split_corners(mesh.V, mesh.F)
    attributes = np.concatenate([mesh.V[vertices], split_normals], axis=1)
    edges = edges_of(F)
    _, inner = welded(edges, F, np.arange(len(attributes)))
    out = bulges(edges.ends, inner, attributes)[edges.of_side]
    V = parts.V.copy()
    w = parts.barycentrics
    V[parts.F] += 4 * np.einsum("pck,pck,pkj->pcj", w, np.roll(w, -1, axis=2), out[parts.triangle])
    # corner normals are the same to the last bit where they differ by round-off at a vertex
    normals = normalized(parts.carry(normals)).reshape(-1, 3)
    key = np.column_stack([parts.F.ravel(), np.rint(normals / _SAME_NORMAL).astype(np.int64)])
    _, first, group = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return parts, V, normals[first[group.ravel()]].reshape(-1, 3, 3)


def memory_order(
    F: NDArray[np.int64], points: NDArray
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Triangles along a Morton (Z-order) curve, and vertices in the order of their first use.

    The curve goes through the centres of the triangles. Neighbours are then close in memory, for
    the vertex caches of GPUs and software drivers.

    Parameters
    ----------
    F : int64, shape [m, 3]
    points : float, shape [n, 3]

    Returns
    -------
    renumbered : int64 [m, 3]
        The triangles in their new order, of new vertices.
    vertices : int64 [n]
        The old numbers of the vertices, in their new order; unused ones come last.
    triangles : int64 [m]
        The old numbers of the triangles, in their new order.
    """
    triangles = morton_order(points[F].mean(axis=1))
    used, first = np.unique(F[triangles], return_index=True)
    vertices = np.concatenate([used[np.argsort(first)], np.setdiff1d(np.arange(len(points)), used)])
    return np.argsort(vertices)[F[triangles]], vertices, triangles


def morton_order(points: NDArray) -> NDArray[np.int64]:
    """Order of points [k, 3] along a Morton curve, by the interleaved bits of their coordinates."""
    low = points.min(axis=0)
    high = points.max(axis=0)
    cell = ((points - low) / max((high - low).max(), 1e-300) * (2**_MORTON_BITS - 1)).astype(
        np.int64
    )
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(_MORTON_BITS):
        for axis in range(3):
            code |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


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
    """Tessellate a mesh; split its vertices where normals, texture or chart coordinates jump.

    Parameters
    ----------
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
        As for `tessellate`.
    """
    parts, V, normals = rounded_parts(mesh, charts.map)
    F = parts.F
    corner_uv = None if corner_uv is None else parts.carry(corner_uv)
    vertex, split_F, normals, uv, coordinates = split_corners(
        V, F, corner_uv, parts.coordinates, normals
    )
    baked = np.zeros((len(mesh.V), 3)) if baked is None else baked
    if parts.V is not mesh.V:
        at_parts = np.zeros((len(V), 6))
        at_parts[F] = parts.carry(np.concatenate([smooth, baked], axis=1)[mesh.F])
        smooth = normalized(at_parts[:, :3])
        baked = at_parts[:, 3:]
    _, same = np.unique(np.column_stack([vertex, normals]), axis=0, return_inverse=True)
    attributes = np.concatenate(
        [V[vertex], normals, coordinates, smooth[vertex], baked[vertex], uv], axis=1
    )
    return tessellate(
        split_F,
        attributes,
        same.ravel(),
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
        See `tessellate`.
    edges : Edges
        k of them.
    places : float64 [n + k, 2]
        On the page of charts [texels].
    lookups : float64 [n + k, 2]
        Where heights are looked up: the same for all vertices at one point.
    balls : float64 [b, 4]
        Balls that together contain the surface without waves: centre and radius [m].
    coarse : int64 [c, 3]
        Few triangles that have about the same shape.
    """

    F: NDArray[np.int64]
    attributes: NDArray[np.float64]
    edges: Edges
    places: NDArray[np.float64]
    lookups: NDArray[np.float64]
    balls: NDArray[np.float64]
    coarse: NDArray[np.int64]


def _surface_vertices(surface: Surface, max_length: float, max_faces: int) -> SurfaceVertices:
    """The vertices of a surface with edges up to a length [m]."""
    V = np.asarray(surface.V, dtype=np.float64)
    F = np.asarray(surface.F, dtype=np.int64)
    smooth = smooth_normals(V, F)
    charts = surface.charts
    uv = np.zeros((len(V), 2)) if surface.uv is None else np.asarray(surface.uv, dtype=np.float64)
    mesh = Mesh(V, F)
    texel_size = float(np.sqrt(mesh.area / (charts.page.charts * charts.page.resolution**2)))
    finer = tessellated(
        mesh,
        charts,
        smooth=smooth,
        max_length=max_length,
        max_faces=int(np.clip(max_faces, _MIN_FACES, _MAX_FACES)),
        crease_length=max(_CREASE_LENGTH * texel_size, max_length / _MAX_CREASE_PARTS),
        baked=bake(V, F, smooth),
        corner_uv=uv[F] if uv.ndim == 2 else uv,
    )
    faces, attributes, same, chart = split_at_charts(finer, charts)
    faces, order, _ = memory_order(faces, attributes[:, POSITION])
    attributes = attributes[order]
    same = same[order]
    chart = chart[order]
    edges = edges_of(faces)
    _, inner = welded(edges, faces, same)
    attributes = np.concatenate([attributes, midpoints(edges.ends, inner, attributes)])
    attributes[:, DIRECTION] /= np.maximum(
        np.linalg.norm(attributes[:, DIRECTION], axis=1, keepdims=True), 1e-12
    )
    chart = np.concatenate([chart, chart[edges.ends[:, 0]]])
    chart_uv = charts.map.uv(attributes[:, COORDINATES], chart)
    places = charts.page.places(chart, chart_uv)
    points = np.hstack([attributes[:, POSITION], attributes[:, DIRECTION]])
    lookups = shared_places(chart_uv, places, points)
    corners = np.concatenate([faces, len(chart) - len(edges.ends) + edges.of_side])
    balls = balls_about(attributes[:, POSITION][corners], _BALLS)
    own = attributes[: len(same)]  # without midpoints
    apart = _SIDE_DISTANCE * np.ptp(points, axis=0)[:3].max() / 2 * own[:, DIRECTION]
    features = np.hstack([own[:, POSITION], apart])
    coarse_vertices, coarse = coarse_mesh(faces, features, _COARSE_VERTICES)
    vertices = SurfaceVertices(
        faces, attributes, edges, places, lookups, balls, coarse_vertices[coarse]
    )
    for array in (*edges, *vertices):
        if isinstance(array, np.ndarray):
            array.flags.writeable = False
    return vertices


def mapped_coordinates(
    vertices: NDArray[np.float64], mapping: TextureMapping
) -> NDArray[np.float64]:
    """Texture coordinates of the vertices, [n, 3]; see `TextureMapping`."""
    if not mapping.own:
        return mapping.at(vertices[:, POSITION])
    u, v = vertices[:, UV].T
    # a surface counts v from the image's lower edge, MuJoCo from the upper edge
    return np.stack([u, 1.0 - v, np.zeros_like(u)], axis=1)


_cache: ResultCache[SurfaceVertices] = ResultCache(
    4, lambda vertices: len(vertices.F) <= _MAX_CACHED_FACES
)


def surface_vertices(surface: Surface, max_length: float, max_faces: int) -> SurfaceVertices:
    """Tessellate a surface, or take the result of an earlier call; the arrays are read-only.

    In a batch the next scene mostly has the same surfaces.
    """
    charts = surface.charts
    uv = np.zeros(0) if surface.uv is None else np.asarray(surface.uv)
    arrays = charts.map.arrays()
    name = f"{charts.map.layout} {charts.page} {list(arrays)} {max_length!r} {max_faces}"
    key = content_key(name, [surface.V, surface.F, uv, *arrays.values()])
    return _cache.get(key, lambda: _surface_vertices(surface, max_length, max_faces))
