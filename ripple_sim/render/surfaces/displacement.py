"""Displacement of a target's vertices by its height map, on the GPU."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.gpu.contract import VERTEX_GROUP, Binding
from ripple_sim.render.gpu.resources import Resources

from .vertices import DIRECTION, POSITION, SPHERE, packed


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
    vertices : array, shape [n + k, ...]
        Attributes of n vertices and k midpoints; for the columns see vertices.py.
    base_count : int
        Number n.
    geom : int
        The target's geom.
    resolution, first_layer : int
        Of its height map.

    Attributes
    ----------
    moved : moderngl.Buffer
        vec4 a vertex: displaced, in the world [m], and the ambient visibility that nearby geoms leave.
    """

    def __init__(
        self, resources: Resources, vertices: NDArray, base_count: int, *, geom: int, resolution: int, first_layer: int
    ) -> None:
        self._program = resources.compute_shader("surfaces/displacement")
        self._rest = resources.buffer(packed(vertices, POSITION, DIRECTION, SPHERE))
        self.moved: moderngl.Buffer = resources.buffer(reserve=16 * len(vertices))
        self._midpoints = resources.buffer(reserve=4 * (len(vertices) - base_count), dynamic=True)
        self._base_count = base_count
        self._program["base_count"] = base_count
        self._program["geom"] = float(geom)
        self._program["resolution"] = float(resolution)
        self._program["first_layer"] = float(first_layer)

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
