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

# Texels along a side of the picture of the objects above the floor, from below.
_CEILING_SIZE = 224

# Texels along a side of the floor map.
_MAP_SIZE = 112

# Highest mipmap levels that shaders look up: of the occlusion, and of the light of the occluders.
_MAP_LEVELS = 5
_BOUNCE_LEVELS = 3

# Distance up to which an object darkens the floor [half widths of the floor map].
_OCCLUSION_REACH = 0.8


class FloorOcclusion:
    """The floor map: three textures over the square of the floor below the objects.

    They contain the floor's ambient visibility (1 - occlusion) and places where shadows may fall,
    the light that occluders throw on the floor, and the floor's light as objects see it. Without a
    floor there is a single texel, whose value has no effect.

    Parameters
    ----------
    options : mapping
        Defines of the light, as for `DeferredShading`.
    floor : Floor, optional
    """

    def __init__(
        self, resources: Resources, options: Mapping[str, int], floor: Floor | None
    ) -> None:
        self._floor = floor
        if floor is None:
            texel = resources.texture((1, 1), 4, bytes(4))
            self._map = texel
            self._bounce = texel
            self._seen = texel
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
        size = _MAP_SIZE, _MAP_SIZE
        self._map = resources.clamped_texture(size, 2, mipmaps=True, dtype="f2")
        self._bounce = resources.clamped_texture(size, 4, mipmaps=True, dtype="f2")
        self._seen = resources.clamped_texture(size, 4, mipmaps=True, dtype="f1")
        self._map_framebuffer = resources.framebuffer([self._map, self._bounce, self._seen])

    def look_up(self, ctx: moderngl.Context, cast: Callable[..., None]) -> None:
        """Draw the objects above the floor from below; `cast` is `DrawnScene.cast`."""
        floor = self._floor
        if floor is None:
            return
        # The height above the floor becomes the depth. The view is a mirror image, in which
        # triangles that face the floor are clockwise.
        rotation = np.diag([1.0, 1.0, -1.0]) @ floor.rotation.T
        middle = floor.origin + floor.rotation[:, :2] @ floor.centre[:2]
        view = view_along(rotation, rotation @ middle)
        matrix = orthographic(floor.half_width, floor.half_width) @ view
        self._ceiling_framebuffer.use()
        ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        ctx.front_face = "cw"
        self._ceiling_framebuffer.clear(alpha=1.0, depth=1.0)
        cast(CasterMap.ALBEDO, matrix=tuple(matrix.T.ravel()))
        ctx.front_face = "ccw"

    def shade(self, ctx: moderngl.Context, shadows: ShadowMaps) -> None:
        """Fill the map from the heights of the objects above the floor, and from the shadows."""
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
            _OCCLUSION_REACH * floor.half_width,
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
