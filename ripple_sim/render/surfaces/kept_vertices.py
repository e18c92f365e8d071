"""What a target is drawn with, kept for the next scene: in a batch it mostly has the same surfaces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.bounds import Balls, balls_about
from ripple_sim.solver.cache import Kept, content_key

from .coarse_mesh import coarse_mesh
from .surface import Surface
from .vertices import DIRECTION, POSITION, SurfaceVertices, surface_vertices

_BALLS = 16  # that bound the mesh
_COARSE = 600  # vertices of what the floor sees: texels of its map are about as far apart
_APART = 0.1  # of the bounding radius: how far from each other the two sides of a thin body are
_MOST_FACES = 100_000  # of a surface that is kept: 30 MB


class BoundedVertices(NamedTuple):
    """The vertices of a surface, whose arrays cannot be written to, balls about it, and few triangles of its shape."""

    vertices: SurfaceVertices
    balls: Balls
    coarse: NDArray[np.int64]


_kept: Kept[BoundedVertices] = Kept(4, lambda each: len(each.vertices.F) <= _MOST_FACES)


def bounded_vertices(surface: Surface, max_length: float, max_faces: int) -> BoundedVertices:
    """Tessellate a surface as `surface_vertices` does, or take what came of it before."""
    charts, uv = surface.charts, np.zeros(0) if surface.uv is None else np.asarray(surface.uv)
    arrays = charts.map.arrays()
    name = f"{charts.map.layout} {charts.shape} {list(arrays)} {max_length!r} {max_faces}"
    key = content_key(name, [surface.V, surface.F, uv, *arrays.values()])
    return _kept.get(key, lambda: _bounded(surface_vertices(surface, max_length, max_faces)))


def _bounded(vertices: SurfaceVertices) -> BoundedVertices:
    for array in (*vars(vertices.edges).values(), *vertices._asdict().values()):
        if isinstance(array, np.ndarray):
            array.flags.writeable = False
    middle = len(vertices.attributes) - len(vertices.edges.ends) + vertices.edges.of_side
    corners = np.concatenate([vertices.F, middle])
    points = vertices.attributes[:, POSITION]
    return BoundedVertices(vertices, balls_about(points[corners], _BALLS), _coarse(vertices, points))


def _coarse(vertices: SurfaceVertices, points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Triangles [m, 3] between few of the vertices."""
    base = len(points) - len(vertices.edges.ends)
    apart = _APART * np.ptp(points, axis=0).max() / 2 * vertices.attributes[:base, DIRECTION]
    mesh = coarse_mesh(vertices.F, np.hstack([points[:base], apart]), _COARSE)
    return mesh.vertices[mesh.F]
