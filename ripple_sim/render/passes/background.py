"""The background: floor and sky behind the solids.

The tiles of a frame that a coarse background fills.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

import moderngl
import numpy as np

from ripple_sim.render.contract import LEVELS, BackgroundTiles, Unit
from ripple_sim.render.resources import Resources

from .floor import Floor
from .layers import FramePass

_BLOCKS = 8  # along an edge of a tile
_GROUP = 64


class Kind(IntEnum):
    """How a tile is filled."""

    PLAIN = 0  # interpolated from its corners
    SMOOTH = 1  # interpolated from the blocks
    ROUGH = 2  # likewise, and shaded where that is not smooth


class SortedTiles:
    """Square tiles of the frame, sorted on the GPU, each to be filled as fast as it allows.

    Parameters
    ----------
    resources : Resources
    size : (width, height)
        Of the frame [pixels].
    block : int
        Edge of what a texel of the coarse background stands for [pixels].
    options : mapping
        Defines as for the shaders of `DeferredShading`.
    """

    def __init__(self, resources: Resources, size: tuple[int, int], block: int, options: Mapping[str, int]) -> None:
        edge = block * _BLOCKS
        tiles = -(-size[0] // edge), -(-size[1] // edge)
        self._groups = -(-tiles[0] * tiles[1] // _GROUP)
        self._corners = resources.buffer(reserve=8 * len(Kind) * tiles[0] * tiles[1])
        self._empty = np.array([[4, 0, 0, kind * tiles[0] * tiles[1], 0] for kind in Kind], dtype=np.uint32).tobytes()
        self._commands = resources.buffer(self._empty)
        self._sort = resources.compute_shader("passes/background_tiles", TILE=_BLOCKS, GROUP=_GROUP)
        self._sort["tiles"] = tiles
        plain, smooth, rough = (
            resources.program(
                "passes/background_tiles", **options, PLAIN=int(kind == Kind.PLAIN), ROUGH=int(kind == Kind.ROUGH)
            )
            for kind in Kind
        )
        shade = resources.program("passes/background", **options, SHADOW=1, BLOCK=1, TILES=1)
        extent = 2.0 * edge / size[0], 2.0 * edge / size[1]
        self._sort["extent"] = extent
        for program in (plain, smooth, rough, shade):
            program["extent"] = extent
        for program in (plain, smooth, rough):
            program["blocks"] = size[0] / block, size[1] / block
        self._plain, self._smooth, self._rough, self._shade = (
            resources.vertex_array(program, [(self._corners, "2f/i", "in_corner")])
            for program in (plain, smooth, rough, shade)
        )

    def sort(self, ctx: moderngl.Context) -> None:
        """Sort the tiles by the coarse background that is bound."""
        self._commands.write(self._empty)
        self._corners.bind_to_storage_buffer(BackgroundTiles.TILES)
        self._commands.bind_to_storage_buffer(BackgroundTiles.COMMANDS)
        self._sort.run(self._groups)
        ctx.memory_barrier()

    def fill(self, ctx: moderngl.Context, frame: moderngl.Framebuffer) -> None:
        """Fill the framebuffer in use from the coarse background that is bound."""
        ctx.depth_func = "<="
        self._draw(self._rough, Kind.ROUGH, 0.0)
        frame.depth_mask = False
        self._draw(self._plain, Kind.PLAIN, LEVELS["MIXED"])
        self._draw(self._smooth, Kind.SMOOTH, LEVELS["MIXED"])
        ctx.depth_func = "=="
        for level in ("SHADED", "MIXED"):
            self._draw(self._shade, Kind.ROUGH, LEVELS[level])
        frame.depth_mask = True

    def _draw(self, tiles: moderngl.VertexArray, kind: Kind, level: float) -> None:
        tiles.program["level"] = level
        tiles.render_indirect(self._commands, moderngl.TRIANGLE_STRIP, count=1, first=kind)


_PIXELS = 4  # along an edge of a block


class Background:
    """Floor and sky, shaded pixel by pixel: first without shadows, then where one may fall.

    Parameters
    ----------
    resources : Resources
    size : (width, height)
        Of the frame [pixels].
    options : mapping
        Defines as for the shaders of `DeferredShading`.
    floor : Floor, optional
    block : int
        Edge of what each pixel of the framebuffer stands for [pixels of the frame]; the last may extend beyond it.
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
            each.program["span"] = tuple(block * pixels / of for pixels, of in zip(blocks, size, strict=True))
            if floor is not None and options["TILED"]:
                each.program["tint"] = tuple(floor.tint)
                each.program["tiling"] = floor.tiling
            if floor is not None and options["MIRROR"]:
                each.program["reflectance"] = floor.reflectance

    def prepare(self, ctx: moderngl.Context) -> None:
        """Do what needs no frame."""

    def draw(self, ctx: moderngl.Context, frame: moderngl.Framebuffer) -> None:
        """Fill the framebuffer in use, but for pixels that show solids in all of their samples."""
        ctx.depth_func = "<="
        self._passes[0].run(frame, 0.0)
        ctx.depth_func = "=="
        frame.depth_mask = False
        for level in ("SHADED", "MIXED"):
            self._passes[1].run(frame, LEVELS[level])
        frame.depth_mask = True


class CoarseBackground:
    """Floor and sky at a fraction of the frame's resolution, from which the frame is filled.

    Tiles that are plain are interpolated from their corners. In the others, pixels are interpolated from blocks, or
    shaded one by one near an edge, a narrow penumbra or anything else that is not smooth.

    Parameters as for `Background`.
    """

    def __init__(
        self, resources: Resources, size: tuple[int, int], options: Mapping[str, int], floor: Floor | None
    ) -> None:
        blocks = -(-size[0] // _PIXELS), -(-size[1] // _PIXELS)
        self._texture = resources.texture(blocks, 4, dtype="f2")
        self._texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._texture.repeat_x = self._texture.repeat_y = False
        self._framebuffer = resources.framebuffer([self._texture], resources.depth_renderbuffer(blocks))
        self._blocks = Background(resources, size, options, floor, _PIXELS)
        self._tiles = SortedTiles(resources, size, _PIXELS, options)

    def prepare(self, ctx: moderngl.Context) -> None:
        """Shade the blocks, and sort the tiles."""
        self._framebuffer.use()
        ctx.enable_only(moderngl.DEPTH_TEST)
        self._framebuffer.clear(depth=LEVELS["OPEN"])
        self._blocks.draw(ctx, self._framebuffer)
        self._texture.use(Unit.COARSE_BACKGROUND)
        self._tiles.sort(ctx)

    def draw(self, ctx: moderngl.Context, frame: moderngl.Framebuffer) -> None:
        """Fill the framebuffer in use, but for pixels that show solids in all of their samples."""
        self._texture.use(Unit.COARSE_BACKGROUND)
        self._tiles.fill(ctx, frame)
