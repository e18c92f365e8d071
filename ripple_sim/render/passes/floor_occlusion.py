"""Ambient occlusion of the floor by what is above it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import moderngl
import numpy as np

from ripple_sim.render.contract import Unit
from ripple_sim.render.projection import orthographic
from ripple_sim.render.resources import Resources

from .floor import Floor
from .shadow import ShadowMaps

_CEILING_SIZE, _MAP_SIZE = 224, 112
_LEVELS, _BOUNCE_LEVELS = 5, 3  # of mipmaps that are looked up
_INFLUENCE = 0.8  # radius, in half widths of the map


class FloorOcclusion:
    """The floor map: its ambient visibility (1 - occlusion), where shadows may fall, and the light of what occludes it.

    Without a floor the map is a single texel that nothing shades.

    Parameters
    ----------
    resources : Resources
    options : mapping
        Defines of the light as for `DeferredShading`.
    floor : Floor, optional
    """

    def __init__(self, resources: Resources, options: Mapping[str, int], floor: Floor | None) -> None:
        self._floor = floor
        if floor is None:
            self._map = resources.texture((1, 1), 2, np.ones(2, dtype=np.float16).tobytes(), dtype="f2")
            self._seen = resources.texture((1, 1), 4, bytes([255] * 4))
            self._bounce = resources.texture((1, 1), 4, bytes(8), dtype="f2")
            return
        program = resources.program("glsl/view_vertex", "passes/floor_occlusion_fragment", **options)
        self._pass = resources.vertex_array(program, [])
        ceiling = _CEILING_SIZE, _CEILING_SIZE
        self._ceiling = resources.texture(ceiling, 4, dtype="nu2")
        self._ceiling.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._ceiling_framebuffer = resources.framebuffer([self._ceiling], resources.depth_renderbuffer(ceiling))
        self._map, self._bounce, self._seen = maps = [
            resources.texture((_MAP_SIZE, _MAP_SIZE), components, dtype=dtype)
            for components, dtype in ((2, "f2"), (4, "f2"), (4, "f1"))
        ]
        for texture in maps:
            texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        for texture in (self._ceiling, *maps):
            texture.repeat_x = texture.repeat_y = False
        self._map_framebuffer = resources.framebuffer(maps)

    def look_up(self, ctx: moderngl.Context, draw_albedo: Callable[[tuple[float, ...]], None]) -> None:
        """Draw what is above the floor from below."""
        floor = self._floor
        if floor is None:
            return
        # height above the floor becomes depth; this mirrors the scene: what faces the floor goes clockwise
        view = np.eye(4)
        view[:3, :3] = np.diag([1.0, 1.0, -1.0]) @ floor.rotation.T
        view[:3, 3] = -view[:3, :3] @ (floor.origin + floor.rotation[:, :2] @ floor.centre[:2])
        matrix = orthographic(floor.half_width, floor.half_width) @ view
        self._ceiling_framebuffer.use()
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        ctx.front_face = "cw"
        self._ceiling_framebuffer.clear(alpha=1.0, depth=1.0)
        draw_albedo(tuple(matrix.T.ravel()))
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
        self._pass.program["extent"] = (2 * floor.half_width, floor.half_width, _INFLUENCE * floor.half_width)
        self._pass.render(moderngl.TRIANGLES, vertices=3)

    def average(self) -> None:
        """Bring the map's mipmaps up to date."""
        if self._floor is not None:
            self._map.build_mipmaps(max_level=_LEVELS)
            self._seen.build_mipmaps()
            self._bounce.build_mipmaps(max_level=_BOUNCE_LEVELS)

    def bind(self) -> None:
        """Bind the map for the shaders."""
        self._map.use(Unit.FLOOR_MAP)
        self._bounce.use(Unit.FLOOR_BOUNCE)
        self._seen.use(Unit.FLOOR_SEEN)
