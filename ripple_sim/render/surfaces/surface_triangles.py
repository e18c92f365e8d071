"""The triangles of a target in one frame: fine where its waves are sharp."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.resources import Resources

from .adaptive import AdaptiveTessellation
from .charts import Charts
from .device_tessellation import DeviceTessellation
from .vertices import POSITION, SurfaceVertices

PIXELS = 5.6  # length of an edge where the target fills the frame's height
_TOLERANCE = 0.25  # [pixels], likewise: edges from which the waves depart further are split


class SurfaceTriangles:
    """Triangles of a target on the GPU, found by the host from its copy of the heights, or by the device from its own.

    Parameters
    ----------
    resources : Resources
    vertices : SurfaceVertices
    charts : Charts
    layer : int
        Of the height map.
    pixel : float
        Size of a pixel on the target where it fills the frame's height [m].

    Attributes
    ----------
    indices : moderngl.Buffer
        Three vertices a triangle.
    count : int or moderngl.Buffer
        Of the indices in use; the device's is an indirect draw call.
    midpoints : int32 array or moderngl.Buffer
        Edges whose midpoints are in use; the device's has a flag for every edge.
    """

    count: int | moderngl.Buffer
    midpoints: NDArray[np.int32] | moderngl.Buffer

    def __init__(
        self, resources: Resources, vertices: SurfaceVertices, charts: Charts, layer: int, pixel: float
    ) -> None:
        self._resources, self._page, self._layer = resources, charts.page, layer
        self._tessellation = AdaptiveTessellation(
            vertices.F,
            vertices.edges,
            vertices.attributes[:, POSITION],
            vertices.lookups,
            charts.page,
            tolerance=_TOLERANCE * pixel,
            min_length=1.5 * PIXELS * pixel,
        )
        self.indices = resources.buffer(reserve=4 * 12 * len(vertices.F), dynamic=True)
        self._written: NDArray[np.int32] | None = None
        self._on_device: DeviceTessellation | None = None

    def find(self, height_map: NDArray[np.float32]) -> None:
        """Find the triangles for heights, [C, n + 2, n + 2, 4], and write those that are not there yet."""
        triangles, self.midpoints = self._tessellation(height_map)
        if triangles is not self._written:
            self.indices.write(triangles)
            self._written = triangles
        self.count = triangles.size

    def find_on_device(self, ctx: moderngl.Context) -> None:
        """Have the device find the triangles for the heights that are bound; storage buffers are bound for that."""
        if self._on_device is None:
            self._on_device = DeviceTessellation(
                self._resources, self._tessellation, self._page, self._layer, self.indices
            )
        self._on_device.run(ctx)
        self.midpoints, self.count, self._written = self._on_device.split, self._on_device.command, None
