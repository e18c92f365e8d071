"""What lights the scene: the lamps of the MJCF, or a photo studio where it sets none."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Pose
from ripple_sim.render.gpu.color import linear
from ripple_sim.render.gpu.frame_uniforms import MAX_LIGHTS, MAX_SHADOWS, FrameUniforms

_KIND = mujoco.mjtLightType
_SUN_TANGENT = 0.05  # of the angular radius of a directional lamp: MJCF gives none
_GAMMA = 2.2  # of sRGB, about: a beam that falls off in sRGB falls off by so many times its exponent in linear light
_BRIGHTEST = 1.3  # sum of all lamps at which exposure is drawn back, as MuJoCo's picture saturates

_KEY_RADIANCE = np.array([1.34, 1.28, 1.19])
_KEY_TANGENT = 0.10
_KEY_AZIMUTH, _KEY_ELEVATION = 92.0, 44.0
# soft boxes: azimuth from the camera's forward axis (left is positive) and elevation [degrees], half width and half
# height over distance, radiance
_LAMPS = (
    (100.0, 46.0, 0.26, 0.34, (7.5, 7.2, 6.8)),
    (-68.0, 28.0, 0.16, 0.75, (4.2, 4.7, 5.4)),
    (10.0, 66.0, 0.65, 0.20, (3.6, 3.7, 3.8)),
)
_LAMPS_BESIDE_LIGHTS = 0.5  # how bright the soft boxes' reflections are where the MJCF sets the light
_FLOOR_IN_BACKGROUND = 0.6  # most of the floor's colour that the background takes on
_STUDIO_FADE, _FADE = (0.4, 3.4), (1.5, 10.0)  # of the floor into the background, in distances of the focus


@dataclass(frozen=True)
class Light:
    """A lamp.

    Attributes
    ----------
    direction : array, shape [3]
        Unit vector towards the lamp if it is far away, otherwise against its beam.
    radiance : array, shape [3]
        Linear; of a white surface that faces the lamp.
    position : array, shape [3], optional
        [m]; None: far away.
    size : float
        Tangent of its angular radius if it is far away, otherwise its radius [m].
    cutoff : float
        Half angle of the beam [radians].
    exponent : float
        Of the cosine that the beam falls off with.
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
    """All light of a frame: the lamps, of which the first may cast shadows, and what comes from everywhere else.

    `ambient` is the radiance from all around, shape [3]; `studio` says that the photo studio replaces the MJCF's lamps.
    """

    lights: list[Light]
    ambient: NDArray[np.float64]
    studio: bool

    def on(self, point: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Irradiance over pi of a small patch by all lamps, shape [3]."""
        return sum((light.at(point, normal) for light in self.lights), np.zeros(3))


def is_lit(model: Any) -> bool:
    """Whether the MJCF itself sets any light."""
    return bool(model.nlight)


def has_near_lamps(model: Any) -> bool:
    """Whether any lamp of the MJCF stands at a place."""
    return bool(np.any(model.light_type != _KIND.mjLIGHT_DIRECTIONAL))


def casting_lamps(model: Any) -> int:
    """How many lamps of the MJCF may cast shadows: 1 to MAX_SHADOWS."""
    casting = model.light_castshadow.astype(bool) & (model.light_type != _KIND.mjLIGHT_IMAGE)
    return int(np.clip(casting.sum(), 1, MAX_SHADOWS))


def model_lighting(model: Any, data: Any, pose: Pose) -> Lighting:
    """Lamps of the MJCF as they stand in `data`, the headlight among them.

    MuJoCo adds light up in sRGB and cuts off at 1. Here it adds up in linear light, scaled such that a surface comes
    out as in MuJoCo both where all lamps face it and where none does.
    """
    head = model.vis.headlight
    ambient = np.array(head.ambient, dtype=np.float64) if head.active else np.zeros(3)
    lights = []
    if head.active:
        towards = pose.rotation[:, 2]
        lights.append(Light(direction=towards, radiance=np.array(head.diffuse, dtype=np.float64)))
    for index in range(model.nlight):
        kind = model.light_type[index]
        if not model.light_active[index] or kind == _KIND.mjLIGHT_IMAGE:
            continue
        ambient += model.light_ambient[index]
        directional = kind == _KIND.mjLIGHT_DIRECTIONAL
        spot = kind == _KIND.mjLIGHT_SPOT
        lights.append(
            Light(
                direction=-np.array(data.light_xdir[index]),
                radiance=np.array(model.light_diffuse[index], dtype=np.float64),
                position=None if directional else np.array(data.light_xpos[index]),
                size=_SUN_TANGENT if directional else float(model.light_bulbradius[index]),
                cutoff=np.radians(min(float(model.light_cutoff[index]), 180.0)) if spot else np.pi,
                exponent=_GAMMA * float(model.light_exponent[index]) if spot else 0.0,
                falloff=np.array(model.light_attenuation[index], dtype=np.float64),
                shadow=bool(model.light_castshadow[index]),
            )
        )
    lights = [light for light in lights if light.radiance.any()]
    # lamps that cast shadows come before the others, the brightest first
    lights.sort(key=lambda light: (not light.shadow, -light.radiance.sum()))
    lights = lights[:MAX_LIGHTS]
    total = sum((light.radiance for light in lights), np.zeros(3)).max()
    base = linear(ambient.max())
    scale = (linear(min(ambient.max() + total, _BRIGHTEST)) - base) / total if total > 0 else 0.0
    return Lighting(
        [Light(**{**vars(light), "radiance": max(scale, 0.0) * light.radiance}) for light in lights],
        linear(ambient),
        studio=False,
    )


def studio_lighting(pose: Pose) -> Lighting:
    """One key light that turns with the camera, as if the set stood on a turntable: ripples are lit alike all round."""
    key = Light(_direction(pose, _KEY_AZIMUTH, _KEY_ELEVATION), _KEY_RADIANCE, size=_KEY_TANGENT, shadow=True)
    return Lighting([key], np.zeros(3), studio=True)


def set_lighting(
    frame: FrameUniforms, lighting: Lighting, pose: Pose, floor_albedo: NDArray | None, sky: NDArray | None
) -> None:
    """Fill the frame's lamps and colour its background.

    Parameters
    ----------
    frame : FrameUniforms
    lighting : Lighting
    pose : Pose
    floor_albedo : array, optional
        Linear colour of the floor; the background takes it on so that one fades into the other.
    sky : array, optional
        Mean linear colour of a skybox.
    """
    for index, light in enumerate(lighting.lights):
        record = frame.values["lights"][index]
        record["position"] = [0, 0, 0, 0] if light.position is None else [*light.position, 1]
        record["direction"] = [*light.direction, np.cos(light.cutoff)]
        record["radiance"] = [*light.radiance, light.exponent]
        record["falloff"] = [*light.falloff, 0]
    strength = 1.0 if lighting.studio else _LAMPS_BESIDE_LIGHTS
    for index, (azimuth, elevation, half_width, half_height, radiance) in enumerate(_LAMPS):
        normal = _direction(pose, azimuth, elevation)
        tangent = np.cross([0.0, 0.0, 1.0], normal)
        frame.values["lamp_normal"][index] = [*normal, half_width]
        frame.values["lamp_tangent"][index] = [*tangent / np.linalg.norm(tangent), half_height]
        frame.values["lamp_radiance"][index][:3] = strength * np.array(radiance)
    tint = np.array([0.40, 0.42, 0.46]) if floor_albedo is None else _far_light(lighting, pose) * floor_albedo
    horizon, zenith = tint, tint * np.array([0.36, 0.40, 0.48])
    frame.set_vector("horizon", horizon)
    frame.set_vector("zenith", zenith)
    if lighting.studio:
        frame.set_vector("sky", 0.75 * (0.7 * horizon + 0.3 * zenith), 1.0)
    else:
        hue = np.ones(3) if sky is None else sky / max(sky.mean(), 1e-6)
        frame.set_vector("sky", lighting.ambient * (0.5 + 0.5 * hue), 0.0)
    frame.set_vector("floor_fade", [*(_STUDIO_FADE if lighting.studio else _FADE), 0.0])


def _far_light(lighting: Lighting, pose: Pose) -> NDArray[np.float64]:
    """Irradiance over pi of the floor far away, as far as it colours the background, shape [3]."""
    if lighting.studio:
        return np.full(3, _FLOOR_IN_BACKGROUND)
    up = np.array([0.0, 0.0, 1.0])
    far = [light.at(pose.focus, up) for light in lighting.lights if light.position is None]
    return np.minimum(sum(far, lighting.ambient), _FLOOR_IN_BACKGROUND)


def _direction(pose: Pose, azimuth: float, elevation: float) -> NDArray[np.float64]:
    right = pose.rotation[:, 0]
    right = np.array([right[0], right[1], 0.0]) / max(np.hypot(right[0], right[1]), 1e-9)
    forward = np.cross([0.0, 0.0, 1.0], right)
    turn, lift = np.radians([azimuth, elevation])
    flat = np.cos(turn) * forward - np.sin(turn) * right
    return np.cos(lift) * flat + np.sin(lift) * np.array([0.0, 0.0, 1.0])
