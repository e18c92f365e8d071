"""Deferred shading: the G-buffer is lit, and the frame gets floor, sky and transparent layers.

Each visible surface of a pixel is lit once. Transparent objects follow layer by layer. The
reflection in the floor is shaded in the same way, from a mirrored camera below the floor. The
background is the floor and the sky behind the solids. Where the background is smooth, it is shaded
at a fraction of the frame's resolution, and the frame's tiles are filled from it.
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

# Edge of a tile of the frame in which solids may show [pixels].
TILE = 32

# Edge of a block, which a texel of the coarse background stands for [pixels].
_PIXELS_PER_BLOCK = 4

# Edge of a tile of the coarse background [blocks].
_BLOCKS_PER_TILE = 8

# Ways to fill a tile of the background; the same numbers in background_kinds.glsl.
_PLAIN = 0  # from the tile's corners
_SMOOTH = 1  # from the blocks
_ROUGH = 2  # from the blocks, except for pixels that are shaded one by one


class Background:
    """Floor and sky, shaded pixel by pixel: first without shadows, then where one may fall.

    Parameters
    ----------
    size : (width, height)
        Size of the frame [pixels].
    options : mapping
        Defines as for the shaders of `DeferredShading`.
    floor : Floor, optional
    block : int
        Edge of the block of the frame that each pixel of the framebuffer stands for [pixels of the
        frame]; the last block may extend beyond the frame.
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
        self._without_shadows, self._with_shadows = (
            FramePass(resources, "passes/background", blocks, **options, SHADOW=shadow, BLOCK=block)
            for shadow in (0, 1)
        )
        # size of the framebuffer's area in frames
        span = block * blocks[0] / size[0], block * blocks[1] / size[1]
        for frame_pass in (self._without_shadows, self._with_shadows):
            frame_pass.program["span"] = span
        self._floor = floor
        self._options = options

    def prepare(self, ctx: moderngl.Context) -> None:
        """Do nothing: every pixel is shaded in `draw`."""

    def draw(self, ctx: moderngl.Context, frame: moderngl.Framebuffer) -> None:
        """Fill the framebuffer in use, except pixels with solids in all of their samples."""
        self._paint_floor()
        ctx.depth_func = "<="
        self._without_shadows.run(frame, 0.0)
        ctx.depth_func = "=="
        frame.depth_mask = False
        for level in ("SHADED", "MIXED"):
            self._with_shadows.run(frame, LEVELS[level])
        frame.depth_mask = True

    def _paint_floor(self) -> None:
        """Set the floor's colours and reflectance, which a scene may change."""
        floor = self._floor
        if floor is None:
            return
        for frame_pass in (self._without_shadows, self._with_shadows):
            program = frame_pass.program
            if self._options["TILED"]:
                program["tint"] = tuple(floor.tint)
                program["tiling"] = floor.tiling
            if self._options["MIRROR"]:
                program["reflectance"] = floor.reflectance


class CoarseBackground:
    """Floor and sky at a fraction of the frame's resolution, from which the frame is filled.

    The GPU chooses for each square tile of the frame the fastest way to fill it. Plain tiles are
    interpolated from their corners. In the other tiles, pixels are interpolated from blocks, or
    shaded one by one near an edge, a narrow penumbra or anything else that is not smooth.

    Parameters as for `Background`.
    """

    def __init__(
        self,
        resources: Resources,
        size: tuple[int, int],
        options: Mapping[str, int],
        floor: Floor | None,
    ) -> None:
        self._gl = resources.gl
        self._blocks = Background(resources, size, options, floor, _PIXELS_PER_BLOCK)
        blocks = -(-size[0] // _PIXELS_PER_BLOCK), -(-size[1] // _PIXELS_PER_BLOCK)
        self._texture = resources.clamped_texture(blocks, 4, dtype="f2")
        self._framebuffer = resources.framebuffer(
            [self._texture], resources.depth_renderbuffer(blocks)
        )
        edge = _PIXELS_PER_BLOCK * _BLOCKS_PER_TILE
        tiles = -(-size[0] // edge), -(-size[1] // edge)
        self._kinds = resources.texture(tiles, 1, dtype="u1")
        self._kinds.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._kinds_framebuffer = resources.framebuffer([self._kinds])
        self._find_kinds = resources.vertex_array(
            resources.program("passes/background_kinds", TILE=_BLOCKS_PER_TILE), []
        )
        # two triangles a tile, whose corners the vertex shader places
        corners = 4 * np.arange(tiles[0] * tiles[1])[:, None] + [0, 1, 2, 2, 1, 3]
        indices = resources.buffer(corners.astype("i4").tobytes())
        extent = 2.0 * edge / size[0], 2.0 * edge / size[1]  # of a tile, in clip coordinates
        # draws that fill tiles, by kind
        self._fill: dict[int, moderngl.VertexArray] = {}
        for kind in (_PLAIN, _SMOOTH, _ROUGH):
            program = resources.program(
                "passes/background_tiles",
                **options,
                PLAIN=int(kind == _PLAIN),
                ROUGH=int(kind == _ROUGH),
            )
            program["extent"] = extent
            program["kind"] = kind
            program["blocks"] = size[0] / _PIXELS_PER_BLOCK, size[1] / _PIXELS_PER_BLOCK
            self._fill[kind] = resources.vertex_array(program, [], indices)
        # the draw that shades pixels of rough tiles one by one
        program = resources.program("passes/background", **options, SHADOW=1, BLOCK=1, TILES=2)
        program["extent"] = extent
        program["kind"] = _ROUGH
        self._shade = resources.vertex_array(program, [], indices)

    def prepare(self, ctx: moderngl.Context) -> None:
        """Shade the blocks, and choose how to fill each tile."""
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
        """Fill the framebuffer in use, except pixels with solids in all of their samples."""
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
    """Tiles of a frame (width, height) that boxes touch: columns and rows, shape [k, 2].

    For `boxes` see `boxes_of`.
    """
    columns = -(-size[0] // TILE)
    rows = -(-size[1] // TILE)
    touched = np.zeros((rows, columns), dtype=bool)
    has_area = (boxes[:, :2] < boxes[:, 2:]).all(axis=1)
    for left, lower, right, upper in boxes[has_area]:
        touched_rows = slice(lower // TILE, -(-upper // TILE))
        touched_columns = slice(left // TILE, -(-right // TILE))
        touched[touched_rows, touched_columns] = True
    return np.argwhere(touched)[:, ::-1]


class DeferredShading:
    """The G-buffer, and the frame that is shaded from it.

    Rasterisers work in blocks, so triangles of a few pixels would be lit many times over without a
    G-buffer. The frame's depth buffer holds the level of each pixel (see `contract.LEVELS`), so
    that a pass runs over its own pixels only.

    Parameters
    ----------
    floor : Floor, optional
    light_options : mapping
        SKYBOX, NEAR_LIGHTS and TRANSMISSION, 0 or 1: whether there is a skybox, a near light and a
        transparent object; LIGHTS: greatest number of lights; SHADOWS: greatest number of lights
        that cast shadows.

    Attributes
    ----------
    frame : moderngl.Framebuffer
        The shaded frame, multiplied by alpha.
    g_buffer : GBuffer
    options : dict
        Defines of the shaders that read the G-buffer.

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
        size = frame_format.size
        self._check_size(resources, size)
        self.g_buffer = GBuffer(resources, size, frame_format.samples)
        self.frame: moderngl.Framebuffer = resources.framebuffer(
            [resources.renderbuffer(size, 4, dtype=frame_format.dtype)],
            resources.depth_renderbuffer(size),
        )
        floor_shown = None if frame_format.alpha else floor
        options = {
            **light_options,
            "LINEAR": int(frame_format.linear),
            "SAMPLES": self.g_buffer.samples,
            "CUT_OUT": int(frame_format.alpha),
            "TILED": int(floor_shown is not None and floor_shown.tiled),
            "MIRROR": int(floor_shown is not None and floor_shown.reflects),
        }
        self.options = options
        is_smooth = not any(options[name] for name in ("CUT_OUT", "TILED", "MIRROR", "SKYBOX"))
        background = CoarseBackground if is_smooth else Background
        self._background = background(resources, size, options, floor)
        self._solids = FramePass(resources, "passes/deferred", size, **options, LAYER=0)
        # Tiles in which solids may show are classified: instances of a square.
        self._extent = 2.0 * TILE / np.array(size)  # of a tile, in clip coordinates
        tile_count = -(-size[0] // TILE) * -(-size[1] // TILE)
        self._corners = resources.buffer(reserve=8 * tile_count, dynamic=True)
        classify = resources.program("passes/classify", **options, LAYER=0, TILES=1)
        classify["level"] = 0.5  # has no effect: the shader writes the depth
        classify["extent"] = tuple(self._extent)
        self._classify = resources.vertex_array(classify, [(self._corners, "2f/i", "in_corner")])

    @staticmethod
    def _check_size(resources: Resources, size: tuple[int, int]) -> None:
        """Raise `RippleError` if the driver cannot make frames of a size (width, height)."""
        width, height = size
        with resources.gl as ctx:
            limit = int(ctx.info["GL_MAX_RENDERBUFFER_SIZE"])
        if not (1 <= width <= limit and 1 <= height <= limit):
            raise RippleError(
                f"frame size must be 1 to {limit} pixels along each side with this driver, got "
                f"{width}x{height}"
            )

    def clear(self, ctx: moderngl.Context) -> None:
        """Forget the last frame's surfaces."""
        self.g_buffer.use(ctx)
        self.g_buffer.clear()

    def begin(self, ctx: moderngl.Context) -> None:
        """Draw into the cleared G-buffer from now on."""
        ctx.depth_func = "<="
        self.g_buffer.use(ctx)

    def shade(self, ctx: moderngl.Context, boxes: NDArray[np.int64]) -> None:
        """Shade the surfaces in the G-buffer, with the floor and the background.

        Parameters
        ----------
        boxes : int64 [k, 4]
            Boxes in the frame in which solids may show; see `boxes_of`.
        """
        self.g_buffer.bind()
        self._background.prepare(ctx)
        self._clear_levels()
        self._classify_tiles(ctx, boxes)
        self._background.draw(ctx, self.frame)
        self.frame.depth_mask = False
        self._shade_solids(ctx, boxes)
        self.frame.depth_mask = True
        ctx.depth_func = "<="

    def _clear_levels(self) -> None:
        """Set the level of all pixels to OPEN."""
        # clearing keeps within the scissor in use, which the reflection's frame may have left
        self.frame.use()
        # every pixel gets its colour from the background, or from the classification
        self.frame.color_mask = (False,) * 4
        self.frame.clear(depth=LEVELS["OPEN"])
        self.frame.color_mask = (True,) * 4

    def _classify_tiles(self, ctx: moderngl.Context, boxes: NDArray[np.int64]) -> None:
        """Set the levels of the pixels in all tiles in which solids may show."""
        self.frame.use()
        ctx.enable_only(moderngl.DEPTH_TEST)
        ctx.depth_func = "1"
        tiles = touched_tiles(boxes, self.frame.size)
        if len(tiles):
            self._corners.write((tiles * self._extent - 1.0).astype("f4").tobytes())
            self._classify.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=len(tiles))

    def _shade_solids(self, ctx: moderngl.Context, boxes: NDArray[np.int64]) -> None:
        """Shade the pixels with solids in some or all of the samples."""
        scissor = scissor_of(boxes)
        if scissor is None:
            return
        # the scissor saves time: a software driver is slow for pixels that fail the depth test too
        self.frame.scissor = scissor
        ctx.enable(moderngl.BLEND)
        ctx.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        ctx.depth_func = ">="
        self._solids.run(self.frame, LEVELS["MIXED"])
        self.frame.scissor = (0, 0, *self.frame.size)


class TransparentLayers:
    """Adds transparent objects, layer by layer, to a frame that has been shaded.

    The G-buffer of the frame must still hold the opaque surfaces.

    Parameters
    ----------
    shading : DeferredShading
        Shading of the frame.
    """

    def __init__(
        self, resources: Resources, frame_format: FrameFormat, shading: DeferredShading
    ) -> None:
        size = frame_format.size
        self._g_buffer = shading.g_buffer
        # moderngl's hints say that a scissor cannot be None, but it can
        self._frame = cast(Any, shading.frame)
        texel_type = {"dtype": "f2"} if frame_format.linear else {"internal_format": SRGB8_ALPHA8}
        self._behind = resources.clamped_texture(size, 4, mipmaps=True, **texel_type)
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
            Number of the object in the table of objects.
        draw : callable
            Draws the object into the G-buffer.
        boxes : int64 [k, 4]
            Boxes in the frame in which the object may show; see `boxes_of`.
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
        for frame_pass in (self._classify, self._shade):
            frame_pass.program["layer"] = number
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
    """The reflection in the floor, at half the frame's resolution.

    Parameters
    ----------
    frame_format : FrameFormat
        Format of the frame.
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
        self._size = max(width // 2, 1), max(height // 2, 1)
        half_format = dataclasses.replace(frame_format, size=self._size)
        self._frame = FrameUniforms(resources)
        self._shading = DeferredShading(resources, half_format, None, light_options)
        self._image = resources.clamped_texture(self._size, 4, dtype=half_format.dtype)
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
        """Draw the reflection for a frame whose uniforms are set.

        Parameters
        ----------
        frame : FrameUniforms
            Uniforms of the frame; they are bound again afterwards.
        pose : Pose
            Pose of the camera above the floor.
        balls : float64 [k, 4]
            Balls that contain all solids.
        draw_solids : callable
            Draws the solids into the G-buffer.
        bind_maps : callable
            Binds the maps that shading looks up.
        """
        self._frame.values[...] = frame.values
        floor = self._floor
        flip = np.eye(3) - 2 * np.outer(floor.normal, floor.normal)
        position = floor.origin + flip @ (pose.position - floor.origin)
        mirrored = dataclasses.replace(pose, position=position, rotation=flip @ pose.rotation)
        self._frame.set_camera(mirrored, self._aspect, balls)
        self._frame.set_vector("floor_origin", floor.origin, 0.0)
        if not self._backdrop:  # as in MuJoCo, only solids are reflected
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
