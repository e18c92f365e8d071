"""Bounding balls of drawn objects, and the boxes about balls in a frame.

Balls are float64 [k, 4]: centre in the world and radius [m], which may be infinite.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .pose import Pose

# Gap between the eye and a ball, in radii of the ball, up to which the ball's box is the whole
# frame.
_MIN_GAP_OF_BOX = 0.01


def within(
    balls: NDArray[np.float64], point: NDArray[np.float64], reach: float
) -> NDArray[np.float64]:
    """The balls that are closer than `reach` [m] to a point [3]."""
    distances = np.linalg.norm(balls[:, :3] - point, axis=1) - balls[:, 3]
    return balls[distances < reach]


def enclosing(balls: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Centre [3] and radius of a ball that contains all balls [m]."""
    centres = balls[:, :3]
    radii = balls[:, 3]
    lower_corner = (centres - radii[:, None]).min(axis=0)
    upper_corner = (centres + radii[:, None]).max(axis=0)
    centre = (lower_corner + upper_corner) / 2
    radius = float((np.linalg.norm(centres - centre, axis=1) + radii).max())
    return centre, radius


def balls_about(triangles: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Balls about triangles: each ball contains a group of triangles that are close together.

    Parameters
    ----------
    triangles : array, shape [m, 3, 3]
        Corners [m].
    count : int
        The least number of balls, unless there are fewer triangles.

    The triangles are halved along their longest extent until there are enough groups.
    """
    groups = [triangles]
    while len(groups) < min(count, len(triangles)):
        halves = []
        for group in groups:
            middles = group.mean(axis=1)
            longest_axis = np.ptp(middles, axis=0).argmax()
            order = np.argsort(middles[:, longest_axis], kind="stable")
            halves += [group[half] for half in np.array_split(order, 2) if len(half)]
        groups = halves
    corners = [group.reshape(-1, 3) for group in groups]
    centres = np.array([(points.min(axis=0) + points.max(axis=0)) / 2 for points in corners])
    radii = [
        np.linalg.norm(points - centre, axis=1).max()
        for points, centre in zip(corners, centres, strict=True)
    ]
    return np.column_stack([centres, radii])


def boxes_of(balls: NDArray[np.float64], pose: Pose, size: tuple[int, int]) -> NDArray[np.int64]:
    """Boxes about balls in a frame of a size (width, height) [pixels].

    Returns
    -------
    int64 [k, 4]
        Left, lower, right and upper edge [pixels], counted from the lower left. A ball behind the
        camera has a box of size 0; a ball that may show anywhere has the whole frame.
    """
    centres = balls[:, :3]
    radii = balls[:, 3]
    local = (centres - pose.eye) @ pose.rotation
    beside = local[:, :2]
    middle = -local[:, 2]
    near = middle - radii
    far = middle + radii
    # balls whose box may be smaller than the frame
    bounded = np.isfinite(radii) if pose.orthographic else near > _MIN_GAP_OF_BOX * radii
    # corners of the box about the ball in the world; its front and its back may each show wider
    corners = []
    for side in (-1, 1):
        for depth in (near, far):
            corner = beside[bounded] + side * radii[bounded, None]
            corners.append(_on_screen(corner, depth[bounded, None], pose))
    corners_on_screen = np.stack(corners)
    pixels_per_metre = np.array(size) / (2 * pose.half_sizes(size[0] / size[1]))
    middle_of_frame = np.array(size) / 2
    lower_left = middle_of_frame + pixels_per_metre * corners_on_screen.min(axis=0)
    upper_right = middle_of_frame + pixels_per_metre * corners_on_screen.max(axis=0)
    boxes = np.tile([0, 0, *size], (len(radii), 1))
    boxes[bounded, :2] = np.clip(np.floor(lower_left), 0, size)
    boxes[bounded, 2:] = np.clip(np.ceil(upper_right), 0, size)
    boxes[far <= 0] = 0
    return boxes


def _on_screen(
    beside: NDArray[np.float64], depth: NDArray[np.float64], pose: Pose
) -> NDArray[np.float64]:
    """Offsets of points from the middle of the frame [k, 2] [m]; see `Pose.half_sizes`.

    `beside` [k, 2] has the offsets of the points to the right and up of the eye [m], `depth` [k, 1]
    the distances along the camera's axis [m].
    """
    if pose.orthographic:
        return beside - depth * pose.shear
    return beside / depth - pose.shear


def scissor_of(boxes: NDArray[np.int64]) -> tuple[int, int, int, int] | None:
    """Smallest scissor (left, lower, width, height) about boxes [k, 4]; None if all are empty."""
    has_area = (boxes[:, :2] < boxes[:, 2:]).all(axis=1)
    boxes = boxes[has_area]
    if not len(boxes):
        return None
    left, lower = (int(edge) for edge in boxes[:, :2].min(axis=0))
    right, upper = (int(edge) for edge in boxes[:, 2:].max(axis=0))
    return left, lower, right - left, upper - lower
