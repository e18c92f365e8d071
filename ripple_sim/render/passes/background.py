"""The background where it is smooth: lit for blocks of pixels, and interpolated."""

from __future__ import annotations

import moderngl

from ripple_sim.render.gpu.resources import OwnedObjects
from ripple_sim.solver.gl import GLContext

_PACKAGE = "ripple_sim.render"
_UNIT = 15  # of the texture, in shaders/interpolate_fragment.glsl
_PIXELS = 4  # along an edge of a block
_UNSURE = 0.002  # weight of a block that is not smooth from which on a pixel is left out


class CoarseBackground:
    """Floor and sky in a fraction of the picture's resolution, and how to fill the picture from it.

    Pixels near an edge, a shadow or anything else that is not smooth are left out and marked: they want a pass of their
    own.

    Parameters
    ----------
    gl : GLContext
    ctx : OwnedObjects
    size : (width, height)
        Of the picture [pixels].
    options : dict
        As for the shaders of `Picture`, the depths of its levels among them.
    """

    def __init__(
        self, gl: GLContext, ctx: OwnedObjects, size: tuple[int, int], options: dict[str, int | float]
    ) -> None:
        blocks = -(-size[0] // _PIXELS), -(-size[1] // _PIXELS)
        self._texture = ctx.texture(blocks, 4, dtype="f2")
        self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._texture.repeat_x = self._texture.repeat_y = False
        self._target = ctx.framebuffer([self._texture])
        options = {**options, "UNSURE": _UNSURE, "SHADOW": 0, "COARSE": 1}
        light = ctx.own(gl.program(_PACKAGE, "glsl/view_vertex", "passes/background_fragment", **options))
        fill = ctx.own(gl.program(_PACKAGE, "glsl/screen_vertex", "passes/background_fill_fragment", **options))
        # the last blocks reach beyond the picture
        light["span"] = fill["span"] = blocks[0] * _PIXELS / size[0], blocks[1] * _PIXELS / size[1]
        self._light, self._fill = ctx.vertex_array(light, []), ctx.vertex_array(fill, [])

    def light(self, ctx: moderngl.Context) -> None:
        """Light the blocks."""
        self._target.use()
        ctx.enable_only(moderngl.NOTHING)
        self._light.render(moderngl.TRIANGLES, vertices=3)

    def fill(self) -> None:
        """Fill the framebuffer that is in use, where its depth lets it through; mark as a depth what is left out."""
        self._texture.use(_UNIT)
        self._fill.render(moderngl.TRIANGLES, vertices=3)
