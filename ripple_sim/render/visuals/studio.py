"""The photo studio: a key light, which stands in for the MJCF's lights where it has none, soft boxes and a backdrop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Pose
from ripple_sim.render.frame_uniforms import FrameUniforms

from .lights import Light, Lighting

_KEY_RADIANCE = np.array([1.34, 1.28, 1.19])
_KEY_TANGENT = 0.10
_KEY_AZIMUTH, _KEY_ELEVATION = 92.0, 44.0
# soft boxes: azimuth from the camera's forward axis (left is positive) and elevation [degrees], half width and half
# height over distance, radiance
SOFT_BOX_LIGHTS = (
    (100.0, 46.0, 0.26, 0.34, (7.5, 7.2, 6.8)),
    (-68.0, 28.0, 0.16, 0.75, (4.2, 4.7, 5.4)),
    (10.0, 66.0, 0.65, 0.20, (3.6, 3.7, 3.8)),
)
BESIDE_LIGHTS = 0.5  # brightness of the soft boxes' reflections beside lights of the MJCF
_FLOOR_IN_BACKGROUND = 0.6  # most of the floor's colour that the background takes on
STUDIO_FADE, FADE = (0.4, 3.4), (1.5, 10.0)  # of the floor into the background, in distances of the focus


def studio_lighting(pose: Pose) -> Lighting:
    """One key light that turns with the camera, as with a turntable: ripples look alike from all sides."""
    key = Light(_direction(pose, _KEY_AZIMUTH, _KEY_ELEVATION), _KEY_RADIANCE, size=_KEY_TANGENT, shadow=True)
    return Lighting([key], np.zeros(3), studio=True)


class SkyColors(NamedTuple):
    """Linear colours [3] of the background at the horizon and overhead, and the radiance that lights what is below."""

    horizon: NDArray[np.float64]
    zenith: NDArray[np.float64]
    light: NDArray[np.float64]


def sky_colors(lighting: Lighting, pose: Pose, floor_albedo: NDArray | None, sky: NDArray | None) -> SkyColors:
    """Colours of the background; parameters as for `set_lighting`."""
    tint = np.array([0.40, 0.42, 0.46]) if floor_albedo is None else _far_light(lighting, pose) * floor_albedo
    zenith = tint * np.array([0.36, 0.40, 0.48])
    if lighting.studio:
        return SkyColors(tint, zenith, 0.75 * (0.7 * tint + 0.3 * zenith))
    hue = np.ones(3) if sky is None else sky / max(sky.mean(), 1e-6)
    return SkyColors(tint, zenith, lighting.ambient * (0.5 + 0.5 * hue))


def set_lighting(
    frame: FrameUniforms, lighting: Lighting, pose: Pose, floor_albedo: NDArray | None, sky: NDArray | None
) -> None:
    """Set the frame's lights and soft boxes, and colour its background.

    Parameters
    ----------
    frame : FrameUniforms
    lighting : Lighting
    pose : Pose
    floor_albedo : array, optional
        Linear colour of the floor; tints the background, so that one fades into the other.
    sky : array, optional
        Mean linear colour of a skybox.
    """
    frame.values["lights"] = 0  # where there are fewer, the others are dark
    for index, light in enumerate(lighting.lights):
        record = frame.values["lights"][index]
        record["position"] = [0, 0, 0, 0] if light.position is None else [*light.position, 1]
        record["direction"] = [*light.direction, np.cos(light.cutoff)]
        record["radiance"] = [*light.radiance, light.exponent]
        record["falloff"] = [*light.falloff, 0]
    _set_soft_boxes(frame, pose, 1.0 if lighting.studio else BESIDE_LIGHTS)
    colors = sky_colors(lighting, pose, floor_albedo, sky)
    frame.set_vector("horizon", colors.horizon)
    frame.set_vector("zenith", colors.zenith)
    frame.set_vector("sky", colors.light, 1.0 if lighting.studio else 0.0)
    frame.set_vector("floor_fade", [*(STUDIO_FADE if lighting.studio else FADE), 0.0])


def _set_soft_boxes(frame: FrameUniforms, pose: Pose, strength: float) -> None:
    """Set the soft boxes, which turn with the camera, at a share of their brightness."""
    for index, (azimuth, elevation, half_width, half_height, radiance) in enumerate(SOFT_BOX_LIGHTS):
        normal = _direction(pose, azimuth, elevation)
        tangent = np.cross([0.0, 0.0, 1.0], normal)
        frame.values["soft_box_normal"][index] = [*normal, half_width]
        frame.values["soft_box_tangent"][index] = [*tangent / np.linalg.norm(tangent), half_height]
        frame.values["soft_box_radiance"][index][:3] = strength * np.array(radiance)


def _far_light(lighting: Lighting, pose: Pose) -> NDArray[np.float64]:
    """Irradiance over pi of the floor far away, as far as it tints the background, shape [3]."""
    if lighting.studio:
        return np.full(3, _FLOOR_IN_BACKGROUND)
    up = np.array([0.0, 0.0, 1.0])
    far = [light.at(pose.focus, up) for light in lighting.lights if light.position is None]
    return np.minimum(sum(far, lighting.ambient), _FLOOR_IN_BACKGROUND)


def _direction(pose: Pose, azimuth: float, elevation: float) -> NDArray[np.float64]:
    right = pose.rotation[:, 0]
    right = np.array([right[0], right[1], 0.0]) / max(np.hypot(right[0], right[1]), 1e-9)
    forward = np.cross([0.0, 0.0, 1.0], right)
    turn, rise = np.radians([azimuth, elevation])
    flat = np.cos(turn) * forward - np.sin(turn) * right
    return np.cos(rise) * flat + np.sin(rise) * np.array([0.0, 0.0, 1.0])
