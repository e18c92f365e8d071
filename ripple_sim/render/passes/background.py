"""The background: floor and sky behind the solids.

Where it is smooth it is shaded at a fraction of the frame's resolution, from which the frame's tiles are filled.
"""

from __future__ import annotations

from collections.abc import Mapping

import moderngl
import numpy as np

from ripple_sim.render.contract import LEVELS, Binding, Unit
from ripple_sim.render.resources import Resources
from ripple_sim.render.targets import FramePass

from .floor import Floor

_PIXELS = 4  # along an edge of a block, which a texel of the coarse background stands for
_BLOCKS = 8  # along an edge of a tile
_GROUP = 64  # tiles that a work group sorts
# how a tile is filled: from its corners, from the blocks, or likewise but for pixels that are shaded one by one
_PLAIN, _SMOOTH, _ROUGH = _KINDS = range(3)


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

    Square tiles of the frame are sorted on the GPU, each to be filled as fast as it allows. Tiles that are plain are
    interpolated from their corners. In the others, pixels are interpolated from blocks, or shaded one by one near an
    edge, a narrow penumbra or anything else that is not smooth.

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
        edge = _PIXELS * _BLOCKS
        tiles = -(-size[0] // edge), -(-size[1] // edge)
        count = tiles[0] * tiles[1]
        self._groups = -(-count // _GROUP)
        self._corners = resources.buffer(reserve=8 * len(_KINDS) * count)
        # indirect draw calls: vertices, instances, first vertex, first instance; and a number of padding
        self._empty = np.array([[4, 0, 0, kind * count, 0] for kind in _KINDS], dtype=np.uint32).tobytes()
        self._commands = resources.buffer(self._empty)
        self._sort = resources.compute_shader("passes/background_tiles", TILE=_BLOCKS, GROUP=_GROUP)
        self._sort["tiles"] = tiles
        filling = [
            resources.program("passes/background_tiles", **options, PLAIN=plain, ROUGH=rough)
            for plain, rough in ((1, 0), (0, 0), (0, 1))
        ]
        shading = resources.program("passes/background", **options, SHADOW=1, BLOCK=1, TILES=1)
        self._sort["extent"] = extent = 2.0 * edge / size[0], 2.0 * edge / size[1]
        for program in (*filling, shading):
            program["extent"] = extent
        for program in filling:
            program["blocks"] = size[0] / _PIXELS, size[1] / _PIXELS
        *self._fill, self._shade = (
            resources.vertex_array(program, [(self._corners, "2f/i", "in_corner")]) for program in (*filling, shading)
        )

    def prepare(self, ctx: moderngl.Context) -> None:
        """Shade the blocks, and sort the tiles."""
        self._framebuffer.use()
        ctx.enable_only(moderngl.DEPTH_TEST)
        self._framebuffer.clear(depth=LEVELS["OPEN"])
        self._blocks.draw(ctx, self._framebuffer)
        self._texture.use(Unit.COARSE_BACKGROUND)
        self._commands.write(self._empty)
        self._corners.bind_to_storage_buffer(Binding.TILES)
        self._commands.bind_to_storage_buffer(Binding.COMMANDS)
        self._sort.run(self._groups)
        ctx.memory_barrier()

    def draw(self, ctx: moderngl.Context, frame: moderngl.Framebuffer) -> None:
        """Fill the framebuffer in use, but for pixels that show solids in all of their samples."""
        self._texture.use(Unit.COARSE_BACKGROUND)
        ctx.depth_func = "<="
        self._draw(self._fill[_ROUGH], _ROUGH, 0.0)
        frame.depth_mask = False
        for kind in (_PLAIN, _SMOOTH):
            self._draw(self._fill[kind], kind, LEVELS["MIXED"])
        ctx.depth_func = "=="
        for level in ("SHADED", "MIXED"):
            self._draw(self._shade, _ROUGH, LEVELS[level])
        frame.depth_mask = True

    def _draw(self, tiles: moderngl.VertexArray, kind: int, level: float) -> None:
        tiles.program["level"] = level
        tiles.render_indirect(self._commands, moderngl.TRIANGLE_STRIP, count=1, first=kind)
