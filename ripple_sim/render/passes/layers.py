"""Transparent objects, drawn and shaded one by one over the frame.

A pass over those pixels of a framebuffer whose depth is that of a level.

Bounding boxes in the frame.

Buffers of what each pixel shows: distance, normal, geom, and place on the height map; without light.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Balls, Pose
from ripple_sim.render.contract import LEVELS, Unit
from ripple_sim.render.resources import SRGB8_ALPHA8, Resources
from ripple_sim.render.targets import FrameFormat, GBuffer


class FramePass:
    """A fragment shader that runs over a whole framebuffer, where the depth test lets it.

    Parameters
    ----------
    resources : Resources
    name : str
        Path of the shader.
    size : (width, height)
        Of the framebuffer [pixels].
    **options
        Defines.

    Attributes
    ----------
    program : moderngl.Program
    """

    def __init__(self, resources: Resources, name: str, size: tuple[int, int], **options: object) -> None:
        with resources.gl as ctx:
            widest = min(ctx.info["GL_MAX_VIEWPORT_DIMS"])
        # The triangle over the frame lies within a viewport twice as large: where a driver clips it in two, derivatives
        # along the cut would be undefined.
        self._reach = 2 if 2 * max(size) <= widest else 1
        self.program = resources.program(name, **options, TILES=0)
        self._triangle = resources.vertex_array(self.program, [])

    def run(self, framebuffer: moderngl.Framebuffer, level: float) -> None:
        """Run over a framebuffer, at a depth."""
        width, height = framebuffer.size
        framebuffer.viewport = (0, 0, self._reach * width, self._reach * height)
        self.program["level"] = level
        self.program["reach"] = self._reach
        self._triangle.render(moderngl.TRIANGLES, vertices=3)
        framebuffer.viewport = (0, 0, width, height)


_CLOSEST = 0.01  # gap between the eye and a ball, in radii, below which it may show anywhere


def boxes_of(balls: Balls, pose: Pose, size: tuple[int, int]) -> NDArray[np.int64]:
    """Boxes in the frame about balls in the world.

    Parameters
    ----------
    balls : Balls
        k of them.
    pose : Pose
    size : (width, height)
        Of the frame [pixels].

    Returns
    -------
    int64 [k, 4]
        Left, lower, right and upper edge [pixels], counted from the lower left. Balls behind the camera have a box of
        size 0.
    """
    centres, radii = balls
    local = (centres - pose.eye) @ pose.rotation
    middle = -local[:, 2]
    near, far = middle - radii, middle + radii
    seen = near > _CLOSEST * radii
    scale = size[1] / (2 * np.tan(np.radians(pose.fovy) / 2))
    # the nearest point of the ball's box is seen under the widest angle
    corners = np.stack(
        [(local[seen, :2] + side * radii[seen, None]) / depth[seen, None] for side in (-1, 1) for depth in (near, far)]
    )
    origin = np.array(size) / 2 - scale * pose.shear
    boxes = np.tile([0, 0, *size], (len(radii), 1))
    boxes[seen, :2] = np.clip(np.floor(origin + scale * corners.min(axis=0)), 0, size)
    boxes[seen, 2:] = np.clip(np.ceil(origin + scale * corners.max(axis=0)), 0, size)
    boxes[far <= 0] = 0
    return boxes


def scissor_of(boxes: NDArray[np.int64]) -> tuple[int, int, int, int] | None:
    """Smallest scissor (left, lower, width, height) about boxes [k, 4]; None if all are empty."""
    boxes = boxes[(boxes[:, :2] < boxes[:, 2:]).all(axis=1)]
    if not len(boxes):
        return None
    left, lower = (int(edge) for edge in boxes[:, :2].min(axis=0))
    right, upper = (int(edge) for edge in boxes[:, 2:].max(axis=0))
    return left, lower, right - left, upper - lower


class TransparentLayers:
    """Adds layers to a frame, which has been shaded, and whose G-buffer still holds what is opaque.

    Parameters
    ----------
    resources : Resources
    frame_format : FrameFormat
    g_buffer : GBuffer
    frame : moderngl.Framebuffer
    options : mapping
        Defines as for the other shaders of `DeferredShading`.
    """

    def __init__(
        self,
        resources: Resources,
        frame_format: FrameFormat,
        g_buffer: GBuffer,
        frame: Any,
        options: Mapping[str, int],
    ) -> None:
        size = frame_format.size
        self._g_buffer, self._frame = g_buffer, frame
        kind = {"dtype": "f2"} if frame_format.linear else {"internal_format": SRGB8_ALPHA8}
        self._behind = resources.texture(size, 4, **kind)
        self._behind.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self._behind.repeat_x = self._behind.repeat_y = False
        self._behind_framebuffer = resources.framebuffer([self._behind])
        self._classify = FramePass(resources, "passes/classify", size, **options, LAYER=1)
        self._shade = FramePass(resources, "passes/deferred", size, **options, LAYER=1)

    def add(self, ctx: moderngl.Context, number: int, draw: Callable[[], None], boxes: NDArray[np.int64]) -> None:
        """Draw and shade a single transparent object over the frame.

        Parameters
        ----------
        ctx : moderngl.Context
        number : int
            In the table of objects.
        draw : callable
            Draws it into the G-buffer.
        boxes : int64 [k, 4]
            Where it may show; see `boxes_of`.
        """
        scissor = scissor_of(boxes)
        if scissor is None:
            return
        self._g_buffer.use(ctx)
        draw()
        frame = self._frame
        ctx.copy_framebuffer(self._behind_framebuffer, frame)
        self._behind.build_mipmaps()
        frame.use()
        ctx.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
        ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        frame.scissor = scissor
        self._behind.use(Unit.BEHIND)
        for each in (self._classify, self._shade):
            each.program["layer"] = number
        ctx.depth_func = "1"
        self._classify.run(frame, 0.0)
        ctx.depth_func = "=="
        frame.depth_mask = False
        self._shade.run(frame, LEVELS["LAYER"])
        frame.depth_mask = True
        ctx.depth_func = "<="
        frame.scissor = None
        ctx.disable(moderngl.BLEND)


class SurfaceImage(NamedTuple):
    """What is seen at the middle of each pixel, top row first.

    Attributes
    ----------
    depth : float32 [height, width]
        Distance along the camera's axis [m]; 0 where nothing is.
    geom : int32 [height, width]
        Geom id, that of the nearest geom of the body for a site; -1 where nothing is.
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
    normal: NDArray[np.float32]
    smooth_normal: NDArray[np.float32]
    place: NDArray[np.float32]
    target: NDArray[np.int32]
    height: NDArray[np.float32]


class SurfaceBuffers:
    """Draws surface images of one size.

    Parameters
    ----------
    resources : Resources
    size : (width, height)
        [pixels].
    floor_geom : int
        Geom id of the floor, -1 without.
    """

    def __init__(self, resources: Resources, size: tuple[int, int], floor_geom: int) -> None:
        self.size = size
        self._g_buffer = GBuffer(resources, size, 1)
        self._images = [resources.texture(size, 4, dtype="f4") for _ in range(3)]
        self._framebuffer = resources.framebuffer(self._images, resources.depth_renderbuffer(size))
        self._resolve = FramePass(resources, "passes/surface_buffers", size, SAMPLES=1)
        self._resolve.program["floor_geom"] = float(floor_geom)

    def draw(self, ctx: moderngl.Context, draw: Callable[[], None]) -> SurfaceImage:
        """Draw what `draw` draws into the G-buffer; the frame's uniforms, objects and height maps are bound already."""
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
            np.frombuffer(image.read(), np.float32).reshape(height, width, 4)[::-1] for image in self._images
        )
        return SurfaceImage(
            depth=shown[..., 3],
            geom=np.rint(smooth[..., 3]).astype(np.int32) - 1,
            normal=shown[..., :3],
            smooth_normal=smooth[..., :3],
            place=rippling[..., :2],
            target=np.rint(rippling[..., 2]).astype(np.int32),
            height=rippling[..., 3],
        )
