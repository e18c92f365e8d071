"""What is drawn into: the samples of the visible surfaces, and the picture that is composed from them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.gpu.color import SRGB8_ALPHA8
from ripple_sim.render.gpu.resources import OwnedObjects
from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.gl import GLContext

from .background import CoarseBackground
from .floor import Floor
from .screen_bounds import Tiles

_PACKAGE = "ripple_sim.render"
_FIRST_UNIT = 8  # of the samples' textures, in shaders/samples.glsl
_BEHIND_UNIT = 6
# depths that stand for what a pixel shows: background out of reach of the shadow or within it, solids in some of its
# samples or in all of them, an object of a layer; exact in every depth buffer
_LEVELS = {"OPEN": 1.0, "SHADED": 0.75, "MIXED": 0.5, "SOLID": 0.25, "LAYER": 0.125}


class Picture:
    """The frame on the GPU.

    Surfaces are first drawn as samples of depth, normals and colours; then each surface that shows in a pixel
    is lit once. Triangles of a few pixels would otherwise be lit many times over, since rasterisers work in blocks.

    Parameters
    ----------
    gl : GLContext
    ctx : OwnedObjects
    size : (width, height)
        [pixels].
    samples : int
        A pixel; at most what the driver has.
    cut_out : bool
        Whether the background stays transparent and the floor shows nothing but shadows.
    floor : Floor, optional
    options : dict
        SKYBOX and NEAR_LAMPS, 0 or 1: whether the light knows them; LINEAR, 0 or 1: whether the frame is linear light;
        SHADOWS: how many lamps may cast them.

    Attributes
    ----------
    frame : moderngl.Framebuffer
        The composed picture, multiplied by alpha.
    dtype : str
        Of its channels, in moderngl's words.

    Raises
    ------
    RippleError
        If the driver cannot make pictures of this size.
    """

    def __init__(
        self,
        gl: GLContext,
        ctx: OwnedObjects,
        size: tuple[int, int],
        *,
        samples: int,
        cut_out: bool,
        floor: Floor | None,
        options: dict[str, int],
    ) -> None:
        width, height = size
        with gl as raw:
            limit = int(raw.info["GL_MAX_RENDERBUFFER_SIZE"])
            widest = min(raw.info["GL_MAX_VIEWPORT_DIMS"])
            samples = min(samples, raw.max_samples)
        if not (1 <= width <= limit and 1 <= height <= limit):
            raise RippleError(
                f"frame size is {width}x{height} pixels; this driver makes 1 to {limit} along each side: "
                "choose a size within that"
            )
        many = samples if samples > 1 else 0
        depth = ctx.depth_texture(size, samples=many)
        if not many:
            depth.compare_func = ""
        layers = [ctx.texture(size, 4, samples=many, dtype="nu2") for _ in range(2)]
        if not many:
            for layer in (depth, *layers):
                layer.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._layers = [depth, *layers]
        self._samples = ctx.framebuffer(layers, depth)
        self.dtype = "f2" if options["LINEAR"] else "f1"
        self.frame = ctx.framebuffer([ctx.renderbuffer(size, 4, dtype=self.dtype)], ctx.depth_renderbuffer(size))
        linear_light = {"dtype": "f2"} if options["LINEAR"] else {"internal_format": SRGB8_ALPHA8}
        self._behind = ctx.texture(size, 4, **linear_light)
        self._behind.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self._behind.repeat_x = self._behind.repeat_y = False
        self._behind_frame = ctx.framebuffer([self._behind])
        self._cut_out = cut_out
        self._reach = 2 if 2 * max(size) <= widest else 1
        tiled = floor is not None and floor.tiled
        reflects = floor is not None and floor.reflectance > 0.0 and not cut_out
        options = {
            **options,
            "SAMPLES": max(many, 1),
            "CUT_OUT": int(cut_out),
            "IMAGE": int(tiled),
            "MIRROR": int(reflects),
        }
        levels = {f"{name}_LEVEL": level for name, level in _LEVELS.items()}
        smooth = not (cut_out or tiled or reflects or options["SKYBOX"])
        self._coarse = CoarseBackground(gl, ctx, size, {**options, **levels}) if smooth else None
        stages: tuple[tuple[str, str, str, dict[str, Any]], ...] = (
            ("background", "glsl/view_vertex", "passes/background_fragment", {"SHADOW": 0, "COARSE": 0, **levels}),
            ("shaded background", "glsl/view_vertex", "passes/background_fragment", {"SHADOW": 1, "COARSE": 0}),
            ("solid", "glsl/view_vertex", "passes/deferred_fragment", {"LAYER": 0}),
            ("layer classes", "glsl/view_vertex", "passes/classify_fragment", {"LAYER": 1, **levels}),
            ("layer", "glsl/view_vertex", "passes/deferred_fragment", {"LAYER": 1}),
        )
        self._passes = {
            name: ctx.vertex_array(ctx.own(gl.program(_PACKAGE, vertex, fragment, **{**options, **more})), [])
            for name, vertex, fragment, more in stages
        }
        for program in (self._passes[name].program for name in ("background", "shaded background")):
            if floor is not None and tiled:
                program["tint"] = tuple(floor.tint)
                program["tiling"] = floor.tiling
            if floor is not None and reflects:
                program["reflectance"] = floor.reflectance
        self._tiles = Tiles(ctx, size)
        classify = ctx.own(
            gl.program(_PACKAGE, "passes/tiles_vertex", "passes/classify_fragment", LAYER=0, **{**options, **levels})
        )
        classify["extent"] = self._tiles.extent
        self._classify = ctx.vertex_array(classify, [(self._tiles.buffer, "2f/i", "in_corner")])

    def begin(self, ctx: moderngl.Context) -> None:
        """Clear the samples and draw into them from now on."""
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        ctx.depth_func = "<="
        self._samples.use()
        # the colours of samples without a surface are never read
        self._samples.color_mask = [(False,) * 4] * 2
        self._samples.clear(depth=1.0)
        self._samples.color_mask = [(True,) * 4] * 2

    def compose(self, ctx: moderngl.Context, boxes: NDArray[np.int64]) -> None:
        """Light what was drawn, with the floor and the background.

        Parameters
        ----------
        ctx : moderngl.Context
        boxes : int64 [k, 4]
            Where solids may show; see `boxes_of`.
        """
        for unit, layer in enumerate(self._layers, start=_FIRST_UNIT):
            layer.use(unit)
        self._tiles.cover(boxes)
        if self._coarse is not None:
            self._coarse.light(ctx)
        self.frame.use()
        ctx.enable_only(moderngl.DEPTH_TEST)
        ctx.depth_func = "1"
        self.frame.clear(depth=_LEVELS["OPEN"])
        if self._tiles.count:
            self._classify.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=self._tiles.count)
        ctx.depth_func = "<="
        if self._coarse is None:
            self._run("background", 0.0)
        else:
            self._coarse.fill()
        ctx.depth_func = "=="
        self.frame.depth_mask = False
        self._run("shaded background", _LEVELS["SHADED"])
        self._run("shaded background", _LEVELS["MIXED"])
        self._run("solid", _LEVELS["SOLID"])
        ctx.enable(moderngl.BLEND)
        ctx.blend_func = moderngl.ONE, moderngl.ONE
        self._run("solid", _LEVELS["MIXED"])
        self.frame.depth_mask = True
        ctx.depth_func = "<="

    def _run(self, name: str, level: float) -> None:
        """Run a pass over the pixels of a level."""
        width, height = self.frame.size
        # The triangle over the frame lies within a viewport twice as large: where a driver clips it in two, the pixels
        # along the cut would know nothing of their neighbours in the other half.
        self.frame.viewport = (0, 0, self._reach * width, self._reach * height)
        self._passes[name].program["level"] = level
        self._passes[name].program["reach"] = self._reach
        self._passes[name].render(moderngl.TRIANGLES, vertices=3)
        self.frame.viewport = (0, 0, width, height)

    def add_layer(self, ctx: moderngl.Context, number: int, draw: Callable[[], None], boxes: NDArray[np.int64]) -> None:
        """Draw and light a single clear object over the picture.

        Parameters
        ----------
        ctx : moderngl.Context
        number : int
            In the table of objects.
        draw : callable
            Draws it into the samples.
        boxes : int64 [k, 4]
            Where it may show; see `boxes_of`.
        """
        boxes = boxes[(boxes[:, :2] < boxes[:, 2:]).all(axis=1)]
        if not len(boxes):
            return
        left, lower = (int(edge) for edge in boxes[:, :2].min(axis=0))
        right, upper = (int(edge) for edge in boxes[:, 2:].max(axis=0))
        self._samples.use()
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        draw()
        ctx.copy_framebuffer(self._behind_frame, self.frame)
        self._behind.build_mipmaps()
        self.frame.use()
        ctx.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
        ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self.frame.scissor = left, lower, right - left, upper - lower
        self._behind.use(_BEHIND_UNIT)
        for each in ("layer classes", "layer"):
            self._passes[each].program["layer"] = number
        ctx.depth_func = "1"
        self._run("layer classes", 0.0)
        ctx.depth_func = "=="
        self.frame.depth_mask = False
        self._run("layer", _LEVELS["LAYER"])
        self.frame.depth_mask = True
        ctx.depth_func = "<="
        self.frame.scissor = None
        ctx.disable(moderngl.BLEND)
