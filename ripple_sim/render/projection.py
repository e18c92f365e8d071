"""Matrices of view and projection, for column vectors, in OpenGL's conventions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def view_along(rotation: NDArray[np.float64], eye: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix from world to eye coordinates, shape [4, 4].

    The rows of `rotation` are the directions right, up and backwards; `eye` is the eye's position
    along those directions [m].
    """
    return np.block([[rotation, -eye[:, None]], [np.array([0.0, 0.0, 0.0, 1.0])]])


def perspective(
    fovy: float, aspect: float, near: float, far: float, shear: ArrayLike = (0.0, 0.0)
) -> NDArray[np.float64]:
    """Matrix from eye to clip coordinates in perspective, shape [4, 4].

    Parameters
    ----------
    fovy : float
        Vertical field of view [degrees].
    aspect : float
        Width over height of the frame.
    near, far : float
        Distances of the clip planes [m].
    shear : array_like, shape [2]
        See `Pose.shear`.
    """
    scale = 1.0 / np.tan(np.radians(fovy) / 2)
    projection = np.zeros((4, 4))
    projection[0, 0] = scale / aspect
    projection[1, 1] = scale
    projection[:2, 2] = np.multiply([scale / aspect, scale], shear)
    projection[2:, 2:] = perspective_depth(near, far)
    return projection


def perspective_depth(near: float, far: float) -> NDArray[np.float64]:
    """Lower right block [2, 2] of a perspective camera's matrix: z and w from z and w."""
    return np.array([[(near + far) / (near - far), 2 * near * far / (near - far)], [-1.0, 0.0]])


def parallel_depth(near: float, far: float) -> NDArray[np.float64]:
    """Lower right block [2, 2] of an orthographic camera's matrix: z and w from z and w."""
    return np.array([[2 / (near - far), (near + far) / (near - far)], [0.0, 1.0]])


def orthographic(half_width: float, depth: float) -> NDArray[np.float64]:
    """Matrix from eye to clip coordinates with parallel rays, shape [4, 4].

    It shows a square box from 0 to `depth` [m] in front of the eye.
    """
    matrix = np.diag([1 / half_width, 1 / half_width, -2 / depth, 1.0])
    matrix[2, 3] = -1.0
    return matrix
