"""The uniform block that every shader shares, and the studio's lamps."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from .camera import Pose

# the layout of shaders/frame.glsl (std140: everything is vec4 or mat4)
_FRAME = np.dtype(
    [
        ("view_projection", "f4", (4, 4)),
        ("shadow_matrix", "f4", (4, 4)),
        ("eye", "f4", 4),
        ("focus", "f4", 4),
        ("key_direction", "f4", 4),
        ("key_radiance", "f4", 4),
        ("shadow_scale", "f4", 4),
        ("zenith", "f4", 4),
        ("horizon", "f4", 4),
        ("lamp_normal", "f4", (3, 4)),
        ("lamp_tangent", "f4", (3, 4)),
        ("lamp_radiance", "f4", (3, 4)),
        ("floor_origin", "f4", 4),
        ("floor_u", "f4", 4),
        ("floor_v", "f4", 4),
        ("floor_normal", "f4", 4),
        ("floor_albedo", "f4", 4),
        ("floor_map", "f4", 4),
        ("counts", "f4", 4),
    ]
)

_KEY_RADIANCE = np.array([1.34, 1.28, 1.19])
_KEY_TANGENT = 0.10

# soft boxes: azimuth from the camera's forward axis (left is positive) and elevation [degrees], half width and half
# height over distance, radiance
_LAMPS = (
    (100.0, 46.0, 0.26, 0.34, (7.5, 7.2, 6.8)),
    (-68.0, 28.0, 0.16, 0.75, (4.2, 4.7, 5.4)),
    (10.0, 66.0, 0.65, 0.20, (3.6, 3.7, 3.8)),
)
_KEY_AZIMUTH, _KEY_ELEVATION = 92.0, 44.0


class FrameUniforms:
    """The block's values and its buffer."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self.values = np.zeros((), dtype=_FRAME)
        self.set_vector("floor_map", [0.0, 0.0, 1.0])
        self._buffer = ctx.buffer(reserve=_FRAME.itemsize, dynamic=True)

    def set_vector(self, name: str, xyz: Any, w: float = 0.0) -> None:
        """Set a vec4 from three numbers and one."""
        self.values[name][:3] = xyz
        self.values[name][3] = w

    def set_matrix(self, name: str, matrix: NDArray) -> None:
        """Set a matrix for column vectors."""
        self.values[name] = matrix.T

    def bind(self) -> None:
        """Upload the values and bind the block for all programs."""
        self._buffer.write(self.values.tobytes())
        self._buffer.bind_to_uniform_block(0)


def light_studio(frame: FrameUniforms, pose: Pose, floor_albedo: NDArray | None) -> NDArray[np.float64]:
    """Place the lamps about the camera's axis, colour the backdrop, and return the direction towards the key light.

    The lamps turn with the camera as if the set stood on a turntable: ripples are lit alike from every side.
    """
    key = _direction(pose, _KEY_AZIMUTH, _KEY_ELEVATION)
    frame.set_vector("key_direction", key, _KEY_TANGENT)
    frame.set_vector("key_radiance", _KEY_RADIANCE)
    for index, (azimuth, elevation, half_width, half_height, radiance) in enumerate(_LAMPS):
        normal = _direction(pose, azimuth, elevation)
        tangent = np.cross([0.0, 0.0, 1.0], normal)
        frame.values["lamp_normal"][index] = [*normal, half_width]
        frame.values["lamp_tangent"][index] = [*tangent / np.linalg.norm(tangent), half_height]
        frame.values["lamp_radiance"][index][:3] = radiance
    # the backdrop takes the floor's colour, so that one fades into the other
    tint = np.array([0.40, 0.42, 0.46]) if floor_albedo is None else 0.60 * floor_albedo
    frame.set_vector("horizon", tint)
    frame.set_vector("zenith", tint * np.array([0.36, 0.40, 0.48]))
    return key


def _direction(pose: Pose, azimuth: float, elevation: float) -> NDArray[np.float64]:
    right = pose.rotation[:, 0]
    right = np.array([right[0], right[1], 0.0]) / max(np.hypot(right[0], right[1]), 1e-9)
    forward = np.cross([0.0, 0.0, 1.0], right)
    turn, lift = np.radians([azimuth, elevation])
    flat = np.cos(turn) * forward - np.sin(turn) * right
    return np.cos(lift) * flat + np.sin(lift) * np.array([0.0, 0.0, 1.0])
