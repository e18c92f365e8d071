"""The floor map: how objects above the floor darken it and colour its light."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import moderngl
import numpy as np

from ripple_sim.render.contract import CasterMap, Unit
from ripple_sim.render.projection import orthographic, view_along
from ripple_sim.render.resources import Resources

from .floor import Floor
from .shadows import ShadowMaps

_CEILING_SIZE = 224


_MAP_SIZE = 112


# of mipmaps that are looked up
_MAP_LEVELS = 5


_BOUNCE_LEVELS = 3


_INFLUENCE = 0.8  # radius, in half widths of the map


class FloorOcclusion:
    """The floor map: its ambient visibility (1 - occlusion), where shadows may fall, and the light of what occludes it.

    Without a floor there is a single texel, which counts nowhere.

    Parameters
    ----------
    options : mapping
        Defines of the light as for `DeferredShading`.
    floor : Floor, optional
    """

    def __init__(
        self, resources: Resources, options: Mapping[str, int], floor: Floor | None
    ) -> None:
        self._floor = floor
        if floor is None:
            self._map = self._seen = self._bounce = resources.texture((1, 1), 4, bytes(4))
            return
        self._pass = resources.vertex_array(
            resources.program("passes/floor_occlusion", **options, TILES=0), []
        )
        ceiling = _CEILING_SIZE, _CEILING_SIZE
        self._ceiling = resources.clamped_texture(ceiling, 4, dtype="nu2")
        self._ceiling.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._ceiling_framebuffer = resources.framebuffer(
            [self._ceiling], resources.depth_renderbuffer(ceiling)
        )
        self._map, self._bounce, self._seen = maps = [
            resources.clamped_texture((_MAP_SIZE, _MAP_SIZE), components, mipmaps=True, dtype=dtype)
            for components, dtype in ((2, "f2"), (4, "f2"), (4, "f1"))
        ]
        self._map_framebuffer = resources.framebuffer(maps)

    def look_up(self, ctx: moderngl.Context, cast: Callable[..., None]) -> None:
        """Draw what is above the floor from below, with the scene's `cast`."""
        floor = self._floor
        if floor is None:
            return
        # height above the floor becomes depth; this mirrors the scene: what faces the floor goes
        # clockwise
        turned = np.diag([1.0, 1.0, -1.0]) @ floor.rotation.T
        view = view_along(
            turned, turned @ (floor.origin + floor.rotation[:, :2] @ floor.centre[:2])
        )
        matrix = orthographic(floor.half_width, floor.half_width) @ view
        self._ceiling_framebuffer.use()
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        ctx.front_face = "cw"
        self._ceiling_framebuffer.clear(alpha=1.0, depth=1.0)
        cast(CasterMap.ALBEDO, matrix=tuple(matrix.T.ravel()))
        ctx.front_face = "ccw"

    def shade(self, ctx: moderngl.Context, shadows: ShadowMaps) -> None:
        """Fill the map from the height of what is above, and from the shadows."""
        floor = self._floor
        if floor is None:
            return
        self._map_framebuffer.use()
        ctx.disable(moderngl.DEPTH_TEST)
        shadows.bind()
        self._ceiling.use(Unit.CEILING)
        self._pass.program["extent"] = (
            2 * floor.half_width,
            floor.half_width,
            _INFLUENCE * floor.half_width,
        )
        self._pass.render(moderngl.TRIANGLES, vertices=3)

    def average(self) -> None:
        """Bring the map's mipmaps up to date."""
        if self._floor is not None:
            self._map.build_mipmaps(max_level=_MAP_LEVELS)
            self._seen.build_mipmaps()
            self._bounce.build_mipmaps(max_level=_BOUNCE_LEVELS)

    def bind(self) -> None:
        """Bind the map for the shaders."""
        self._map.use(Unit.FLOOR_MAP)
        self._bounce.use(Unit.FLOOR_BOUNCE)
        self._seen.use(Unit.FLOOR_SEEN)
