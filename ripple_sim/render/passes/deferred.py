"""Deferred shading: the G-buffer is lit, each visible surface of a pixel once, with the floor and the background.

What is transparent follows layer by layer. The reflection in the floor is shaded likewise, as a
camera below sees it. The background is floor and sky behind the solids: where it is smooth it is
shaded at a fraction of the frame's resolution, from which the frame's tiles are filled.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, cast

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.bounds import boxes_of, scissor_of
from ripple_sim.render.contract import LEVELS, Unit
from ripple_sim.render.frame_pass import FramePass
from ripple_sim.render.frame_uniforms import FrameUniforms
from ripple_sim.render.g_buffer import GBuffer
from ripple_sim.render.pose import Pose
from ripple_sim.render.readback import FrameFormat
from ripple_sim.render.resources import Resources
from ripple_sim.render.srgb_textures import SRGB8_ALPHA8
from ripple_sim.solver.errors import RippleError

from .floor import Floor

_PIXELS = 4  # along an edge of a block, which a texel of the coarse background stands for
_BLOCKS = 8  # along an edge of a tile
# how a tile is filled: from its corners, from the blocks, or likewise but for pixels that are
# shaded one by one
_PLAIN, _SMOOTH, _ROUGH = _KINDS = range(3)

TILE = 32  # [pixels]


class Background:
    """Floor and sky, shaded pixel by pixel: first without shadows, then where one may fall.

    Parameters
    ----------
    size : (width, height)
        Of the frame [pixels].
    options : mapping
        Defines as for the shaders of `DeferredShading`.
    floor : Floor, optional
    block : int
        Edge of what each pixel of the framebuffer stands for [pixels of the frame]; the last may
        extend beyond it.
    """

    def __init__(
        self,
        resources: Resources,
        size: tuple[int, int],
        options: Mapping[str, int],
        floor: Floor | None,
        block: int = 1,
    ) -> None:
        blocks = -(-size[0] // block), -(-size[1] // block)
        self._passes = [
            FramePass(resources, "passes/background", blocks, **options, SHADOW=shadow, BLOCK=block)
            for shadow in (0, 1)
        ]
        for each in self._passes:
            each.program["span"] = tuple(
                block * pixels / of for pixels, of in zip(blocks, size, strict=True)
            )
        self._floor = floor
        self._options = options

    def prepare(self, ctx: moderngl.Context) -> None:
        """Do what needs no frame."""

    def draw(self, ctx: moderngl.Context, frame: moderngl.Framebuffer) -> None:
        """Fill the framebuffer in use, but for pixels that show solids in all of their samples."""
        self._paint_floor()
        ctx.depth_func = "<="
        self._passes[0].run(frame, 0.0)
        ctx.depth_func = "=="
        frame.depth_mask = False
        for level in ("SHADED", "MIXED"):
            self._passes[1].run(frame, LEVELS[level])
        frame.depth_mask = True

    def _paint_floor(self) -> None:
        """Set how the floor looks now."""
        floor = self._floor
        for each in self._passes:
            if floor is not None and self._options["TILED"]:
                each.program["tint"] = tuple(floor.tint)
                each.program["tiling"] = floor.tiling
            if floor is not None and self._options["MIRROR"]:
                each.program["reflectance"] = floor.reflectance


class CoarseBackground:
    """Floor and sky at a fraction of the frame's resolution, from which the frame is filled.

    Square tiles of the frame are filled as fast as each allows, which the GPU finds. Tiles that are
    plain are interpolated from their corners. In the others, pixels are interpolated from blocks,
    or shaded one by one near an edge, a narrow penumbra or anything else that is not smooth.

    Parameters as for `Background`.
    """

    def __init__(
        self,
        resources: Resources,
        size: tuple[int, int],
        options: Mapping[str, int],
        floor: Floor | None,
    ) -> None:
        blocks = -(-size[0] // _PIXELS), -(-size[1] // _PIXELS)
        self._gl = resources.gl
        self._texture = resources.clamped_texture(blocks, 4, dtype="f2")
        self._framebuffer = resources.framebuffer(
            [self._texture], resources.depth_renderbuffer(blocks)
        )
        self._blocks = Background(resources, size, options, floor, _PIXELS)
        edge = _PIXELS * _BLOCKS
        tiles = -(-size[0] // edge), -(-size[1] // edge)
        self._kinds = resources.texture(tiles, 1, dtype="u1")
        self._kinds.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._kinds_framebuffer = resources.framebuffer([self._kinds])
        self._find_kinds = resources.vertex_array(
            resources.program("passes/background_kinds", TILE=_BLOCKS), []
        )
        filling = [
            resources.program("passes/background_tiles", **options, PLAIN=plain, ROUGH=rough)
            for plain, rough in ((1, 0), (0, 0), (0, 1))
        ]
        shading = resources.program("passes/background", **options, SHADOW=1, BLOCK=1, TILES=2)
        for kind, program in zip((*_KINDS, _ROUGH), (*filling, shading), strict=True):
            program["extent"] = 2.0 * edge / size[0], 2.0 * edge / size[1]
            program["kind"] = kind
        for program in filling:
            program["blocks"] = size[0] / _PIXELS, size[1] / _PIXELS
        corners = 4 * np.arange(tiles[0] * tiles[1])[:, None] + [0, 1, 2, 2, 1, 3]
        indices = resources.buffer(corners.astype("i4").tobytes())
        *self._fill, self._shade = (
            resources.vertex_array(each, [], indices) for each in (*filling, shading)
        )

    def prepare(self, ctx: moderngl.Context) -> None:
        """Shade the blocks, and find how each tile is to be filled."""
        self._framebuffer.use()
        ctx.enable_only(moderngl.DEPTH_TEST)
        self._framebuffer.clear(depth=LEVELS["OPEN"])
        self._blocks.draw(ctx, self._framebuffer)
        self._gl.flush()
        self._texture.use(Unit.COARSE_BACKGROUND)
        self._kinds_framebuffer.use()
        ctx.enable_only(moderngl.NOTHING)
        self._find_kinds.render(moderngl.TRIANGLES, vertices=3)

    def draw(self, ctx: moderngl.Context, frame: moderngl.Framebuffer) -> None:
        """Fill the framebuffer in use, but for pixels that show solids in all of their samples."""
        self._texture.use(Unit.COARSE_BACKGROUND)
        self._kinds.use(Unit.TILE_KINDS)
        ctx.depth_func = "<="
        self._draw(self._fill[_ROUGH], 0.0)
        frame.depth_mask = False
        for kind in (_PLAIN, _SMOOTH):
            self._draw(self._fill[kind], LEVELS["MIXED"])
        ctx.depth_func = "=="
        for level in ("SHADED", "MIXED"):
            self._draw(self._shade, LEVELS[level])
        frame.depth_mask = True

    def _draw(self, tiles: moderngl.VertexArray, level: float) -> None:
        tiles.program["level"] = level
        tiles.render()


def touched_tiles(boxes: NDArray[np.int64], size: tuple[int, int]) -> NDArray[np.int64]:
    """Column and row [k, 2] of the tiles of a frame (width, height) that any of some boxes touches; see `boxes_of`."""
    touched = np.zeros((-(-size[1] // TILE), -(-size[0] // TILE)), dtype=bool)
    for left, lower, right, upper in boxes[(boxes[:, :2] < boxes[:, 2:]).all(axis=1)]:
        touched[lower // TILE : -(-upper // TILE), left // TILE : -(-right // TILE)] = True
    return np.argwhere(touched)[:, ::-1]


class DeferredShading:
    """The G-buffer, and the frame that is shaded from it.

    Triangles of a few pixels would otherwise be lit many times over, since rasterisers work in
    blocks. The frame's depth buffer holds the level of each pixel (see `contract.LEVELS`), so that
    a pass runs over its own pixels only.

    Parameters
    ----------
    floor : Floor, optional
    light_options : mapping
        SKYBOX, NEAR_LIGHTS and TRANSMISSION (of transparent objects), 0 or 1: whether there are
        any; LIGHTS: how many there may be; SHADOWS: how many of them may cast shadows.

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
        self,
        resources: Resources,
        frame_format: FrameFormat,
        floor: Floor | None,
        light_options: Mapping[str, int],
    ) -> None:
        size = width, height = frame_format.size
        with resources.gl as ctx:
            limit = int(ctx.info["GL_MAX_RENDERBUFFER_SIZE"])
        if not (1 <= width <= limit and 1 <= height <= limit):
            raise RippleError(
                f"frame size is {width}x{height} pixels; valid with this driver are 1 to {limit} "
                f"along each side: "
                "choose a size within that"
            )
        self.g_buffer = GBuffer(resources, size, frame_format.samples)
        self.frame: moderngl.Framebuffer = resources.framebuffer(
            [resources.renderbuffer(size, 4, dtype=frame_format.dtype)],
            resources.depth_renderbuffer(size),
        )
        self.options = options = {
            **light_options,
            "LINEAR": int(frame_format.linear),
            "SAMPLES": self.g_buffer.samples,
            "CUT_OUT": int(frame_format.alpha),
            "TILED": int(floor is not None and floor.tiled and not frame_format.alpha),
            "MIRROR": int(floor is not None and floor.reflects and not frame_format.alpha),
        }
        smooth = not any(options[name] for name in ("CUT_OUT", "TILED", "MIRROR", "SKYBOX"))
        self._background = (CoarseBackground if smooth else Background)(
            resources, size, options, floor
        )
        self._solids = FramePass(resources, "passes/deferred", size, **options, LAYER=0)
        # where solids may show, square tiles are classified, as instances
        # of a tile, where the frame extends from -1 to 1
        self._extent = 2.0 * TILE / np.array(size)
        self._corners = resources.buffer(
            reserve=8 * -(-size[0] // TILE) * -(-size[1] // TILE), dynamic=True
        )
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
        boxes : int64 [k, 4]
            Where solids may show; see `boxes_of`.
        """
        self.g_buffer.bind()
        self._background.prepare(ctx)
        # clearing keeps within the scissor in use, which the reflection's frame may have left
        self.frame.use()
        # every pixel gets its colour from the background, or the classification
        self.frame.color_mask = (False,) * 4
        self.frame.clear(depth=LEVELS["OPEN"])
        self.frame.color_mask = (True,) * 4
        self.frame.use()
        ctx.enable_only(moderngl.DEPTH_TEST)
        ctx.depth_func = "1"
        tiles = touched_tiles(boxes, self.frame.size)
        if len(tiles):
            self._corners.write((tiles * self._extent - 1.0).astype("f4").tobytes())
            self._classify.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=len(tiles))
        self._background.draw(ctx, self.frame)
        self.frame.depth_mask = False
        if (scissor := scissor_of(boxes)) is not None:
            # a software driver also takes its time over pixels that the depth test leaves out
            self.frame.scissor = scissor
            ctx.enable(moderngl.BLEND)
            ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
            ctx.depth_func = ">="  # solids in some or all of the samples
            self._solids.run(self.frame, LEVELS["MIXED"])
            self.frame.scissor = (0, 0, *self.frame.size)
        self.frame.depth_mask = True
        ctx.depth_func = "<="


class TransparentLayers:
    """Adds layers to a frame, which has been shaded, and whose G-buffer still holds what is opaque.

    Parameters
    ----------
    shading : DeferredShading
        Of the frame.
    """

    def __init__(
        self, resources: Resources, frame_format: FrameFormat, shading: DeferredShading
    ) -> None:
        size = frame_format.size
        # its scissor may be None
        self._g_buffer = shading.g_buffer
        self._frame = cast(Any, shading.frame)
        kind = {"dtype": "f2"} if frame_format.linear else {"internal_format": SRGB8_ALPHA8}
        self._behind = resources.clamped_texture(size, 4, mipmaps=True, **kind)
        self._behind_framebuffer = resources.framebuffer([self._behind])
        self._classify = FramePass(resources, "passes/classify", size, **shading.options, LAYER=1)
        self._shade = FramePass(resources, "passes/deferred", size, **shading.options, LAYER=1)

    def add(
        self, ctx: moderngl.Context, number: int, draw: Callable[[], None], boxes: NDArray[np.int64]
    ) -> None:
        """Draw and shade a single transparent object over the frame.

        Parameters
        ----------
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
    frame_format : FrameFormat
        Of the frame.
    light_options : mapping
        As for `DeferredShading`.
    """

    def __init__(
        self,
        resources: Resources,
        frame_format: FrameFormat,
        floor: Floor,
        light_options: Mapping[str, int],
    ) -> None:
        self._floor = floor
        self._aspect = frame_format.aspect
        self._backdrop = bool(light_options["BACKDROP"])
        width, height = frame_format.size
        half = dataclasses.replace(frame_format, size=(max(width // 2, 1), max(height // 2, 1)))
        self._size = half.size
        self._frame = FrameUniforms(resources)
        self._shading = DeferredShading(resources, half, None, light_options)
        self._image = resources.clamped_texture(half.size, 4, dtype=half.dtype)
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
        self._frame.set_camera(mirrored, self._aspect, balls)
        self._frame.set_vector("floor_origin", floor.origin, 0.0)
        if not self._backdrop:  # as in MuJoCo only solids are reflected
            for name in ("fog", "haze", "shown_far"):
                self._frame.set_vector(name, [0.0, 1.0, 0.0])
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

    def hide(self) -> None:
        """Show no reflection in the coming frames."""
        self._framebuffer.clear()

    def bind(self) -> None:
        """Bind the reflection for the floor's shader."""
        self._image.use(Unit.MIRROR)
