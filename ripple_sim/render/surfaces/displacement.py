"""Displacement of a target's vertices by its height map, on the GPU."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.gpu.contract import VERTEX_GROUP, Binding
from ripple_sim.render.gpu.resources import Resources

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
        How many are bound.
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
    geom : int
        The target's geom.
    layer : int
        Of its height map.

    Attributes
    ----------
    moved : moderngl.Buffer
        vec4 a vertex: displaced, in the world [m], and the ambient visibility that nearby geoms leave.
    """

    def __init__(self, resources: Resources, vertices: SurfaceVertices, *, geom: int, layer: int) -> None:
        attributes, midpoint_count = vertices.attributes, len(vertices.edges.ends)
        self._base_count = base_count = len(attributes) - midpoint_count
        self._program = resources.compute_shader("surfaces/displacement")
        rest = np.concatenate([attributes[:, POSITION], attributes[:, DIRECTION], vertices.lookups], axis=1)
        self._rest = resources.buffer(rest.astype(np.float32).tobytes())
        self.moved: moderngl.Buffer = resources.buffer(reserve=16 * len(attributes))
        self._midpoints = resources.buffer(reserve=4 * midpoint_count, dynamic=True)
        self._program["base_count"] = base_count
        self._program["geom"] = float(geom)
        self._program["layer"] = float(layer)

    def run(self, ctx: moderngl.Context, place: Place, midpoints: NDArray[np.int32]) -> None:
        """Displace all vertices and the given midpoints; height maps and occluders are bound already."""
        if len(midpoints):
            self._midpoints.write(midpoints)
        self._rest.bind_to_storage_buffer(Binding.REST_VERTICES)
        self.moved.bind_to_storage_buffer(Binding.MOVED_VERTICES)
        self._midpoints.bind_to_storage_buffer(Binding.MIDPOINTS)
        count = self._base_count + len(midpoints)
        self._program["rotation"] = tuple(place.rotation.T.ravel())
        self._program["origin"] = tuple(place.origin)
        self._program["count"] = count
        self._program["occluder_count"] = place.occluders
        self._program.run(-(-count // VERTEX_GROUP))
        ctx.memory_barrier()
