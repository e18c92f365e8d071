"""The background: floor and sky behind the solids."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl

from ripple_sim.render.contract import LEVELS, Unit
from ripple_sim.render.resources import Resources

from .background_tiles import SortedTiles
from .floor import Floor
from .frame_pass import FramePass

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
            FramePass(resources, "passes/background_fragment", blocks, **options, SHADOW=shadow, BLOCK=block)
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
