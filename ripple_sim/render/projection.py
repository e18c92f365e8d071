"""View and projection matrices, for column vectors, in OpenGL's conventions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .camera import Pose


def view_matrix(pose: Pose) -> NDArray[np.float64]:
    """World to eye coordinates, shape [4, 4]."""
    view = np.eye(4)
    view[:3, :3] = pose.rotation.T
    view[:3, 3] = -pose.rotation.T @ pose.eye
    return view


def perspective(
    fovy: float, aspect: float, near: float, far: float, shear: ArrayLike = (0.0, 0.0)
) -> NDArray[np.float64]:
    """Eye to clip coordinates, shape [4, 4].

    `fovy` in degrees; `aspect` is width over height; `near` and `far` in metres; for `shear` see `Pose`.
    """
    scale = 1.0 / np.tan(np.radians(fovy) / 2)
    projection = np.zeros((4, 4))
    projection[0, 0] = scale / aspect
    projection[1, 1] = scale
    projection[:2, 2] = np.multiply([scale / aspect, scale], shear)
    projection[2, 2] = (near + far) / (near - far)
    projection[2, 3] = 2 * near * far / (near - far)
    projection[3, 2] = -1.0
    return projection


def orthographic(half_width: float, depth: float) -> NDArray[np.float64]:
    """Eye to clip coordinates of a square box from 0 to `depth` [m] in front of the eye, shape [4, 4]."""
    return np.diag([1 / half_width, 1 / half_width, -2 / depth, 1.0]) + np.array(
        [[0.0] * 4, [0.0] * 4, [0.0, 0.0, 0.0, -1.0], [0.0] * 4]
    )
