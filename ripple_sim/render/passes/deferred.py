"""Deferred shading: the G-buffer is lit, each visible surface of a pixel once, with the floor and the background."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.contract import LEVELS
from ripple_sim.render.frame_format import FrameFormat
from ripple_sim.render.g_buffer import GBuffer
from ripple_sim.render.resources import Resources
from ripple_sim.solver.errors import RippleError

from .background import Background, CoarseBackground
from .floor import Floor
from .frame_pass import FramePass
from .layers import TransparentLayers
from .screen_bounds import scissor_of
from .tiles import Tiles


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
        self._solids = FramePass(resources, "passes/deferred_fragment", size, **options, LAYER=0)
        self.layers = TransparentLayers(resources, frame_format, self._g_buffer, self.frame, options)
        self._tiles = Tiles(resources, size)
        classify = resources.program("passes/tiles_vertex", "passes/classify_fragment", **options, LAYER=0)
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
