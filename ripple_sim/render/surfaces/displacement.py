"""Displacement of a target's vertices by its height map, on the GPU."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.contract import VERTEX_GROUP, Binding
from ripple_sim.render.resources import Resources

from .vertices import DIRECTION, POSITION, SurfaceVertices


@dataclass(frozen=True)
class Place:
    """Where a target is in the world, and which geoms darken it.

    Attributes
    ----------
    rotation : float64 [3, 3]
    origin : float64 [3]
        [m]
    occluders : int
        Bits of those near it; see `Occluders.near`.
    """

    rotation: NDArray[np.float64]
    origin: NDArray[np.float64]
    occluders: int


class Displacement:
    """The compute pass that displaces vertices and puts them into the world, once a frame.

    Parameters
    ----------
    resources : Resources
    vertices : SurfaceVertices
    layer : int
        Of its height map.

    Attributes
    ----------
    moved : moderngl.Buffer
        vec4 a vertex: displaced, in the world [m], and the ambient visibility that nearby geoms leave.
    """

    def __init__(self, resources: Resources, vertices: SurfaceVertices, layer: int) -> None:
        attributes = vertices.attributes
        self._midpoint_count = midpoint_count = len(vertices.edges.ends)
        self._base_count = base_count = len(attributes) - midpoint_count
        self._program = resources.compute_shader("surfaces/displacement")
        rest = np.concatenate([attributes[:, POSITION], attributes[:, DIRECTION], vertices.lookups], axis=1)
        self._vertices = rest.astype(np.float32)
        self._rest = resources.buffer(self._vertices.tobytes())
        self.moved: moderngl.Buffer = resources.buffer(reserve=16 * len(attributes))
        self._midpoints = resources.buffer(reserve=4 * midpoint_count, dynamic=True)
        self._program["base_count"] = base_count
        self._program["layer"] = float(layer)

    def move(self, points: NDArray[np.float32], directions: NDArray[np.float32]) -> None:
        """Replace where the vertices are at rest [m] and the directions that they are displaced in, [n, 3]."""
        self._vertices[:, :3], self._vertices[:, 3:6] = points, directions
        self._rest.write(self._vertices)

    def run(self, ctx: moderngl.Context, place: Place, midpoints: NDArray[np.int32] | moderngl.Buffer) -> None:
        """Displace all vertices and the given midpoints; height maps and occluders are bound already.

        Midpoints are a list of vertices, or a buffer on the GPU that says of each whether it is in use.
        """
        if isinstance(midpoints, moderngl.Buffer):
            listed, count = midpoints, self._midpoint_count
        else:
            listed, count = self._midpoints, len(midpoints)
            if count:
                listed.write(midpoints)
        self._rest.bind_to_storage_buffer(Binding.REST_VERTICES)
        self.moved.bind_to_storage_buffer(Binding.MOVED_VERTICES)
        listed.bind_to_storage_buffer(Binding.MIDPOINTS)
        count += self._base_count
        self._program["flagged"] = listed is not self._midpoints
        self._program["rotation"] = tuple(place.rotation.T.ravel())
        self._program["origin"] = tuple(place.origin)
        self._program["count"] = count
        self._program["occluders_near"] = place.occluders
        self._program.run(-(-count // VERTEX_GROUP))
        ctx.memory_barrier()
