"""A photo studio that stands in where the MJCF has no lights, and the backdrop of a scene.

The studio has a key light, soft boxes and a backdrop, which turn with the camera, so that ripples
look alike from all sides. Beside lights of the MJCF the soft boxes are reflections alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.pose import Pose

from .lights import Light, Lighting

# Key light of the studio.
_KEY_RADIANCE = np.array([1.34, 1.28, 1.19])  # linear, of a white surface that faces it
_KEY_TANGENT = 0.10  # of its angular radius
_KEY_AZIMUTH = 92.0  # from the camera's forward axis, left is positive [degrees]
_KEY_ELEVATION = 44.0  # [degrees]

# Brightness of the soft boxes' reflections beside lights of the MJCF.
BESIDE_LIGHTS = 0.5

# Share of the floor's colour that the background takes on, at most.
_MAX_FLOOR_TINT = 0.6

# Linear colour of the background where there is no floor, and colour overhead over the colour at
# the horizon.
_BARE_TINT = np.array([0.40, 0.42, 0.46])
_ZENITH_TINT = np.array([0.36, 0.40, 0.48])

# Radiance of the studio's sky over the mean colour of its background, and how much the horizon and
# the zenith count in this mean.
_STUDIO_SKY = 0.75
_HORIZON_SHARE = 0.7
_ZENITH_SHARE = 0.3

# Where the floor begins to fade into the background and where it ends, in distances of the focus.
STUDIO_FADE = (0.4, 3.4)
FADE = (1.5, 10.0)


class SoftBox(NamedTuple):
    """A rectangular light that is far away."""

    azimuth: float  # from the camera's forward axis, left is positive [degrees]
    elevation: float  # [degrees]
    half_width: float  # over its distance
    half_height: float  # over its distance
    radiance: tuple[float, float, float]  # linear


SOFT_BOX_LIGHTS = (
    SoftBox(100.0, 46.0, 0.26, 0.34, (7.5, 7.2, 6.8)),
    SoftBox(-68.0, 28.0, 0.16, 0.75, (4.2, 4.7, 5.4)),
    SoftBox(10.0, 66.0, 0.65, 0.20, (3.6, 3.7, 3.8)),
)


def studio_lighting(pose: Pose) -> Lighting:
    """One key light that turns with the camera, so that ripples look alike from all sides."""
    key = Light(
        direction(pose, _KEY_AZIMUTH, _KEY_ELEVATION),
        _KEY_RADIANCE,
        size=_KEY_TANGENT,
        shadow=True,
    )
    return Lighting([key], np.zeros(3), studio=True)


def sky_colors(
    lighting: Lighting, pose: Pose, floor_albedo: NDArray | None, sky: NDArray | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Linear colours [3] of the background at the horizon and overhead, and radiance of the sky.

    The radiance of the sky lights surfaces that face it. Parameters as for `set_lighting`.
    """
    if not lighting.backdrop:
        return np.zeros(3), np.zeros(3), lighting.ambient
    tint = _BARE_TINT
    if floor_albedo is not None:
        # irradiance over pi of the floor far away, by the lights that reach it
        irradiances = [
            light.at(pose.focus, np.array([0.0, 0.0, 1.0]))
            for light in lighting.lights
            if light.position is None
        ]
        far = np.minimum(sum(irradiances, lighting.ambient), _MAX_FLOOR_TINT)
        tint = (_MAX_FLOOR_TINT if lighting.studio else far) * floor_albedo
    zenith = tint * _ZENITH_TINT
    if lighting.studio:
        mean = _HORIZON_SHARE * tint + _ZENITH_SHARE * zenith
        return tint, zenith, _STUDIO_SKY * mean
    hue = np.ones(3) if sky is None else sky / max(sky.mean(), 1e-6)
    return tint, zenith, lighting.ambient * (0.5 + 0.5 * hue)


def direction(pose: Pose, azimuth: float, elevation: float) -> NDArray[np.float64]:
    """Unit vector in the world, by azimuth and elevation [degrees] from the camera's heading."""
    right = pose.rotation[:, 0]
    right = np.array([right[0], right[1], 0.0]) / max(np.hypot(right[0], right[1]), 1e-9)
    forward = np.cross([0.0, 0.0, 1.0], right)
    turn, rise = np.radians([azimuth, elevation])
    flat = np.cos(turn) * forward - np.sin(turn) * right
    return np.cos(rise) * flat + np.sin(rise) * np.array([0.0, 0.0, 1.0])
