"""`Displacement`: the vertices of a target on the GPU, displaced once a frame."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.resources import Resources
from ripple_sim.solver.kernel import Floats32

from .tessellation import BAKED, DIRECTION, NORMAL, POSITION
from .vertices import SurfaceVertices


class Displacement:
    """The vertices of a target on the GPU, and the pass that displaces them once a frame.

    The pass also puts them into the world; its results are captured by transform feedback. The
    mesh's own vertices come first, then the midpoints in use.

    Parameters
    ----------
    mapped : float64 [n, 3]
        Texture coordinates of all vertices.
    layer : int
        Of its height map.

    Attributes
    ----------
    moved : moderngl.Buffer
        vec4 a vertex: displaced, in the world [m], and the ambient visibility that nearby geoms
        leave.
    vertices : moderngl.Buffer
        What `KEPT` says of each vertex.
    """

    # buffer, format and names of the vertex attributes
    KEPT = "8x4 3f 3f 2f 3f", "in_normal", "in_baked", "in_place", "in_mapped"

    def __init__(
        self,
        resources: Resources,
        vertices: SurfaceVertices,
        mapped: NDArray[np.float64],
        layer: int,
    ) -> None:
        own = vertices.attributes
        self._base_count = len(own) - len(vertices.edges.ends)
        columns = (
            own[:, POSITION],
            own[:, DIRECTION],
            vertices.lookups,
            own[:, NORMAL],
            own[:, BAKED],
        )
        self._content = np.concatenate([*columns, vertices.places, mapped], axis=1).astype(
            np.float32
        )
        self.vertices: moderngl.Buffer = resources.buffer(self._content.tobytes(), dynamic=True)
        self.moved: moderngl.Buffer = resources.buffer(reserve=16 * len(own))
        self._program = resources.program("surfaces/displacement", "moved")
        self._program["layer"] = float(layer)
        names = "in_position", "in_direction", "in_lookup"
        self._pass = resources.vertex_array(
            self._program, [(self.vertices, "3f 3f 2f 11x4", *names)]
        )
        # nothing is drawn, but OpenGL asks for a framebuffer
        self._framebuffer = resources.framebuffer([resources.renderbuffer((1, 1))])
        self._used: NDArray[np.int32] | None = None

    def lay(self, mapped: NDArray[np.float64]) -> None:
        """Replace the texture coordinates of all vertices, [n, 3]."""
        self._content[:, -3:] = mapped
        self.vertices.write(self._content[: self._base_count])
        self._used = None

    def move(
        self, points: Floats32, directions: Floats32, normals: Floats32, baked: Floats32
    ) -> None:
        """Replace the points of all vertices at rest [m], their directions and more, [n, 3] each.

        The directions are those of the displacement.
        """
        self._content[:, :6] = np.hstack([points, directions])
        self._content[:, 8:14] = np.hstack([normals, baked])
        self.vertices.write(self._content[: self._base_count])
        self._used = None

    def use(self, midpoints: NDArray[np.int32]) -> None:
        """Let these vertices follow the mesh's own vertices in the buffer."""
        if len(midpoints) and midpoints is not self._used:
            rows = self._content[midpoints]
            self.vertices.write(rows, offset=self._base_count * rows.strides[0])
        self._used = midpoints
        self._count = self._base_count + len(midpoints)

    def run(
        self, rotation: NDArray[np.float64], origin: NDArray[np.float64], occluders: int
    ) -> None:
        """Displace all vertices that are in use; height maps and occluders are bound already.

        Parameters
        ----------
        rotation, origin : float64 [3, 3], [3]
            Of the target in the world [m].
        occluders : int
            Bits of the occluders near the target; see `Occluders.near`.
        """
        self._program["rotation"] = tuple(rotation.T.ravel())
        self._program["origin"] = tuple(origin)
        self._program["occluders_near"] = occluders
        self._framebuffer.use()
        self._pass.transform(self.moved, moderngl.POINTS, vertices=self._count)
