"""The background where it is smooth: shaded once for blocks of pixels, and interpolated."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl

from ripple_sim.render.gpu.contract import Unit
from ripple_sim.render.gpu.resources import Resources

_PIXELS = 4  # along an edge of a block
_UNSURE = 0.002  # weight of a block that is not smooth from which a pixel is left out


class CoarseBackground:
    """Floor and sky at a fraction of the frame's resolution, from which the frame is filled.

    Pixels near an edge, a shadow or anything else that is not smooth are left out and marked for another pass.

    Parameters
    ----------
    resources : Resources
    size : (width, height)
        Of the frame [pixels].
    options : mapping
        Defines as for the shaders of `DeferredShading`.
    """

    def __init__(self, resources: Resources, size: tuple[int, int], options: Mapping[str, object]) -> None:
        blocks = -(-size[0] // _PIXELS), -(-size[1] // _PIXELS)
        self._texture = resources.texture(blocks, 4, dtype="f2")
        self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._texture.repeat_x = self._texture.repeat_y = False
        self._framebuffer = resources.framebuffer([self._texture])
        options = {**options, "UNSURE": _UNSURE, "SHADOW": 0, "COARSE": 1}
        shade = resources.program("glsl/view_vertex", "passes/background_fragment", **options)
        fill = resources.program("glsl/screen_vertex", "passes/background_fill_fragment", **options)
        # the last blocks extend beyond the frame
        shade["span"] = fill["span"] = blocks[0] * _PIXELS / size[0], blocks[1] * _PIXELS / size[1]
        self._shade, self._fill = resources.vertex_array(shade, []), resources.vertex_array(fill, [])

    def shade(self, ctx: moderngl.Context) -> None:
        """Shade the blocks."""
        self._framebuffer.use()
        ctx.enable_only(moderngl.NOTHING)
        self._shade.render(moderngl.TRIANGLES, vertices=3)

    def fill(self) -> None:
        """Fill the framebuffer in use where its depth permits; pixels that are left out are marked as a depth."""
        self._texture.use(Unit.COARSE_BACKGROUND)
        self._fill.render(moderngl.TRIANGLES, vertices=3)
