"""Surroundings of a scene: horizon of the skybox, fog and haze, by the flags of the scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.frame_uniforms import FrameUniforms
from ripple_sim.render.pose import Pose
from ripple_sim.render.tone_mapping import srgb_to_linear

_FLAG = mujoco.mjtRndFlag

# Where the floor begins to fade into the background and where it ends, in distances of the far
# plane.
_FLOOR_FADE = 0.9, 1.0

_SKYBOX_DISTANCE = 0.7  # of MuJoCo's skybox, in distances of the far plane

# Azimuths at which the horizon has a colour: the median of so many directions beside one another,
# times so many above one another, up to a slope.
_AZIMUTHS = 64
_DIRECTIONS_BESIDE = 16
_DIRECTIONS_ABOVE = 8
_MAX_SLOPE = 0.06

# Difference in linear colour from the median up to which a horizon is smooth.
_SMOOTH_DIFFERENCE = 0.03


def horizon_of(pixels: NDArray[np.uint8]) -> NDArray[np.float64] | None:
    """Linear colours [n, 3] of a skybox along its horizon, by the azimuth.

    They begin at +x and go round counter-clockwise; stars and other details are left out. None if
    the horizon is smooth anyway.

    Parameters
    ----------
    pixels : uint8 [6 size, size, 3]
        Its faces below one another, as `srgb_cube` takes them, or one image for all of them.
    """
    size = pixels.shape[1]
    faces = (
        np.stack([pixels[:size]] * 6)
        if len(pixels) != 6 * size
        else pixels.reshape(6, size, size, -1)
    )
    count = _AZIMUTHS * _DIRECTIONS_BESIDE
    azimuth = 2 * np.pi * (np.arange(count) + 0.5) / count
    slope = _MAX_SLOPE * np.arange(_DIRECTIONS_ABOVE) / (_DIRECTIONS_ABOVE - 1)
    directions = np.stack(
        np.broadcast_arrays(np.cos(azimuth)[:, None], np.sin(azimuth)[:, None], slope), axis=-1
    )
    seen = srgb_to_linear(_texels(faces, directions) / 255.0).reshape(_AZIMUTHS, -1, 3)
    middle = np.median(seen, axis=1)
    if np.abs(seen - middle[:, None]).max() < _SMOOTH_DIFFERENCE:
        return None
    return (np.roll(middle, 1, axis=0) + 2 * middle + np.roll(middle, -1, axis=0)) / 4


def _texels(faces: NDArray[np.uint8], directions: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Colours of a skybox, whose +y is up, in directions [..., 3] of the world near the horizon."""
    x = directions[..., 0]
    y = directions[..., 2]
    z = -directions[..., 1]
    side = np.abs(x) >= np.abs(z)
    along = np.where(side, np.abs(x), np.abs(z))
    face = np.where(side, np.where(x > 0, 0, 1), np.where(z > 0, 4, 5))
    across = np.select([face == 0, face == 1, face == 4], [-z, z, x], -x)
    size = faces.shape[1]
    column = np.clip((0.5 * (across / along + 1) * size).astype(np.int64), 0, size - 1)
    row = np.clip((0.5 * (-y / along + 1) * size).astype(np.int64), 0, size - 1)
    return faces[face, row, column]


@dataclass(frozen=True)
class RenderFlags:
    """Flags of a scene that the renderer follows, by default as MuJoCo has them."""

    shadow: bool = True
    reflection: bool = True
    skybox: bool = True
    fog: bool = False
    haze: bool = True

    @classmethod
    def of(cls, scene: mujoco.MjvScene | None) -> RenderFlags:
        """The flags of a scene; MuJoCo's defaults without a scene."""
        if scene is None:
            return cls()
        values = {name: bool(scene.flags[_flag(name)]) for name in cls.__dataclass_fields__}
        return cls(**values)


def _flag(name: str) -> int:
    """Number of a flag, of `mujoco.mjtRndFlag`, by its name in `RenderFlags`."""
    return int(getattr(_FLAG, f"mjRND_{name.upper()}"))


def followed_flags(*, backdrop: bool) -> set[int]:
    """Numbers of the flags, of `mujoco.mjtRndFlag`, that have an effect.

    Before a backdrop only the flag of shadows has one.
    """
    names = ["shadow"] if backdrop else list(RenderFlags.__dataclass_fields__)
    return {_flag(name) for name in names}


def set_surroundings(
    frame: FrameUniforms, model: Any, pose: Pose, flags: RenderFlags, *, skybox: bool, endless: bool
) -> None:
    """Set floor fade, fog, haze and skybox of a scene without a backdrop.

    Parameters
    ----------
    skybox : bool
        Whether the model has one.
    endless : bool
        Whether the floor is an infinite plane, the only one over whose horizon MuJoCo has haze.
    """
    shown = skybox and flags.skybox
    far = pose.clip_planes[1]
    frame.set_vector("floor_fade", [*(share * far / pose.distance for share in _FLOOR_FADE), 0.0])
    frame.set_vector("fog", model.vis.rgba.fog[:3], float(flags.fog))
    frame.set_vector("haze", model.vis.rgba.haze[:3], float(shown and flags.haze and endless))
    width = float(model.vis.map.haze)
    frame.set_vector("haze_cone", [width, _densest_height(width), _SKYBOX_DISTANCE * far])
    begins, ends = model.stat.extent * np.array([model.vis.map.fogstart, model.vis.map.fogend])
    frame.set_vector("shown_far", [begins, ends, float(shown)])


def _densest_height(width: float) -> float:
    """Height at which MuJoCo's haze is densest, in heights of its ring.

    It is where the cone of the haze meets a cone of 45 degrees.
    """
    steepness = np.arctan2(1.0, width)
    return float(np.sqrt(0.5) * width * np.sin(steepness) / np.sin(0.75 * np.pi - steepness))
