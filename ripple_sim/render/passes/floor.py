"""The floor of a model: a large plane, which fades into the background."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.bounds import enclosing
from ripple_sim.render.contract import MappingKind, Unit
from ripple_sim.render.frame_uniforms import FrameUniforms
from ripple_sim.render.visuals.lights import Light
from ripple_sim.render.visuals.objects import Assets
from ripple_sim.render.visuals.texture_mapping import mapping_of
from ripple_sim.render.visuals.visual import Visual, finish_of, geom_visual, visible_geoms

_GROUND = 4.0  # least half size of the floor, in radii of all else


_LEAST_UP = 0.1  # of the floor's normal: walls are none


_ENDLESS = 1e9  # half size of an infinite plane [m]


_SOFT = 0.1  # margin about shadows for their penumbras, in half widths of the map


_LOWEST_SINE = 0.02  # elevation of a light at which shadows have no end


_CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(8, 3)  # of a box about a ball


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
