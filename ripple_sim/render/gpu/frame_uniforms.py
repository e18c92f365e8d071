"""The uniform block that every shader shares."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Pose, perspective, view_matrix

from .resources import OwnedObjects

MAX_LIGHTS, MAX_SHADOWS = 8, 4
_NEAR, _FAR = 0.02, 200.0  # clip planes, in camera distances

# the layout of shaders/frame.glsl (std140: everything is vec4 or mat4)
_LIGHT = np.dtype([(name, "f4", 4) for name in ("position", "direction", "radiance", "falloff")])
_SHADOW = np.dtype(
    [(name, "f4", (4, 4)) for name in ("matrix", "planes")]
    + [(name, "f4", 4) for name in ("depth", "width", "penumbra", "floor")]
)
_FRAME = np.dtype(
    [
        ("view_projection", "f4", (4, 4)),
        ("eye", "f4", 4),
        ("focus", "f4", 4),
        ("ray", "f4", 4),
        ("ray_right", "f4", 4),
        ("ray_up", "f4", 4),
        ("zenith", "f4", 4),
        ("horizon", "f4", 4),
        ("sky", "f4", 4),
        ("lamp_normal", "f4", (3, 4)),
        ("lamp_tangent", "f4", (3, 4)),
        ("lamp_radiance", "f4", (3, 4)),
        ("floor_origin", "f4", 4),
        ("floor_u", "f4", 4),
        ("floor_v", "f4", 4),
        ("floor_normal", "f4", 4),
        ("floor_albedo", "f4", 4),
        ("floor_light", "f4", 4),
        ("floor_map", "f4", 4),
        ("floor_fade", "f4", 4),
        ("lights", _LIGHT, MAX_LIGHTS),
        ("shadows", _SHADOW, MAX_SHADOWS),
        ("counts", "f4", 4),
    ]
)


class FrameUniforms:
    """The block's values and its buffer."""

    def __init__(self, ctx: OwnedObjects) -> None:
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

    def set_camera(self, pose: Pose, aspect: float) -> NDArray[np.float64]:
        """Set all that depends on the camera alone; return the world-to-clip matrix. `aspect` is width over height."""
        near, far = _NEAR * pose.distance, _FAR * pose.distance
        matrix = perspective(pose.fovy, aspect, near, far, pose.shear) @ view_matrix(pose)
        half = np.tan(np.radians(pose.fovy) / 2)
        self.set_matrix("view_projection", matrix)
        self.set_vector("eye", pose.eye, pose.distance)
        self.set_vector("focus", pose.focus)
        self.set_vector("ray", pose.rotation @ [*pose.shear, -1.0], near)
        self.set_vector("ray_right", half * aspect * pose.rotation[:, 0], far)
        self.set_vector("ray_up", half * pose.rotation[:, 1])
        return matrix

    def bind(self) -> None:
        """Upload the values and bind the block for all programs."""
        self._buffer.write(self.values.tobytes())
        self._buffer.bind_to_uniform_block(0)
