"""Adaptive tessellation on the GPU: the triangles of `AdaptiveTessellation`, in its order, from a texture's heights."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.contract import Splitting
from ripple_sim.render.resources import Resources
from ripple_sim.solver.texels.texel_atlas import ChartPage

from .adaptive import AdaptiveTessellation

_GROUP = 256


class DeviceTessellation:
    """Decides which edges are split, and writes triangles and the draw call's size, without asking the host.

    How many triangles come before each face's is a sum over all faces before it: within groups of faces first, and then
    over the groups. So their order is always the same.

    Parameters
    ----------
    resources : Resources
    adaptive : AdaptiveTessellation
    page : ChartPage
    layer : int
        Of the height map.
    indices : moderngl.Buffer
        Where the triangles go, room for four a face.

    Attributes
    ----------
    split : moderngl.Buffer
        int32 an edge: whether its midpoint is used.
    command : moderngl.Buffer
        Of an indirect draw call.
    """

    def __init__(
        self,
        resources: Resources,
        adaptive: AdaptiveTessellation,
        page: ChartPage,
        layer: int,
        indices: moderngl.Buffer,
    ) -> None:
        self._layer, self._tolerance = layer, float(adaptive.tolerance)
        self._counts = len(adaptive.long), len(adaptive.faces)
        _, rank = np.unique(adaptive.length, return_inverse=True)
        first = np.array([page.corner(chart) for chart in range(page.charts)])[adaptive.texel[:, 0]]
        places = np.concatenate([first + adaptive.texel[:, :0:-1], adaptive.offset], axis=1)
        middles = len(adaptive.texel) - len(adaptive.long) + np.arange(len(adaptive.long))
        groups = -(-len(adaptive.faces) // _GROUP)

        def buffer(content: NDArray, dtype: str = "i4") -> moderngl.Buffer:
            return resources.buffer(content.astype(dtype).tobytes() or bytes(16))

        self.split, self.command = buffer(np.zeros(len(rank))), buffer(np.array([0, 1, 0, 0, 0]))
        sides = adaptive.sides
        faces = np.concatenate([adaptive.faces, adaptive.base_count + sides, rank.ravel()[sides]], axis=1)
        self._buffers = {
            Splitting.SPLIT: self.split,
            Splitting.LONG_EDGES: buffer(np.column_stack([adaptive.long, adaptive.ends, middles])),
            Splitting.LOOKUPS: buffer(places, "f4"),
            Splitting.FACES: buffer(faces),
            Splitting.BEFORE: buffer(np.zeros(len(faces))),
            Splitting.TOTALS: buffer(np.zeros(groups)),
            Splitting.INDICES: indices,
            Splitting.COMMAND: self.command,
        }
        self._split_edges, self._count, self._add, self._write = (
            resources.compute_shader(f"surfaces/{name}", GROUP=_GROUP, FIRST_MIDPOINT=adaptive.base_count)
            for name in ("split_edges", "count_triangles", "add_counts", "write_triangles")
        )

    def run(self, ctx: moderngl.Context) -> None:
        """Write the triangles for the height map that is bound."""
        edges, faces = self._counts
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(binding)
        if edges:
            self._split_edges["layer"], self._split_edges["tolerance"] = self._layer, self._tolerance
        for shader, count in ((self._split_edges, edges), (self._count, faces), (self._add, 1), (self._write, faces)):
            if count:
                if shader is not self._add:
                    shader["count"] = count
                shader.run(-(-count // _GROUP))
                ctx.memory_barrier()
