"""Surface images: distance, normal, geom and place on the height map of each pixel, without light."""

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
    """What is seen at the middle of each pixel, top row first.

    Attributes
    ----------
    depth : float32 [height, width]
        Distance along the camera's axis [m]; 0 where nothing is.
    geom : int32 [height, width]
        Geom id, that of the nearest geom of the body for a site; -1 where nothing is.
    identity : int32 [height, width, 2]
        Id and type, of `mujoco.mjtObj`, of what is seen; -1 where nothing is.
    normal, smooth_normal : float32 [height, width, 3]
        In the world, with ripples and without, of an open surface's outer side in the latter case.
    place : float32 [height, width, 2]
        On a target's page of charts [texels].
    target : int32 [height, width]
        Index of the target among the targets by geom id; -1: none.
    height : float32 [height, width]
        Of the ripples [m].
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
        [pixels].
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
        """Draw what `draw` draws into the G-buffer; the frame's uniforms, objects and height maps are bound already.

        `floor_geom` is the geom id of the floor, -1 without.
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
        # with nothing at 0 and the floor at the end
        number = np.rint(smooth[..., 3]).astype(np.int32)
        floor = floor_geom, int(mujoco.mjtObj.mjOBJ_GEOM)
        return SurfaceImage(
            depth=shown[..., 3],
            geom=np.array([-1, *objects.geoms, floor_geom], dtype=np.int32)[number],
            identity=np.array([(-1, -1), *objects.identities, floor], dtype=np.int32)[number],
            normal=shown[..., :3],
            smooth_normal=smooth[..., :3],
            place=rippling[..., :2],
            target=np.rint(rippling[..., 2]).astype(np.int32),
            height=rippling[..., 3],
        )
