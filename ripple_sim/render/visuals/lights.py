"""Lights of the MJCF, converted from MuJoCo's light in sRGB to linear light."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Pose
from ripple_sim.render.color import srgb_to_linear
from ripple_sim.render.contract import MAX_LIGHTS, MAX_SHADOWS

_KIND = mujoco.mjtLightType
_SUN_TANGENT = 0.05  # of the angular radius of a directional light, which MJCF does not give
_GAMMA = 2.2  # of sRGB, about: factor of a beam's exponent from sRGB to linear light
_BRIGHTEST = 1.3  # sum of all lights above which exposure is reduced, as MuJoCo's frames saturate


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
    shadow : bool
    """

    direction: NDArray[np.float64]
    radiance: NDArray[np.float64]
    position: NDArray[np.float64] | None = None
    size: float = _SUN_TANGENT
    cutoff: float = np.pi
    exponent: float = 0.0
    falloff: NDArray[np.float64] = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    shadow: bool = False

    def at(self, point: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Irradiance over pi of a small patch, shape [3]."""
        towards, strength = self.direction, 1.0
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

    `ambient` is the radiance from all around, shape [3]; with `studio` the studio replaces the MJCF's lights.
    """

    lights: list[Light]
    ambient: NDArray[np.float64]
    studio: bool

    def on(self, point: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Irradiance over pi of a small patch by all lights, shape [3]."""
        return sum((light.at(point, normal) for light in self.lights), np.zeros(3))


def is_lit(model: Any) -> bool:
    """Whether the MJCF itself sets any light."""
    return bool(model.nlight)


def has_near_lights(model: Any) -> bool:
    """Whether any light of the MJCF has a position."""
    return bool(np.any(model.light_type != _KIND.mjLIGHT_DIRECTIONAL))


def count_lights(model: Any) -> int:
    """How many lights there may be, with the headlight: 1 to MAX_LIGHTS."""
    return int(np.clip(model.nlight + 1, 1, MAX_LIGHTS))


def count_casting_lights(model: Any) -> int:
    """How many lights of the MJCF may cast shadows: 1 to MAX_SHADOWS."""
    casting = model.light_castshadow.astype(bool) & (model.light_type != _KIND.mjLIGHT_IMAGE)
    return int(np.clip(casting.sum(), 1, MAX_SHADOWS))


def model_lighting(model: Any, data: Any, pose: Pose) -> Lighting:
    """Lights of the MJCF as posed in `data`, and the headlight.

    MuJoCo adds light up in sRGB and cuts off at 1. Here it adds up in linear light, scaled such that a surface comes
    out as in MuJoCo both where it faces all lights and where it faces none.
    """
    head = model.vis.headlight
    ambient = np.array(head.ambient, dtype=np.float64) if head.active else np.zeros(3)
    lights = []
    if head.active:
        towards = pose.rotation[:, 2]
        lights.append(Light(direction=towards, radiance=np.array(head.diffuse, dtype=np.float64)))
    for index in range(model.nlight):
        if model.light_active[index] and model.light_type[index] != _KIND.mjLIGHT_IMAGE:
            ambient += model.light_ambient[index]
            lights.append(_light(model, data, index))
    lights = [light for light in lights if light.radiance.any()]
    # lights that cast shadows come before the others, the brightest first
    lights.sort(key=lambda light: (not light.shadow, -light.radiance.sum()))
    lights = lights[:MAX_LIGHTS]
    total = sum((light.radiance for light in lights), np.zeros(3)).max()
    base = srgb_to_linear(ambient.max())
    scale = (srgb_to_linear(min(ambient.max() + total, _BRIGHTEST)) - base) / total if total > 0 else 0.0
    return Lighting(
        [dataclasses.replace(light, radiance=max(scale, 0.0) * light.radiance) for light in lights],
        srgb_to_linear(ambient),
        studio=False,
    )


def _light(model: Any, data: Any, index: int) -> Light:
    """A light of the MJCF, with its radiance in sRGB."""
    directional = model.light_type[index] == _KIND.mjLIGHT_DIRECTIONAL
    spot = model.light_type[index] == _KIND.mjLIGHT_SPOT
    return Light(
        direction=-np.array(data.light_xdir[index]),
        radiance=np.array(model.light_diffuse[index], dtype=np.float64),
        position=None if directional else np.array(data.light_xpos[index]),
        size=_SUN_TANGENT if directional else float(model.light_bulbradius[index]),
        cutoff=np.radians(min(float(model.light_cutoff[index]), 180.0)) if spot else np.pi,
        exponent=_GAMMA * float(model.light_exponent[index]) if spot else 0.0,
        falloff=np.array(model.light_attenuation[index], dtype=np.float64),
        shadow=bool(model.light_castshadow[index]),
    )
