"""Shadow maps of the lights, what transparent objects take from these, and the floor that shadows and occlusion darken.

The floor is a plane that fades into the background.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import moderngl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import enclosing, orthographic, perspective, view_along
from ripple_sim.render.contract import CasterMap, MappingKind, Unit
from ripple_sim.render.resources import FrameUniforms, Resources
from ripple_sim.render.visuals.lights import Light
from ripple_sim.render.visuals.objects import Assets
from ripple_sim.render.visuals.texture_mapping import mapping_of
from ripple_sim.render.visuals.visual import Visual, finish_of, geom_visual, visible_geoms

# Texels along a side: as many as make one about as wide as a pixel, where the casters fill the
# frame.
_LEAST = 512
_MOST = 1536
_PER_PIXEL = 1.4
_STEP = 256
_WIDEST = 0.15  # penumbra, as a share of the map
_STEEPEST_FOV = 130.0  # [degrees]
_REACH = 30.0  # how far behind the casters shadows fall, in radii of the casters' ball
_TEXELS_PER_BLOCKER = 4
_LEVELS = 7  # of mipmaps of the blockers: as wide as twice the widest penumbra

_GROUND = 4.0  # least half size of the floor, in radii of all else
_LEAST_UP = 0.1  # of the floor's normal: walls are none
_ENDLESS = 1e9  # half size of an infinite plane [m]
_SOFT = 0.1  # margin about shadows for their penumbras, in half widths of the map
_LOWEST_SINE = 0.02  # elevation of a light at which shadows have no end
_CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(8, 3)  # of a box about a ball
_CEILING_SIZE = 224
_MAP_SIZE = 112

# of mipmaps that are looked up
_MAP_LEVELS = 5
_BOUNCE_LEVELS = 3
_INFLUENCE = 0.8  # radius, in half widths of the map


class ShadowMaps:
    """Square depth maps, side by side, of the scene as the lights see it.

    Parameters
    ----------
    count : int
        How many lights may cast shadows, 1 to MAX_SHADOWS.
    height : int
        Of the frame [pixels].

    Attributes
    ----------
    size : int
        Texels along a side.
    views : list
        Matrices of 16 numbers, column by column, of the lights that cast shadows in this frame.
    """

    def __init__(self, resources: Resources, count: int, height: int) -> None:
        self._count = count
        self.size = size = int(np.clip(_STEP * round(_PER_PIXEL * height / _STEP), _LEAST, _MOST))
        self.views: list[tuple[float, ...]] = []
        self._depth = resources.depth_texture((count * size, size))
        self._depth.compare_func = ""
        self._depth.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._target = resources.framebuffer(depth_attachment=self._depth)
        linear = moderngl.LINEAR, moderngl.LINEAR
        self._test = resources.sampler(
            texture=self._depth, compare_func="<=", filter=linear, repeat_x=False, repeat_y=False
        )
        blockers = count * size // _TEXELS_PER_BLOCKER, size // _TEXELS_PER_BLOCKER
        self._blockers = resources.clamped_texture(blockers, 4, mipmaps=True, dtype="f4")
        self._blockers_target = resources.framebuffer([self._blockers])
        self._find_blockers = resources.vertex_array(
            resources.program("passes/blockers", SHADOWS=count), []
        )

    def fit(
        self, frame: FrameUniforms, lights: list[Light], centre: NDArray, radius: float
    ) -> list[Light]:
        """Aim the maps at a ball [m] that contains all casters, set the frame's shadows, and return their lights."""
        casting = [light for light in lights if light.shadow][: self._count]
        self.views = []
        for shadow, light in zip(frame.values["shadows"], casting, strict=False):
            aim = _fit_far if light.position is None else _fit_near
            matrix = aim(shadow, light, self.size, centre, radius)
            to_map = (
                np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]])
                @ matrix
            )
            shadow["matrix"] = to_map.T
            shadow["planes"] = np.linalg.inv(to_map)
            self.views.append(tuple(matrix.T.ravel()))
        return casting

    def draw(self, cast: Callable[..., None]) -> None:
        """Draw all maps, with the scene's `cast`."""
        for index, view in enumerate(self.views):
            self._target.viewport = (index * self.size, 0, self.size, self.size)
            self._target.use()
            if index == 0:
                self._target.clear(depth=1.0)
            cast(CasterMap.DEPTH, matrix=view)

    def find_blockers(self, ctx: moderngl.Context) -> None:
        """Prefilter the maps for the search for blockers."""
        self._blockers_target.use()
        self._depth.use(Unit.SHADOW_MAPS)
        ctx.disable(moderngl.DEPTH_TEST)
        self._find_blockers.render(moderngl.TRIANGLES, vertices=3)
        ctx.enable(moderngl.DEPTH_TEST)
        self._blockers.build_mipmaps(max_level=_LEVELS)

    def bind(self) -> None:
        """Bind the maps for the shaders, once with and once without the depth test."""
        self._depth.use(Unit.SHADOW_TEST)
        self._test.use(Unit.SHADOW_TEST)
        self._depth.use(Unit.SHADOW_MAPS)
        self._blockers.use(Unit.BLOCKERS)


def _fit_far(
    shadow: NDArray, light: Light, size: int, centre: NDArray, radius: float
) -> NDArray[np.float64]:
    """Fit a box to the ball; it grows in coarse steps and moves by whole texels, so that shadow edges do not crawl.

    It extends behind the ball, where the shadows fall.
    """
    half_width = 2.0 ** (np.ceil(4 * np.log2(radius)) / 4)
    texel = 2 * half_width / size
    rotation = _axes(light.direction)
    eye = rotation @ centre
    eye[:2] = np.round(eye[:2] / texel) * texel
    eye[2] += half_width
    depth = (2 + _REACH) * half_width
    shadow["depth"] = depth, 0, 0, 1
    shadow["width"] = 2 * half_width, 0, size, 0
    shadow["penumbra"] = light.size, 0, _WIDEST, 0
    return orthographic(half_width, depth) @ view_along(rotation, eye)


def _fit_near(
    shadow: NDArray, light: Light, size: int, centre: NDArray, radius: float
) -> NDArray[np.float64]:
    """Fit the light's view to the ball, no wider than its beam."""
    position: Any = light.position
    away = float(np.linalg.norm(centre - position))
    towards = light.direction if away < radius else (position - centre) / away
    widest = np.radians(_STEEPEST_FOV / 2)
    half = widest if away < 1.1 * radius else min(float(np.arcsin(radius / away)), widest)
    if light.cutoff < half:
        towards = light.direction
        half = light.cutoff
    half = np.ceil(half * 64) / 64
    far = away + _REACH * radius
    near = max(0.5 * (away - radius), 0.004 * far)
    shadow["depth"] = 0, near * far, near - far, far
    shadow["width"] = 0, 2 * np.tan(half), size, 0
    shadow["penumbra"] = 0, light.size, _WIDEST, 0
    rotation = _axes(towards)
    return perspective(float(np.degrees(2 * half)), 1.0, near, far) @ view_along(
        rotation, rotation @ position
    )


def _axes(back: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows right, up and back of a view along -back."""
    helper = [0.0, 0.0, 1.0] if abs(back[2]) < 0.999 else [0.0, 1.0, 0.0]
    right = np.cross(helper, back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back])


class TransmissionMaps:
    """Square maps in colour, side by side, of the transparent objects of a scene as the lights see them.

    Parameters
    ----------
    count : int
        How many lights may cast shadows, 1 to MAX_SHADOWS.
    size : int
        Texels along a side.
    """

    def __init__(self, resources: Resources, count: int, size: int) -> None:
        self._size = size
        self._maps = resources.clamped_texture((count * size, size), 4, mipmaps=True, dtype="f2")
        self._target = resources.framebuffer(
            [self._maps], resources.depth_renderbuffer((count * size, size))
        )

    def draw(self, views: Sequence[tuple[float, ...]], cast: Callable[..., None]) -> None:
        """Draw all maps, of the lights' `ShadowMaps.views`, with the scene's `cast`."""
        self._target.viewport = (0, 0, *self._target.size)
        self._target.use()
        self._target.clear(depth=1.0)
        for light, view in enumerate(views):
            self._target.viewport = (light * self._size, 0, self._size, self._size)
            cast(CasterMap.TRANSMISSION, matrix=view, light=light)
        self._maps.build_mipmaps()

    def bind(self) -> None:
        """Bind the maps for the shaders."""
        self._maps.use(Unit.TRANSMISSION)


def find_floor(model: Any, targets: Collection[int]) -> int | None:
    """The visible plane under all, or None: infinite or large, and no target.

    A table's top is none.

    Opaque ones come before others, infinite ones before large ones, then those that face up most,
    of several the highest.
    """
    rest = mujoco.MjData(model)
    mujoco.mj_kinematics(model, rest)
    visible = np.array(visible_geoms(model), dtype=np.int64)
    is_plane = model.geom_type[visible] == mujoco.mjtGeom.mjGEOM_PLANE
    others = visible[~is_plane]
    size = model.stat.extent / 2 if model.nflex or model.nskin else 0.0
    if len(others):
        size = enclosing(np.column_stack([rest.geom_xpos[others], model.geom_rbound[others]]))[1]
    half = model.geom_size[:, :2]
    ground = [
        geom
        for geom in visible[is_plane].tolist()
        if geom not in targets
        and rest.geom_xmat[geom, 8] > _LEAST_UP
        and (half[geom] >= np.where(half[geom] > 0, _GROUND * size, 0.0)).all()
    ]

    def order(geom: int) -> tuple[bool, bool, float, float]:
        opaque = geom_visual(model, geom).opacity == 1.0
        endless = not half[geom].any()
        return opaque, endless, round(rest.geom_xmat[geom, 8], 3), rest.geom_xpos[geom, 2]

    return max(ground, key=order, default=None)


class Floor:
    """A model's floor. It is not rasterised: shaders intersect their rays with its plane.

    Parameters
    ----------
    geom : int
        The plane.

    Attributes
    ----------
    albedo : float64 [3]
        Mean linear colour.
    tiled : bool
        Whether it has a texture, with `tiling` (scale and offset) and `tint` (linear).
    reflectance : float
        0 to 1.
    shown : bool
        Whether it is there, as it is at first.
    origin, rotation : float64 [3] and [3, 3]
        As placed last; the rotation's columns are the floor's axes and its normal.
    centre, half_width : float64 [3], float
        The square of the floor that the floor map covers, along the floor's axes [m].
    """

    def __init__(self, assets: Assets, geom: int) -> None:
        self.geom = geom
        self._assets = assets
        self.shown = True
        self.paint(geom_visual(assets.model, geom))

    def paint(self, visual: Visual) -> None:
        """Be painted as this visual of the plane."""
        assets = self._assets
        model = self._assets.model
        mapping = mapping_of(model, visual)
        self.tiled = mapping.kind == MappingKind.FLAT_IMAGE
        self.tiling = mapping.tiling
        self.albedo = visual.color
        self.tint = visual.color
        self._image = assets.texture(mapping.texture) if self.tiled else None
        if self.tiled:
            self.albedo = self.tint * assets.mean_color(mapping.texture)
        self.reflectance = float(np.clip(finish_of(model, visual).reflectance, 0.0, 1.0))
        half = np.asarray(model.geom_size[self.geom][:2], dtype=np.float64)
        self._half = np.where(half > 0, half, _ENDLESS)

    @property
    def reflects(self) -> bool:
        """Whether it shows a reflection."""
        return self.reflectance > 0.0

    @property
    def endless(self) -> bool:
        """Whether it is an infinite plane."""
        return bool((self._half == _ENDLESS).all())

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit vector, as placed last."""
        return self.rotation[:, 2]

    def place(self, frame: FrameUniforms, data: Any, centre: NDArray, radius: float) -> None:
        """Set where the floor is, and let the floor map cover what is under a ball [m]."""
        self.rotation = rotation = data.geom_xmat[self.geom].reshape(3, 3)
        self.origin = np.array(data.geom_xpos[self.geom])
        self.centre, self.half_width = local, half_width = (
            rotation.T @ (centre - self.origin),
            1.8 * radius,
        )
        frame.set_vector("floor_origin", self.origin, float(self.shown))
        frame.set_vector("floor_u", rotation[:, 0], self._half[0])
        frame.set_vector("floor_v", rotation[:, 1], self._half[1])
        frame.set_vector("floor_normal", rotation[:, 2])
        frame.set_vector("floor_albedo", self.albedo)
        frame.set_vector("floor_map", [local[0], local[1], half_width])

    def shade(
        self, frame: FrameUniforms, lights: list[Light], casters: NDArray[np.float64]
    ) -> None:
        """Set the parts of the floor on which the shadows of some balls may fall, for each light."""
        points = casters[:, None, :3] + casters[:, 3:, None] * _CORNERS
        height = np.maximum((points - self.origin) @ self.normal, 0.0)
        for shadow, light in zip(frame.values["shadows"], lights, strict=False):
            towards = light.direction if light.position is None else light.position - points
            rise = np.broadcast_to(towards @ self.normal, height.shape)
            low = rise < _LOWEST_SINE * np.linalg.norm(towards, axis=-1)
            shadows = points - towards * (height / np.where(low, 1.0, rise))[..., None]
            local = ((shadows - self.origin) @ self.rotation)[..., :2] - self.centre[:2]
            least = local.min(axis=(0, 1))
            most = local.max(axis=(0, 1))
            if low.any():
                least = np.full(2, -_ENDLESS)
                most = np.full(2, _ENDLESS)
            # lower and upper corner, in the floor map, of a box about the shadows
            box = np.concatenate([least / self.half_width - _SOFT, most / self.half_width + _SOFT])
            shadow["floor"] = 0.5 + 0.5 * box

    def bind(self) -> None:
        """Bind the floor's texture."""
        if self._image is not None:
            self._image.use(Unit.FLAT_IMAGE)


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
