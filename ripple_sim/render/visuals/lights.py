"""Lights as the renderer has them, and how MuJoCo's lights become such lights.

Lights of the MJCF are converted from MuJoCo's light in sRGB to linear light.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.render.contract import MAX_LIGHTS
from ripple_sim.render.pose import Pose
from ripple_sim.render.tone_mapping import srgb_to_linear

LIGHT_KIND = mujoco.mjtLightType
_SUN_TANGENT = 0.05  # of the angular radius of a directional light, which MJCF does not give
UNLIT_AMBIENT = 0.3  # ambient light in sRGB where there is no light at all, as in MuJoCo
_GAMMA = 2.2  # of sRGB, about: factor of a beam's exponent from sRGB to linear light

# Sum of all lights in sRGB above which they are dimmed, as MuJoCo's frames saturate.
_MAX_BRIGHTNESS = 1.3


@dataclass(frozen=True)
class Light:
    """A light.

    Attributes
    ----------
    direction : array, shape [3]
        Unit vector towards a light that is far away, against the beam of one at a position.
    radiance : array, shape [3]
        Linear; of a white surface facing the light.
    position : array, shape [3], optional
        [m]; None: far away.
    size : float
        Tangent of its angular radius if it is far away, or its radius [m].
    cutoff : float
        Half angle of the beam [radians].
    exponent : float
        Of the cosine with which the beam falls off.
    falloff : array, shape [3]
        Constant, linear [1/m] and quadratic [1/m^2] attenuation.
    gloss : float
        Share of its radiance that highlights have.
    shadow : bool
    """

    direction: NDArray[np.float64]
    radiance: NDArray[np.float64]
    position: NDArray[np.float64] | None = None
    size: float = _SUN_TANGENT
    cutoff: float = np.pi
    exponent: float = 0.0
    falloff: NDArray[np.float64] = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    gloss: float = 1.0
    shadow: bool = False

    def is_below(self, point: NDArray[np.float64], normal: NDArray[np.float64]) -> bool:
        """Whether the light shines from behind a plane, given by a point and its normal."""
        towards = self.direction if self.position is None else self.position - point
        return bool(towards @ normal < 0.0)

    def at(self, point: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Irradiance over pi of a small patch, shape [3]."""
        towards = self.direction
        strength = 1.0
        if self.position is not None:
            offset = self.position - point
            distance = max(float(np.linalg.norm(offset)), 1e-9)
            towards = offset / distance
            along = float(towards @ self.direction)
            beam = max(along, 0.0) ** self.exponent if along >= np.cos(self.cutoff) else 0.0
            strength = beam / float(self.falloff @ [1.0, distance, distance**2])
        return self.radiance * strength * max(float(towards @ normal), 0.0)


@dataclass(frozen=True)
class Lighting:
    """All light of a frame: the lights, of which the first may cast shadows, and the ambient light.

    `ambient` is the radiance from all around, shape [3]; with `studio` the studio replaces the
    MJCF's lights. Without a `backdrop` nothing is around the scene but a skybox, as in MuJoCo.
    """

    lights: list[Light]
    ambient: NDArray[np.float64]
    studio: bool
    backdrop: bool = True

    def on(self, point: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Irradiance over pi of a small patch by all lights, shape [3]."""
        return sum((light.at(point, normal) for light in self.lights), np.zeros(3))


def model_lighting(model: Any, data: Any, pose: Pose) -> Lighting:
    """Lights of the MJCF as posed in `data`, and the headlight.

    MuJoCo adds light up in sRGB and cuts off at 1. Here it adds up in linear light, scaled such
    that a surface comes out as in MuJoCo both where it faces all lights and where it faces none.
    """
    head = model.vis.headlight
    ambient = np.zeros(3)
    lights = []
    if head.active:
        ambient += head.ambient
        radiance = np.array(head.diffuse, dtype=np.float64)
        lights.append(
            Light(direction=pose.rotation[:, 2], radiance=radiance, gloss=_gloss(head.specular))
        )
    for index in range(model.nlight):
        if model.light_active[index] and model.light_type[index] != LIGHT_KIND.mjLIGHT_IMAGE:
            ambient += model.light_ambient[index]
            lights.append(_light(model, data, index))
    return _in_linear_light(lights, ambient)


def scene_lighting(lights: Sequence[mujoco.MjvLight]) -> Lighting:
    """Lights as a scene of MuJoCo's has them, the headlight too; see `model_lighting`."""
    ambient = np.zeros(3)
    lamps = []
    for light in lights:
        if light.type != LIGHT_KIND.mjLIGHT_IMAGE:
            ambient += light.ambient
            lamps.append(_scene_light(light))
    return _in_linear_light(lamps, ambient if len(lights) else np.full(3, UNLIT_AMBIENT))


def _in_linear_light(lights: list[Light], ambient: NDArray[np.float64]) -> Lighting:
    """Convert lights and ambient light from MuJoCo's, which add up in sRGB, to linear light."""
    lights = [light for light in lights if light.radiance.any()]
    # lights that cast shadows come before the others, the brightest first
    lights.sort(key=lambda light: (not light.shadow, -light.radiance.sum()))
    lights = lights[:MAX_LIGHTS]
    total = sum((light.radiance for light in lights), np.zeros(3)).max()
    base = srgb_to_linear(ambient.max())
    scale = 0.0
    if total > 0:
        brightest = srgb_to_linear(min(ambient.max() + total, _MAX_BRIGHTNESS))
        scale = (brightest - base) / total
    lights = [
        dataclasses.replace(light, radiance=max(scale, 0.0) * light.radiance) for light in lights
    ]
    return Lighting(lights, srgb_to_linear(ambient), studio=False)


def _gloss(specular: ArrayLike) -> float:
    """Share of a light's radiance that its highlights have, by MuJoCo's specular colour.

    From 0.3 on, the default of a lamp, highlights are physical: the share is 1.
    """
    return min(float(srgb_to_linear(np.max(specular)) / srgb_to_linear(0.3)), 1.0)


def _light(model: Any, data: Any, index: int) -> Light:
    """A light of the MJCF, with its radiance in sRGB."""
    directional = model.light_type[index] == LIGHT_KIND.mjLIGHT_DIRECTIONAL
    spot = model.light_type[index] == LIGHT_KIND.mjLIGHT_SPOT
    return Light(
        direction=-np.array(data.light_xdir[index]),
        radiance=np.array(model.light_diffuse[index], dtype=np.float64),
        position=None if directional else np.array(data.light_xpos[index]),
        size=_SUN_TANGENT if directional else float(model.light_bulbradius[index]),
        cutoff=np.radians(min(float(model.light_cutoff[index]), 180.0)) if spot else np.pi,
        exponent=_GAMMA * float(model.light_exponent[index]) if spot else 0.0,
        falloff=np.array(model.light_attenuation[index], dtype=np.float64),
        gloss=_gloss(model.light_specular[index]),
        shadow=bool(model.light_castshadow[index]),
    )


def _scene_light(light: mujoco.MjvLight) -> Light:
    """A light of a scene, with its radiance in sRGB."""
    directional = light.type == LIGHT_KIND.mjLIGHT_DIRECTIONAL
    spot = light.type == LIGHT_KIND.mjLIGHT_SPOT
    direction = np.array(light.dir, dtype=np.float64)
    return Light(
        direction=-direction / max(float(np.linalg.norm(direction)), 1e-9),
        radiance=np.array(light.diffuse, dtype=np.float64),
        position=None if directional else np.array(light.pos, dtype=np.float64),
        size=_SUN_TANGENT if directional else float(light.bulbradius),
        cutoff=np.radians(min(float(light.cutoff), 180.0)) if spot else np.pi,
        exponent=_GAMMA * float(light.exponent) if spot else 0.0,
        falloff=np.array(light.attenuation if spot else [1.0, 0.0, 0.0], dtype=np.float64),
        gloss=_gloss(light.specular),
        shadow=bool(light.castshadow),
    )
