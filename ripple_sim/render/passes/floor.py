"""The floor of a model: a large plane, which fades into the background."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ids import GeomId, TargetId
from ripple_sim.render.bounds import enclosing
from ripple_sim.render.contract import MappingKind, Unit
from ripple_sim.render.frame_uniforms import FrameUniforms
from ripple_sim.render.visuals.lights import Light
from ripple_sim.render.visuals.objects import Assets
from ripple_sim.render.visuals.texture_mapping import mapping_of
from ripple_sim.render.visuals.visual import Visual, finish_of, geom_visual, visible_geoms

# Least half size of a finite floor [horizontal radii of all other geoms together].
_MIN_HALF_SIZE = 4.0

# Least vertical part of the floor's unit normal: walls are no floors.
_MIN_NORMAL_UP = 0.1

# Half size that stands for an infinite plane [m].
_ENDLESS_HALF_SIZE = 1e9

# Half width of the floor map's square [radii of the ball about the casters].
_MAP_HALF_WIDTH = 1.8

# Margin about shadows for their penumbras [half widths of the floor map].
_PENUMBRA_MARGIN = 0.1

# Sine of a light's elevation above the floor below which shadows count as endless.
_MIN_SINE_OF_LIGHT = 0.02

# Corners of the cube from -1 to 1, shape [8, 3].
_CUBE_CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(8, 3)


def find_floor(model: Any, targets: Collection[TargetId]) -> GeomId | None:
    """The plane under everything else, or None.

    The floor is a visible plane that faces up, is infinite or large, and is no target. A table's
    top is no floor. Of several planes an opaque one is preferred, then an infinite one, then the
    one that faces up most, then the highest.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    planes: list[GeomId] = []
    others: list[GeomId] = []
    for geom in visible_geoms(model):
        is_plane = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE
        (planes if is_plane else others).append(geom)
    size_of_others = _size_of_geoms(model, data, np.array(others, dtype=np.int64))
    half_sizes = model.geom_size[:, :2]  # 0 along an axis along which a plane is infinite
    upness = data.geom_xmat[:, 8]  # vertical part of the geoms' z axes, the normals of planes

    def is_ground(plane: GeomId) -> bool:
        half_size = half_sizes[plane]
        min_half_size = np.where(half_size > 0, _MIN_HALF_SIZE * size_of_others, 0.0)
        is_large = bool((half_size >= min_half_size).all())
        faces_up = bool(upness[plane] > _MIN_NORMAL_UP)
        return is_large and faces_up and plane not in targets

    def preference(plane: GeomId) -> tuple[bool, bool, float, float]:
        is_opaque = geom_visual(model, plane).opacity == 1.0
        is_endless = not half_sizes[plane].any()
        return is_opaque, is_endless, round(upness[plane], 3), data.geom_xpos[plane, 2]

    grounds = [plane for plane in planes if is_ground(plane)]
    return max(grounds, key=preference, default=None)


def _size_of_geoms(model: Any, data: Any, geoms: NDArray[np.int64]) -> float:
    """Horizontal radius of some geoms together [m]; without geoms that of flexes and skins.

    Heights do not count: bodies may wait far above the floor until they fall.
    """
    if len(geoms):
        places = data.geom_xpos[geoms] * [1.0, 1.0, 0.0]
        balls = np.column_stack([places, model.geom_rbound[geoms]])
        _, radius = enclosing(balls)
        return radius
    return model.stat.extent / 2 if model.nflex or model.nskin else 0.0


class Floor:
    """The floor of a model. It is not rasterised: shaders intersect rays with its plane.

    Parameters
    ----------
    geom : int
        Geom id of the plane.

    Attributes
    ----------
    albedo : float64 [3]
        Mean linear colour.
    tiled : bool
        Whether the floor has a texture.
    tiling : tuple of float
        Scale and offset of the texture.
    tint : float64 [3]
        Linear colour that multiplies the texture.
    reflectance : float
        Share of light that is reflected as in a mirror, 0 to 1.
    shown : bool
        Whether the floor is drawn; at first it is.
    origin : float64 [3]
        Position of the plane, as placed last [m].
    rotation : float64 [3, 3]
        Its columns are the floor's axes and its normal, as placed last.
    centre : float64 [3]
        Middle of the square that the floor map covers, along the floor's axes [m].
    half_width : float
        Half the width of the square [m].
    """

    def __init__(self, assets: Assets, geom: GeomId) -> None:
        self.geom = geom
        self._assets = assets
        self.shown = True
        self.paint(geom_visual(assets.model, geom))

    def paint(self, visual: Visual) -> None:
        """Take colour, texture and reflectance from a visual of the plane."""
        assets = self._assets
        model = assets.model
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
        self._half = np.where(half > 0, half, _ENDLESS_HALF_SIZE)

    @property
    def reflects(self) -> bool:
        """Whether the floor shows a reflection."""
        return self.reflectance > 0.0

    @property
    def endless(self) -> bool:
        """Whether the floor is an infinite plane."""
        return bool((self._half == _ENDLESS_HALF_SIZE).all())

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit normal, as placed last."""
        return self.rotation[:, 2]

    def place(self, frame: FrameUniforms, data: Any, centre: NDArray, radius: float) -> None:
        """Set where the floor is, and centre the floor map under a ball.

        `centre` [3] and `radius` of the ball are in metres.
        """
        rotation = data.geom_xmat[self.geom].reshape(3, 3)
        self.rotation = rotation
        self.origin = np.array(data.geom_xpos[self.geom])
        self.centre = rotation.T @ (centre - self.origin)
        self.half_width = _MAP_HALF_WIDTH * radius
        frame.set_vector("floor_origin", self.origin, float(self.shown))
        frame.set_vector("floor_u", rotation[:, 0], self._half[0])
        frame.set_vector("floor_v", rotation[:, 1], self._half[1])
        frame.set_vector("floor_normal", rotation[:, 2])
        frame.set_vector("floor_albedo", self.albedo)
        frame.set_vector("floor_map", [self.centre[0], self.centre[1], self.half_width])

    def shade(
        self, frame: FrameUniforms, lights: list[Light], casters: NDArray[np.float64]
    ) -> None:
        """Set the box on the floor that each light's shadows of some balls may darken."""
        points = casters[:, None, :3] + casters[:, 3:, None] * _CUBE_CORNERS
        # heights of the corners of boxes about the balls above the floor [m]
        height = np.maximum((points - self.origin) @ self.normal, 0.0)
        for shadow, light in zip(frame.values["shadows"], lights, strict=False):
            towards_light = light.direction if light.position is None else light.position - points
            rise = np.broadcast_to(towards_light @ self.normal, height.shape)
            is_low = rise < _MIN_SINE_OF_LIGHT * np.linalg.norm(towards_light, axis=-1)
            if is_low.any():
                lower = np.full(2, -_ENDLESS_HALF_SIZE)
                upper = np.full(2, _ENDLESS_HALF_SIZE)
            else:
                shadows = points - towards_light * (height / rise)[..., None]
                along_floor = ((shadows - self.origin) @ self.rotation)[..., :2] - self.centre[:2]
                lower = along_floor.min(axis=(0, 1))
                upper = along_floor.max(axis=(0, 1))
            # from -1 to 1 over the floor map, then from 0 to 1
            lower = lower / self.half_width - _PENUMBRA_MARGIN
            upper = upper / self.half_width + _PENUMBRA_MARGIN
            shadow["floor"] = 0.5 + 0.5 * np.concatenate([lower, upper])

    def bind(self) -> None:
        """Bind the floor's texture, if there is one."""
        if self._image is not None:
            self._image.use(Unit.FLAT_IMAGE)
