"""Transparent objects, drawn and shaded one by one over the frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.contract import LEVELS, Unit
from ripple_sim.render.frame_format import FrameFormat
from ripple_sim.render.g_buffer import GBuffer
from ripple_sim.render.resources import Resources
from ripple_sim.render.textures import SRGB8_ALPHA8

from .frame_pass import FramePass
from .screen_bounds import scissor_of


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
        self._classify = FramePass(resources, "passes/classify_fragment", size, **options, LAYER=1)
        self._shade = FramePass(resources, "passes/deferred_fragment", size, **options, LAYER=1)

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
