"""The lamps of a run as UsdLux lights."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from ripple_sim.render.visuals.lights import Light, Lighting, is_lit, model_lighting
from ripple_sim.render.visuals.studio import studio_lighting

from .meshes import keep, place, placing
from .source import Source

_LEAST_RADIUS = 0.01  # of a lamp whose MJCF gives none [m]
_STUDIO_SKY = 0.25  # radiance that stands for the studio's soft boxes, which USD has no equal of


class Lamps:
    """The lights of a source, which stand still or turn with the camera as its renderer's do.

    A white surface that faces a far light has the radiance that it has in the renderer; so it has at the model's middle
    for a near one, which falls off with the square of the distance everywhere else, as light does.

    Parameters
    ----------
    stage : Usd.Stage
    path : Sdf.Path
        Under which the lights stand.
    source : Source
    """

    def __init__(self, stage: Usd.Stage, path: Sdf.Path, source: Source) -> None:
        self._stage, self._source = stage, source
        self._path = UsdGeom.Scope.Define(stage, path).GetPath()
        self._studio = source.lighting == "studio" or (source.lighting == "auto" and not is_lit(source.model))
        self._lamps: list[UsdGeom.Xformable] = []

    def begin(self, data: mujoco.MjData) -> None:
        """Define the lights of the first frame, which only move later."""
        lighting = self._lighting(data)
        for index, light in enumerate(lighting.lights):
            path = self._path.AppendChild(f"lamp_{index}")
            define = _far if light.position is None else _near
            self._lamps.append(define(self._stage, path, light, self._source.model.stat.center))
            placing(self._lamps[-1])
        sky = lighting.ambient + (_STUDIO_SKY if self._studio else 0.0)
        if sky.any():
            dome = UsdLux.DomeLight.Define(self._stage, self._path.AppendChild("sky"))
            _set_light(dome, sky, 1.0)

    def write(self, data: mujoco.MjData, time: float) -> None:
        """Add a frame."""
        for lamp, light in zip(self._lamps, self._lighting(data).lights, strict=False):
            position = np.zeros(3) if light.position is None else light.position
            place(lamp, position, _towards(light.direction), time)

    def _lighting(self, data: mujoco.MjData) -> Lighting:
        pose, _ = self._source.pose(data)
        return studio_lighting(pose) if self._studio else model_lighting(self._source.model, data, pose)


def _far(stage: Usd.Stage, path: Sdf.Path, light: Light, middle: NDArray) -> UsdGeom.Xformable:
    lamp = UsdLux.DistantLight.Define(stage, path)
    angle = 2 * np.arctan(light.size)
    lamp.CreateAngleAttr(float(np.degrees(angle)))
    lamp.CreateNormalizeAttr(True)
    _set_light(lamp, light.radiance, np.pi)
    keep(lamp.GetPrim(), "power", np.pi * light.radiance.max())  # [W/m^2], as Blender has it
    keep(lamp.GetPrim(), "angle", angle)  # [radians], likewise
    return lamp


def _near(stage: Usd.Stage, path: Sdf.Path, light: Light, middle: NDArray) -> UsdGeom.Xformable:
    lamp = UsdLux.SphereLight.Define(stage, path)
    lamp.CreateRadiusAttr(max(light.size, _LEAST_RADIUS))
    lamp.CreateNormalizeAttr(True)
    distance = 1.0 if light.position is None else max(float(np.linalg.norm(light.position - middle)), 1e-3)
    # a sphere's irradiance is its intensity over four times the distance squared
    strength = np.pi / float(light.falloff @ [1.0, distance, distance**2])
    _set_light(lamp, light.radiance, 4 * distance**2 * strength)
    keep(lamp.GetPrim(), "power", 4 * np.pi * distance**2 * strength * light.radiance.max())  # [W], as Blender has it
    if light.cutoff < np.pi:
        shaping = UsdLux.ShapingAPI.Apply(lamp.GetPrim())
        shaping.CreateShapingConeAngleAttr(float(np.degrees(light.cutoff)))
        shaping.CreateShapingFocusAttr(light.exponent)
    return lamp


def _set_light(lamp: UsdLux.DistantLight, radiance: NDArray, intensity: float) -> None:
    brightest = max(float(radiance.max()), 1e-9)
    lamp.CreateColorAttr(Gf.Vec3f(*(float(each) / brightest for each in radiance)))
    lamp.CreateIntensityAttr(intensity * brightest)


def _towards(direction: NDArray) -> NDArray[np.float64]:
    """Quaternion of a light that shines along its -z, against a direction."""
    quaternion = np.zeros(4)
    mujoco.mju_quatZ2Vec(quaternion, np.ascontiguousarray(direction))
    return quaternion
