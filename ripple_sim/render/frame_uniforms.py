"""The uniform block of a frame, which all passes read."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .contract import FRAME, Binding
from .pose import Pose, view_matrix
from .resources import Resources


class FrameUniforms:
    """Values of the uniform block, and the buffer on the GPU.

    Attributes
    ----------
    values : structured array, shape []
        Values with the dtype of `contract.FRAME`.
    """

    def __init__(self, resources: Resources) -> None:
        self.values = np.zeros((), dtype=FRAME.dtype)
        self.set_vector("floor_map", [0.0, 0.0, 1.0])
        self._buffer = resources.buffer(reserve=FRAME.dtype.itemsize, dynamic=True)

    def set_vector(self, name: str, xyz: Any, w: float = 0.0) -> None:
        """Set a vec4 from three numbers and a fourth."""
        self.values[name][:3] = xyz
        self.values[name][3] = w

    def set_camera(
        self, pose: Pose, aspect: float, balls: NDArray[np.float64] | None = None
    ) -> None:
        """Set the uniforms that depend on the camera.

        `aspect` is the frame's width over its height. The `balls` contain all solids: the near
        plane is moved forward to the first ball.
        """
        near, far = pose.clip_planes if balls is None else pose.planes_about(balls)
        half_width, half_height = pose.half_sizes(aspect)
        world_to_clip = pose.projection(aspect, (near, far)) @ view_matrix(pose)
        floor_begins = 0.0 if pose.clip is None else pose.clip[0]  # [m]
        self.values["view_projection"] = world_to_clip.T  # column by column
        self.set_vector("eye", pose.eye, pose.distance)
        self.set_vector("focus", pose.focus, floor_begins)
        self.set_vector("ray", pose.rotation @ [*pose.shear, -1.0], near)
        self.set_vector("ray_right", half_width * pose.rotation[:, 0], far)
        self.set_vector("ray_up", half_height * pose.rotation[:, 1], float(pose.orthographic))

    def bind(self) -> None:
        """Upload the values and bind the block for all programs."""
        self._buffer.write(self.values.tobytes())
        self._buffer.bind_to_uniform_block(Binding.FRAME)
