"""Deferred shading: the G-buffer is lit, each visible surface of a pixel once, with the floor and the background.

What is transparent follows layer by layer. The reflection in the floor is shaded likewise, as a camera below sees it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, cast

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Pose, boxes_of, scissor_of
from ripple_sim.render.contract import LEVELS, Unit
from ripple_sim.render.resources import SRGB8_ALPHA8, FrameUniforms, Resources
from ripple_sim.render.targets import FrameFormat, FramePass, GBuffer
from ripple_sim.solver.errors import RippleError

from .background import Background, CoarseBackground
from .floor import Floor

TILE = 32  # [pixels]


def touched_tiles(boxes: NDArray[np.int64], size: tuple[int, int]) -> NDArray[np.int64]:
    """Column and row [k, 2] of the tiles of a frame (width, height) that any of some boxes touches; see `boxes_of`."""
    touched = np.zeros((-(-size[1] // TILE), -(-size[0] // TILE)), dtype=bool)
    for left, lower, right, upper in boxes[(boxes[:, :2] < boxes[:, 2:]).all(axis=1)]:
        touched[lower // TILE : -(-upper // TILE), left // TILE : -(-right // TILE)] = True
    return np.argwhere(touched)[:, ::-1]


class DeferredShading:
    """The G-buffer, and the frame that is shaded from it.

    Triangles of a few pixels would otherwise be lit many times over, since rasterisers work in blocks. The frame's
    depth buffer holds the level of each pixel (see `contract.LEVELS`), so that a pass runs over its own pixels only.

    Parameters
    ----------
    resources : Resources
    frame_format : FrameFormat
    floor : Floor, optional
    light_options : mapping
        SKYBOX, NEAR_LIGHTS and TRANSMISSION (of transparent objects), 0 or 1: whether there are any; LIGHTS: how many
        there may be; SHADOWS: how many of them may cast shadows.

    Attributes
    ----------
    frame : moderngl.Framebuffer
        Multiplied by alpha.
    g_buffer : GBuffer
    options : dict
        Defines of the shaders that read it.

    Raises
    ------
    RippleError
        If the driver cannot make frames of this size.
    """

    def __init__(
        self, resources: Resources, frame_format: FrameFormat, floor: Floor | None, light_options: Mapping[str, int]
    ) -> None:
        size = frame_format.size
        _check_size(resources, size)
        self.g_buffer = GBuffer(resources, size, frame_format.samples)
        self.frame: moderngl.Framebuffer = resources.framebuffer(
            [resources.renderbuffer(size, 4, dtype=frame_format.dtype)], resources.depth_renderbuffer(size)
        )
        self.options = options = {
            **light_options,
            "LINEAR": int(frame_format.linear),
            "SAMPLES": self.g_buffer.samples,
            "CUT_OUT": int(frame_format.alpha),
            "TILED": int(floor is not None and floor.tiled),
            "MIRROR": int(floor is not None and floor.reflects and not frame_format.alpha),
        }
        smooth = not any(options[name] for name in ("CUT_OUT", "TILED", "MIRROR", "SKYBOX"))
        self._background = (CoarseBackground if smooth else Background)(resources, size, options, floor)
        self._solids = FramePass(resources, "passes/deferred", size, **options, LAYER=0)
        # where solids may show, square tiles are classified, as instances
        self._extent = 2.0 * TILE / np.array(size)  # of a tile, where the frame extends from -1 to 1
        most = -(-size[0] // TILE) * -(-size[1] // TILE)
        self._corners = resources.buffer(reserve=8 * most, dynamic=True)
        classify = resources.program("passes/classify", **options, LAYER=0, TILES=1)
        classify["level"] = 0.5  # any will do
        classify["extent"] = tuple(self._extent)
        self._classify = resources.vertex_array(classify, [(self._corners, "2f/i", "in_corner")])

    def clear(self, ctx: moderngl.Context) -> None:
        """Forget the last frame's surfaces."""
        self.g_buffer.use(ctx)
        self.g_buffer.clear()

    def begin(self, ctx: moderngl.Context) -> None:
        """Draw into the cleared G-buffer from now on."""
        ctx.depth_func = "<="
        self.g_buffer.use(ctx)

    def shade(self, ctx: moderngl.Context, boxes: NDArray[np.int64]) -> None:
        """Shade what was drawn, with the floor and the background.

        Parameters
        ----------
        ctx : moderngl.Context
        boxes : int64 [k, 4]
            Where solids may show; see `boxes_of`.
        """
        self.g_buffer.bind()
        self._background.prepare(ctx)
        self.frame.use()  # clearing keeps within the scissor in use, which the reflection's frame may have left
        # every pixel gets its colour from the background, or the classification
        self.frame.color_mask = (False,) * 4
        self.frame.clear(depth=LEVELS["OPEN"])
        self.frame.color_mask = (True,) * 4
        self.frame.use()
        ctx.enable_only(moderngl.DEPTH_TEST)
        ctx.depth_func = "1"
        self._classify_tiles(boxes)
        self._background.draw(ctx, self.frame)
        self.frame.depth_mask = False
        self._shade_solids(ctx, scissor_of(boxes))
        self.frame.depth_mask = True
        ctx.depth_func = "<="

    def _classify_tiles(self, boxes: NDArray[np.int64]) -> None:
        """Mark pixels by what their samples show, in the tiles that any of some boxes [k, 4] touches."""
        tiles = touched_tiles(boxes, self.frame.size)
        if len(tiles):
            self._corners.write((tiles * self._extent - 1.0).astype("f4").tobytes())
            self._classify.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=len(tiles))

    def _shade_solids(self, ctx: moderngl.Context, scissor: tuple[int, int, int, int] | None) -> None:
        """Shade pixels with solids, over the background."""
        if scissor is None:
            return
        # a software driver also takes its time over pixels that the depth test leaves out
        self.frame.scissor = scissor
        ctx.enable(moderngl.BLEND)
        ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        ctx.depth_func = ">="  # solids in some or all of the samples
        self._solids.run(self.frame, LEVELS["MIXED"])
        self.frame.scissor = (0, 0, *self.frame.size)


def _check_size(resources: Resources, size: tuple[int, int]) -> None:
    width, height = size
    with resources.gl as ctx:
        limit = int(ctx.info["GL_MAX_RENDERBUFFER_SIZE"])
    if not (1 <= width <= limit and 1 <= height <= limit):
        raise RippleError(
            f"frame size is {width}x{height} pixels; valid with this driver are 1 to {limit} along each side: choose a "
            "size within that"
        )


class TransparentLayers:
    """Adds layers to a frame, which has been shaded, and whose G-buffer still holds what is opaque.

    Parameters
    ----------
    resources : Resources
    frame_format : FrameFormat
    shading : DeferredShading
        Of the frame.
    """

    def __init__(self, resources: Resources, frame_format: FrameFormat, shading: DeferredShading) -> None:
        size = frame_format.size
        self._g_buffer, self._frame = shading.g_buffer, cast(Any, shading.frame)  # its scissor may be None
        kind = {"dtype": "f2"} if frame_format.linear else {"internal_format": SRGB8_ALPHA8}
        self._behind = resources.texture(size, 4, **kind)
        self._behind.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self._behind.repeat_x = self._behind.repeat_y = False
        self._behind_framebuffer = resources.framebuffer([self._behind])
        self._classify = FramePass(resources, "passes/classify", size, **shading.options, LAYER=1)
        self._shade = FramePass(resources, "passes/deferred", size, **shading.options, LAYER=1)

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


class Mirror:
    """The reflection, at half the frame's resolution.

    Parameters
    ----------
    resources : Resources
    frame_format : FrameFormat
        Of the frame.
    floor : Floor
    light_options : mapping
        As for `DeferredShading`.
    """

    def __init__(
        self, resources: Resources, frame_format: FrameFormat, floor: Floor, light_options: Mapping[str, int]
    ) -> None:
        self._floor, self._aspect = floor, frame_format.aspect
        width, height = frame_format.size
        half = dataclasses.replace(frame_format, size=(max(width // 2, 1), max(height // 2, 1)))
        self._size = half.size
        self._frame = FrameUniforms(resources)
        self._shading = DeferredShading(resources, half, None, light_options)
        self._image = resources.texture(half.size, 4, dtype=half.dtype)
        self._image.repeat_x = self._image.repeat_y = False
        self._framebuffer = resources.framebuffer([self._image])

    def draw(
        self,
        ctx: moderngl.Context,
        frame: FrameUniforms,
        pose: Pose,
        balls: NDArray[np.float64],
        draw_solids: Callable[[], None],
        bind_maps: Callable[[], None],
    ) -> None:
        """Draw the reflection for a frame whose uniforms are set; `frame` is bound again afterwards.

        Parameters
        ----------
        ctx : moderngl.Context
        frame : FrameUniforms
        pose : Pose
            Of the camera above the floor.
        balls : float64 [k, 4]
            That contain all solids.
        draw_solids, bind_maps : callable
            Draw the solids into the G-buffer; bind what shading needs.
        """
        self._frame.values[...] = frame.values
        floor = self._floor
        flip = np.eye(3) - 2 * np.outer(floor.normal, floor.normal)
        position = floor.origin + flip @ (pose.position - floor.origin)
        mirrored = dataclasses.replace(pose, position=position, rotation=flip @ pose.rotation)
        self._frame.set_camera(mirrored, self._aspect)
        self._frame.set_vector("floor_origin", floor.origin, 0.0)
        self._frame.bind()
        ctx.front_face = "cw"
        self._shading.clear(ctx)
        self._shading.begin(ctx)
        draw_solids()
        ctx.front_face = "ccw"
        bind_maps()
        self._shading.shade(ctx, boxes_of(balls, mirrored, self._size))
        ctx.copy_framebuffer(self._framebuffer, self._shading.frame)
        frame.bind()

    def bind(self) -> None:
        """Bind the reflection for the floor's shader."""
        self._image.use(Unit.MIRROR)
