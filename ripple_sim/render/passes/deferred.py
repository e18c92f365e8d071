"""Deferred shading: the G-buffer is lit, each visible surface of a pixel once, with the floor and the background.

The tiles of the frame in which something may show.

The reflection in the floor: the scene as a camera below the floor sees it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Balls, Pose
from ripple_sim.render.contract import LEVELS, Unit
from ripple_sim.render.resources import FrameUniforms, Resources
from ripple_sim.render.targets import FrameFormat, GBuffer
from ripple_sim.solver.errors import RippleError

from .background import Background, CoarseBackground
from .floor import Floor
from .layers import FramePass, TransparentLayers, boxes_of, scissor_of

_TILE = 32  # [pixels]


class Tiles:
    """The square tiles of the frame that any of some boxes touches, as instances for a shader.

    Parameters
    ----------
    resources : Resources
    size : (width, height)
        Of the frame [pixels].
    """

    def __init__(self, resources: Resources, size: tuple[int, int]) -> None:
        self._mask = np.zeros((-(-size[1] // _TILE), -(-size[0] // _TILE)), dtype=bool)
        self._scale = 2.0 * _TILE / np.array(size)
        self.buffer: moderngl.Buffer = resources.buffer(reserve=8 * self._mask.size, dynamic=True)
        self.count = 0

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height of a tile, where the frame extends from -1 to 1."""
        return float(self._scale[0]), float(self._scale[1])

    def cover(self, boxes: NDArray[np.int64]) -> None:
        """Select the tiles that any of some boxes [k, 4] touches; see `boxes_of`."""
        self._mask[...] = False
        for left, lower, right, upper in boxes[(boxes[:, :2] < boxes[:, 2:]).all(axis=1)]:
            self._mask[lower // _TILE : -(-upper // _TILE), left // _TILE : -(-right // _TILE)] = True
        tiles = np.argwhere(self._mask)[:, ::-1]
        self.count = len(tiles)
        if self.count:
            self.buffer.write((tiles * self._scale - 1.0).astype("f4").tobytes())


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
    layers : TransparentLayers

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
        self._g_buffer = GBuffer(resources, size, frame_format.samples)
        self.frame: moderngl.Framebuffer = resources.framebuffer(
            [resources.renderbuffer(size, 4, dtype=frame_format.dtype)], resources.depth_renderbuffer(size)
        )
        options = {
            **light_options,
            "LINEAR": int(frame_format.linear),
            "SAMPLES": self._g_buffer.samples,
            "CUT_OUT": int(frame_format.alpha),
            "TILED": int(floor is not None and floor.tiled),
            "MIRROR": int(floor is not None and floor.reflects and not frame_format.alpha),
        }
        smooth = not any(options[name] for name in ("CUT_OUT", "TILED", "MIRROR", "SKYBOX"))
        self._background = (CoarseBackground if smooth else Background)(resources, size, options, floor)
        self._solids = FramePass(resources, "passes/deferred", size, **options, LAYER=0)
        self.layers = TransparentLayers(resources, frame_format, self._g_buffer, self.frame, options)
        self._tiles = Tiles(resources, size)
        classify = resources.program("passes/classify", **options, LAYER=0, TILES=1)
        classify["level"] = 0.5  # any will do
        classify["extent"] = self._tiles.extent
        self._classify = resources.vertex_array(classify, [(self._tiles.buffer, "2f/i", "in_corner")])

    def clear(self, ctx: moderngl.Context) -> None:
        """Forget the last frame's surfaces."""
        self._g_buffer.use(ctx)
        self._g_buffer.clear()

    def begin(self, ctx: moderngl.Context) -> None:
        """Draw into the cleared G-buffer from now on."""
        ctx.depth_func = "<="
        self._g_buffer.use(ctx)

    def shade(self, ctx: moderngl.Context, boxes: NDArray[np.int64]) -> None:
        """Shade what was drawn, with the floor and the background.

        Parameters
        ----------
        ctx : moderngl.Context
        boxes : int64 [k, 4]
            Where solids may show; see `boxes_of`.
        """
        self._g_buffer.bind()
        self._tiles.cover(boxes)
        self._background.prepare(ctx)
        self.frame.use()  # clearing keeps within the scissor in use, which the reflection's frame may have left
        # every pixel gets its colour from the background, or the classification
        self.frame.color_mask = (False,) * 4
        self.frame.clear(depth=LEVELS["OPEN"])
        self.frame.color_mask = (True,) * 4
        self.frame.use()
        ctx.enable_only(moderngl.DEPTH_TEST)
        ctx.depth_func = "1"
        if self._tiles.count:
            self._classify.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=self._tiles.count)
        self._background.draw(ctx, self.frame)
        self.frame.depth_mask = False
        self._shade_solids(ctx, scissor_of(boxes))
        self.frame.depth_mask = True
        ctx.depth_func = "<="

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
        balls: Balls,
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
        balls : Balls
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
