"""The uniform block that every shader shares."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .camera import Pose
from .contract import FRAME, Binding
from .projection import perspective, view_matrix
from .resources import Resources

_NEAR, _FAR = 0.02, 200.0  # clip planes, in camera distances


class FrameUniforms:
    """The block's values and its buffer.

    Parameters
    ----------
    resources : Resources

    Attributes
    ----------
    values : structured array, shape []
        Of the dtype of `contract.FRAME`.
    """

    def __init__(self, resources: Resources) -> None:
        self.values = np.zeros((), dtype=FRAME.dtype)
        self.set_vector("floor_map", [0.0, 0.0, 1.0])
        self._buffer = resources.buffer(reserve=FRAME.dtype.itemsize, dynamic=True)

    def set_vector(self, name: str, xyz: Any, w: float = 0.0) -> None:
        """Set a vec4 from three numbers and one."""
        self.values[name][:3] = xyz
        self.values[name][3] = w

    def set_matrix(self, name: str, matrix: NDArray) -> None:
        """Set a matrix for column vectors."""
        self.values[name] = matrix.T

    def set_camera(self, pose: Pose, aspect: float) -> None:
        """Set whatever depends on the camera only; `aspect` is width over height."""
        near, far = _NEAR * pose.distance, _FAR * pose.distance
        matrix = perspective(pose.fovy, aspect, near, far, pose.shear) @ view_matrix(pose)
        half = np.tan(np.radians(pose.fovy) / 2)
        self.set_matrix("view_projection", matrix)
        self.set_vector("eye", pose.eye, pose.distance)
        self.set_vector("focus", pose.focus)
        self.set_vector("ray", pose.rotation @ [*pose.shear, -1.0], near)
        self.set_vector("ray_right", half * aspect * pose.rotation[:, 0], far)
        self.set_vector("ray_up", half * pose.rotation[:, 1])

    def bind(self) -> None:
        """Upload the values and bind the block for all programs."""
        self._buffer.write(self.values.tobytes())
        self._buffer.bind_to_uniform_block(Binding.FRAME)
