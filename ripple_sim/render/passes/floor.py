"""The floor: a plane that fades into the background."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.bounds import Balls
from ripple_sim.render.color import srgb_to_linear
from ripple_sim.render.contract import MappingKind, Unit
from ripple_sim.render.frame_uniforms import FrameUniforms
from ripple_sim.render.visuals.assets import Assets
from ripple_sim.render.visuals.lights import Light
from ripple_sim.render.visuals.materials import texture_pixels
from ripple_sim.render.visuals.texture_mapping import mapping_of
from ripple_sim.render.visuals.visual import geom_visual

_ENDLESS = 1e9  # half size of an infinite plane [m]
_SOFT = 0.1  # margin about shadows for their penumbras, in half widths of the map
_LOWEST_SINE = 0.02  # elevation of a light at which shadows have no end

_CORNERS = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(8, 3)  # of a box about a ball


def find_floor(model: Any, geoms: list[int]) -> int | None:
    """The plane that faces up most, or None."""
    rest = mujoco.MjData(model)
    mujoco.mj_kinematics(model, rest)
    planes = [geom for geom in geoms if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE]
    return max(planes, key=lambda geom: rest.geom_xmat[geom][8], default=None)


class Floor:
    """A model's floor. It is not rasterised: shaders intersect their rays with its plane.

    Parameters
    ----------
    assets : Assets
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
    origin, rotation : float64 [3] and [3, 3]
        As placed last; the rotation's columns are the floor's axes and its normal.
    centre, half_width : float64 [3], float
        The square of the floor that the floor map covers, along the floor's axes [m].
    """

    def __init__(self, assets: Assets, geom: int) -> None:
        self.geom, model = geom, assets.model
        visual = geom_visual(model, geom)
        mapping = mapping_of(model, visual)
        self.tiled = mapping.kind == MappingKind.FLAT_IMAGE
        self.tiling, self.albedo, self.tint = mapping.tiling, visual.color, visual.color
        self._image = assets.textures.get(mapping.texture) if self.tiled else None
        if self.tiled:
            texels = srgb_to_linear(texture_pixels(model, mapping.texture) / 255.0)
            self.albedo = self.tint * texels.mean(axis=(0, 1))
        self.reflectance = 0.0 if visual.material < 0 else float(model.mat_reflectance[visual.material])
        half = np.asarray(model.geom_size[geom][:2], dtype=np.float64)
        self._half = np.where(half > 0, half, _ENDLESS)

    @property
    def reflects(self) -> bool:
        """Whether it shows a reflection."""
        return self.reflectance > 0.0

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit vector, as placed last."""
        return self.rotation[:, 2]

    def place(self, frame: FrameUniforms, data: Any, centre: NDArray, radius: float) -> None:
        """Set where the floor is, and let the floor map cover what is under a ball [m]."""
        self.rotation = rotation = data.geom_xmat[self.geom].reshape(3, 3)
        self.origin = np.array(data.geom_xpos[self.geom])
        self.centre, self.half_width = local, half_width = rotation.T @ (centre - self.origin), 1.8 * radius
        frame.set_vector("floor_origin", self.origin, 1.0)
        frame.set_vector("floor_u", rotation[:, 0], self._half[0])
        frame.set_vector("floor_v", rotation[:, 1], self._half[1])
        frame.set_vector("floor_normal", rotation[:, 2])
        frame.set_vector("floor_albedo", self.albedo)
        frame.set_vector("floor_map", [local[0], local[1], half_width])

    def shade(self, frame: FrameUniforms, lights: list[Light], casters: Balls) -> None:
        """Set the parts of the floor on which the shadows of some balls may fall, for each light."""
        points = casters.centres[:, None] + casters.radii[:, None, None] * _CORNERS
        for shadow, light in zip(frame.values["shadows"], lights, strict=False):
            shadow["floor"] = self._shaded_box(light, points)

    def bind(self) -> None:
        """Bind the floor's texture."""
        if self._image is not None:
            self._image.use(Unit.FLAT_IMAGE)

    def _shaded_box(self, light: Light, points: NDArray) -> NDArray[np.float64]:
        """Lower and upper corner, in the floor map, of a box about the shadows of points [m]."""
        towards = light.direction if light.position is None else light.position - points
        height = np.maximum((points - self.origin) @ self.normal, 0.0)
        rise = np.broadcast_to(towards @ self.normal, height.shape)
        low = rise < _LOWEST_SINE * np.linalg.norm(towards, axis=-1)
        shadows = points - towards * (height / np.where(low, 1.0, rise))[..., None]
        local = ((shadows - self.origin) @ self.rotation)[..., :2] - self.centre[:2]
        least, most = local.min(axis=(0, 1)), local.max(axis=(0, 1))
        if low.any():
            least, most = np.full(2, -_ENDLESS), np.full(2, _ENDLESS)
        return 0.5 + 0.5 * np.concatenate([least / self.half_width - _SOFT, most / self.half_width + _SOFT])
