"""Surface images: distance, normal, geom and place on the height map of each pixel."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.visuals.objects import ObjectTable

from .frame_pass import FramePass
from .g_buffer import GBuffer
from .resources import Resources


class SurfaceImage(NamedTuple):
    """The surface at the middle of each pixel, top row first.

    Attributes
    ----------
    depth : float32 [height, width]
        Distance along the camera's axis [m]; 0 without a surface.
    geom : int32 [height, width]
        Geom id; for a site the id of the nearest geom of its body; -1 without a surface.
    identity : int32 [height, width, 2]
        Id and type (`mujoco.mjtObj`) of the object; -1 without a surface.
    normal : float32 [height, width, 3]
        Normal in the world, with ripples.
    smooth_normal : float32 [height, width, 3]
        Normal in the world without ripples; on an open surface, of its outer side.
    place : float32 [height, width, 2]
        Place on a target's page of charts [texels].
    target : int32 [height, width]
        Index of the target among all targets in the order of geom ids; -1 without a target.
    height : float32 [height, width]
        Height of the ripples [m].
    """

    depth: NDArray[np.float32]
    geom: NDArray[np.int32]
    identity: NDArray[np.int32]
    normal: NDArray[np.float32]
    smooth_normal: NDArray[np.float32]
    place: NDArray[np.float32]
    target: NDArray[np.int32]
    height: NDArray[np.float32]


class SurfaceBuffers:
    """Draws surface images of one size.

    Parameters
    ----------
    size : (width, height)
        Width and height [pixels].
    """

    def __init__(self, resources: Resources, size: tuple[int, int]) -> None:
        self.size = size
        self._g_buffer = GBuffer(resources, size, 1)
        self._images = [resources.texture(size, 4, dtype="f4") for _ in range(3)]
        self._framebuffer = resources.framebuffer(self._images, resources.depth_renderbuffer(size))
        self._resolve = FramePass(resources, "passes/surface_buffers", size, SAMPLES=1)

    def draw(
        self, ctx: moderngl.Context, draw: Callable[[], None], objects: ObjectTable, floor_geom: int
    ) -> SurfaceImage:
        """Draw a surface image; the frame's uniforms, objects and height maps must be bound.

        Parameters
        ----------
        draw : callable
            Draws everything into the G-buffer.
        objects : ObjectTable
            Objects by their number in the G-buffer.
        floor_geom : int
            Geom id of the floor, or -1 without a floor.
        """
        ctx.depth_func = "<="
        self._g_buffer.use(ctx)
        self._g_buffer.clear()
        draw()
        self._g_buffer.bind()
        self._framebuffer.use()
        ctx.enable_only(moderngl.DEPTH_TEST)
        self._framebuffer.clear(depth=1.0)
        self._resolve.run(self._framebuffer, 0.0)
        width, height = self.size
        shown, smooth, rippling = (
            np.frombuffer(image.read(), np.float32).reshape(height, width, 4)[::-1]
            for image in self._images
        )
        # numbers of objects: 0 stands for no surface, the last number for the floor
        number = np.rint(smooth[..., 3]).astype(np.int32)
        floor_identity = floor_geom, int(mujoco.mjtObj.mjOBJ_GEOM)
        geoms = np.array([-1, *objects.geoms, floor_geom], dtype=np.int32)
        identities = np.array([(-1, -1), *objects.identities, floor_identity], dtype=np.int32)
        return SurfaceImage(
            depth=shown[..., 3],
            geom=geoms[number],
            identity=identities[number],
            normal=shown[..., :3],
            smooth_normal=smooth[..., :3],
            place=rippling[..., :2],
            target=np.rint(rippling[..., 2]).astype(np.int32),
            height=rippling[..., 3],
        )
