"""Adaptive tessellation: edges of a target's mesh are split where the waves bend, frame by frame.

Edges are split where the waves are computed: on the processor, from heights in its memory, or on
the GPU, by compute shaders, from heights in a texture. Both give the same triangles in the same
order.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.contract import Binding
from ripple_sim.render.resources import Resources
from ripple_sim.solver.kernel import Floats, Ints32, kernel
from ripple_sim.solver.texels.chart_page import ChartPage

from .spline import spline_heights, spline_samples
from .tessellation import POSITION
from .vertices import SurfaceVertices

_GROUP = 256  # invocations in a work group of the compute shaders


class AdaptiveTessellation:
    """Splits the edges of a mesh at their midpoints where a height map bends too much.

    Whether an edge is split depends only on its length and the heights at its ends and midpoint, so
    that the triangles on both sides of it agree, across seams and creases, too: no gap opens.

    Parameters
    ----------
    tolerance : float
        How far the height at a midpoint may differ from the mean of those at the ends [m].
    min_length : float
        Shorter edges stay whole [m].

    Attributes
    ----------
    base_count : int
        Number n of vertices, without midpoints.
    faces, sides : int32 [m, 3]
        Triangles, and their edges.
    length : float64 [k]
        Of the edges [m].
    long : int32 [l]
        Edges that may be split.
    ends : int32 [l, 2]
        Lookups of their ends; those of their midpoints are the last l.
    texel, offset : int32 and float32, [..., 3] and [..., 2]
        Of each lookup: chart, row and column of the first of the 3 x 3 texels about it, in a chart
        with its halo, and how far it is off their centre, in rows and columns.
    """

    def __init__(
        self, vertices: SurfaceVertices, page: ChartPage, tolerance: float, min_length: float
    ) -> None:
        edges = vertices.edges
        positions = vertices.attributes[:, POSITION]
        self.base_count = len(positions) - len(edges.ends)
        self.faces = np.asarray(vertices.F, np.int32)
        self.sides = np.asarray(edges.of_side, np.int32)
        self.length = np.linalg.norm(
            positions[edges.ends[:, 1]] - positions[edges.ends[:, 0]], axis=1
        )
        self.tolerance = np.float32(tolerance)
        # heights are looked up at the ends of the edges that may be split, and then at these edges'
        # midpoints
        self.long = np.flatnonzero(self.length >= min_length).astype(np.int32)
        ends, index = np.unique(edges.ends[self.long], return_inverse=True)
        self.ends = index.reshape(-1, 2).astype(np.int32)
        places = vertices.lookups[np.concatenate([ends, self.base_count + self.long])]
        self.texel, self.offset = spline_samples(*page.locate(places), page.resolution)

    def __call__(
        self, height_map: NDArray[np.float32]
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangles [t, 3] for a height map [C, n + 2, n + 2, 4], and the midpoints [s] they use.

        The midpoints are numbers of vertices. In the triangles they follow the mesh's own vertices,
        as `Displacement.use` arranges them. Where no edge is split, the triangles are the same
        array each time.
        """
        unsplit = self.faces, np.empty(0, np.int32)
        if not len(self.long) or not height_map[..., 3].any():
            return unsplit
        height = spline_heights(height_map, self.texel, self.offset)
        middle = height[-len(self.long) :]
        ends = height[self.ends]
        bend = np.abs(middle - np.float32(0.5) * (ends[:, 0] + ends[:, 1]))  # [m]
        split = self.long[bend > self.tolerance]
        if not len(split):
            return unsplit
        midpoint = np.full(len(self.length), -1, np.int32)
        midpoint[split] = np.arange(self.base_count, self.base_count + len(split))
        triangles = _triangles(self.faces, self.sides, midpoint, self.length)
        return triangles, np.int32(self.base_count) + split


@kernel
def _triangles(faces: Ints32, sides: Ints32, midpoint: Ints32, length: Floats) -> Ints32:
    """Cut every triangle [m, 3] into 1 to 4 by the midpoints of its sides.

    `sides` [m, 3] are the edges of the triangles; `midpoint` [k] is the vertex in the middle of an
    edge, -1 without one; `length` [k] is that of the edges [m].
    """
    triangles = np.empty((4 * len(faces), 3), np.int32)
    count = 0
    for face in range(len(faces)):
        splits = 0
        for k in range(3):
            splits += midpoint[sides[face, k]] >= 0
        # turn the triangle so that its only split side, or its only whole one, is side 0
        first = 0
        if splits == 1 or splits == 2:
            while (midpoint[sides[face, first]] >= 0) != (splits == 1):
                first += 1
        second = (first + 1) % 3
        third = (first + 2) % 3
        a = faces[face, first]
        b = faces[face, second]
        c = faces[face, third]
        ab = sides[face, first]
        bc = sides[face, second]
        ca = sides[face, third]
        m = midpoint[ab]
        n = midpoint[bc]
        o = midpoint[ca]
        if splits == 0:
            triangles[count] = a, b, c
        elif splits == 1:
            triangles[count] = a, m, c
            triangles[count + 1] = m, b, c
        elif splits == 2:
            triangles[count] = o, n, c
            # the median to the longer side is the shorter diagonal of the rest
            if length[bc] >= length[ca]:
                triangles[count + 1] = a, b, n
                triangles[count + 2] = a, n, o
            else:
                triangles[count + 1] = a, b, o
                triangles[count + 2] = b, n, o
        else:
            triangles[count] = a, m, o
            triangles[count + 1] = b, n, m
            triangles[count + 2] = c, o, n
            triangles[count + 3] = m, n, o
        count += splits + 1
    return triangles[:count]


class DeviceTessellation:
    """Splits edges on the GPU: writes the triangles and the size of the draw call there.

    Nothing is read back. The first triangle of a face is found by a sum over all faces before it,
    within groups of faces first and then over the groups, so the order is always the same.

    Parameters
    ----------
    layer : int
        Of the height map.
    indices : moderngl.Buffer
        Where the triangles go, room for four a face.

    Attributes
    ----------
    midpoints : int32 [k]
        All of them, as vertices: the triangles may use any.
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
        self._layer = layer
        self._tolerance = float(adaptive.tolerance)
        self._counts = len(adaptive.long), len(adaptive.faces)
        _, rank = np.unique(adaptive.length, return_inverse=True)
        corners = np.array([page.corner(chart) for chart in range(page.charts)])
        first_texel = corners[adaptive.texel[:, 0]] + adaptive.texel[:, :0:-1]
        places = np.concatenate([first_texel, adaptive.offset], axis=1)
        # lookups of the midpoints are the last ones
        middles = len(adaptive.texel) - len(adaptive.long) + np.arange(len(adaptive.long))
        groups = -(-len(adaptive.faces) // _GROUP)
        self.midpoints = np.arange(
            adaptive.base_count, adaptive.base_count + len(adaptive.length), dtype=np.int32
        )

        def buffer(content: NDArray, dtype: str = "i4") -> moderngl.Buffer:
            return resources.buffer(content.astype(dtype).tobytes() or bytes(16))

        self.split = buffer(np.zeros(len(rank)))
        self.command = buffer(np.array([0, 1, 0, 0, 0]))
        sides = adaptive.sides
        faces = np.concatenate(
            [adaptive.faces, adaptive.base_count + sides, rank.ravel()[sides]], axis=1
        )
        self._buffers = {
            Binding.SPLIT: self.split,
            Binding.LONG_EDGES: buffer(np.column_stack([adaptive.long, adaptive.ends, middles])),
            Binding.LOOKUPS: buffer(places, "f4"),
            Binding.FACES: buffer(faces),
            Binding.BEFORE: buffer(np.zeros(len(faces))),
            Binding.TOTALS: buffer(np.zeros(groups)),
            Binding.INDICES: indices,
            Binding.COMMAND: self.command,
        }

        def shader(stage: str) -> moderngl.ComputeShader:
            return resources.compute_shader("surfaces/adaptive", stage, GROUP=_GROUP)

        self._split_edges = shader("split")
        self._count = shader("count")
        self._add = shader("add")
        self._write = shader("write")

    def run(self, ctx: moderngl.Context) -> None:
        """Write the triangles for the height map that is bound."""
        edges, faces = self._counts
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(binding)
        self._split_edges["layer"] = self._layer
        self._split_edges["tolerance"] = self._tolerance
        for shader in (self._count, self._write):
            shader["first_midpoint"] = self.midpoints[0]
        for shader, count in (
            (self._split_edges, edges),
            (self._count, faces),
            (self._add, 1),
            (self._write, faces),
        ):
            if count:
                if shader is not self._add:
                    shader["count"] = count
                shader.run(-(-count // _GROUP))
                ctx.memory_barrier()
