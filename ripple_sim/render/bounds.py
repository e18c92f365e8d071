"""Balls that bound what is drawn, and the boxes about balls in a frame.

Balls are float64 [k, 4]: centre in the world and radius [m], which may be infinite.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .pose import Pose

_CLOSEST = 0.01  # gap between the eye and a ball, in radii, below which it may show anywhere


def within(
    balls: NDArray[np.float64], point: NDArray[np.float64], reach: float
) -> NDArray[np.float64]:
    """The balls that any point within `reach` [m] of a point [3] touches."""
    return balls[np.linalg.norm(balls[:, :3] - point, axis=1) - balls[:, 3] < reach]


def enclosing(balls: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Centre [3] and radius of a ball that contains others."""
    centres = balls[:, :3]
    radii = balls[:, 3]
    centre = ((centres - radii[:, None]).min(axis=0) + (centres + radii[:, None]).max(axis=0)) / 2
    return centre, float((np.linalg.norm(centres - centre, axis=1) + radii).max())


def balls_about(triangles: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Balls that each contain a share of some triangles, which are close together.

    Parameters
    ----------
    triangles : array, shape [m, 3, 3]
        Corners [m].
    count : int
        The least number of balls, unless there are fewer triangles.
    """
    groups = [triangles]
    while len(groups) < min(count, len(triangles)):
        halves = []
        for group in groups:
            middles = group.mean(axis=1)
            order = np.argsort(middles[:, np.ptp(middles, axis=0).argmax()], kind="stable")
            halves += [group[half] for half in np.array_split(order, 2) if len(half)]
        groups = halves
    corners = [group.reshape(-1, 3) for group in groups]
    centres = np.array([(each.min(axis=0) + each.max(axis=0)) / 2 for each in corners])
    radii = [
        np.linalg.norm(each - centre, axis=1).max()
        for each, centre in zip(corners, centres, strict=True)
    ]
    return np.column_stack([centres, radii])


def boxes_of(balls: NDArray[np.float64], pose: Pose, size: tuple[int, int]) -> NDArray[np.int64]:
    """Boxes about balls in a frame of a size (width, height) [pixels].

    Returns
    -------
    int64 [k, 4]
        Left, lower, right and upper edge [pixels], counted from the lower left. Balls behind the
        camera have a box of size 0.
    """
    centres = balls[:, :3]
    radii = balls[:, 3]
    local = (centres - pose.eye) @ pose.rotation
    beside = local[:, :2]
    middle = -local[:, 2]
    near = middle - radii
    far = middle + radii
    seen = np.isfinite(radii) if pose.orthographic else near > _CLOSEST * radii
    scale = np.array(size) / (2 * pose.half_sizes(size[0] / size[1]))
    # in perspective the nearest point of the ball's box is seen under the widest angle
    corners = np.stack(
        [
            _on_screen(beside[seen] + side * radii[seen, None], depth[seen, None], pose)
            for side in (-1, 1)
            for depth in (near, far)
        ]
    )
    origin = np.array(size) / 2
    boxes = np.tile([0, 0, *size], (len(radii), 1))
    boxes[seen, :2] = np.clip(np.floor(origin + scale * corners.min(axis=0)), 0, size)
    boxes[seen, 2:] = np.clip(np.ceil(origin + scale * corners.max(axis=0)), 0, size)
    boxes[far <= 0] = 0
    return boxes


def _on_screen(
    beside: NDArray[np.float64], depth: NDArray[np.float64], pose: Pose
) -> NDArray[np.float64]:
    """Where points beside the eye [k, 2], at depths [k, 1] [m], are off the middle of the frame; see `half_sizes`."""
    if pose.orthographic:
        return beside - depth * pose.shear
    return beside / depth - pose.shear


def scissor_of(boxes: NDArray[np.int64]) -> tuple[int, int, int, int] | None:
    """Smallest scissor (left, lower, width, height) about boxes [k, 4]; None if all are empty."""
    boxes = boxes[(boxes[:, :2] < boxes[:, 2:]).all(axis=1)]
    if not len(boxes):
        return None
    left, lower = (int(edge) for edge in boxes[:, :2].min(axis=0))
    right, upper = (int(edge) for edge in boxes[:, 2:].max(axis=0))
    return left, lower, right - left, upper - lower
