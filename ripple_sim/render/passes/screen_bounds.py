"""Bounding boxes in the frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.bounds import Balls
from ripple_sim.render.camera import Pose

_CLOSEST = 0.01  # gap between the eye and a ball, in radii, below which it may show anywhere


def boxes_of(balls: Balls, pose: Pose, size: tuple[int, int]) -> NDArray[np.int64]:
    """Boxes in the frame about balls in the world.

    Parameters
    ----------
    balls : Balls
        k of them.
    pose : Pose
    size : (width, height)
        Of the frame [pixels].

    Returns
    -------
    int64 [k, 4]
        Left, lower, right and upper edge [pixels], counted from the lower left. Balls behind the camera have a box of
        size 0.
    """
    centres, radii = balls
    local = (centres - pose.eye) @ pose.rotation
    middle = -local[:, 2]
    near, far = middle - radii, middle + radii
    seen = near > _CLOSEST * radii
    scale = size[1] / (2 * np.tan(np.radians(pose.fovy) / 2))
    # the nearest point of the ball's box is seen under the widest angle
    corners = np.stack(
        [(local[seen, :2] + side * radii[seen, None]) / depth[seen, None] for side in (-1, 1) for depth in (near, far)]
    )
    origin = np.array(size) / 2 - scale * pose.shear
    boxes = np.tile([0, 0, *size], (len(radii), 1))
    boxes[seen, :2] = np.clip(np.floor(origin + scale * corners.min(axis=0)), 0, size)
    boxes[seen, 2:] = np.clip(np.ceil(origin + scale * corners.max(axis=0)), 0, size)
    boxes[far <= 0] = 0
    return boxes


def scissor_of(boxes: NDArray[np.int64]) -> tuple[int, int, int, int] | None:
    """Smallest scissor (left, lower, width, height) about boxes [k, 4]; None if all are empty."""
    boxes = boxes[(boxes[:, :2] < boxes[:, 2:]).all(axis=1)]
    if not len(boxes):
        return None
    left, lower = (int(edge) for edge in boxes[:, :2].min(axis=0))
    right, upper = (int(edge) for edge in boxes[:, 2:].max(axis=0))
    return left, lower, right - left, upper - lower
