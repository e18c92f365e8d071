"""Which part of the picture an object may show in."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Pose
from ripple_sim.render.gpu.resources import OwnedObjects

_TILE = 32  # [pixels]
_CLOSEST = 0.01  # gap between the eye and a ball, in radii, below which it may show anywhere


def boxes_of(
    centres: NDArray[np.float64], radii: NDArray[np.float64], pose: Pose, size: tuple[int, int]
) -> NDArray[np.int64]:
    """Boxes in the picture about balls in the world.

    Parameters
    ----------
    centres, radii : array, shape [k, 3] and [k]
        [m]; a radius may be infinite.
    pose : Pose
    size : (width, height)
        Of the picture [pixels].

    Returns
    -------
    int64 [k, 4]
        Left, lower, right and upper edge [pixels], the first row of pixels being the lowest. Balls behind the camera
        have a box of no size.
    """
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


def balls_about(triangles: NDArray[np.float64], count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Balls that each hold a share of some triangles, which lie close together.

    Parameters
    ----------
    triangles : array, shape [m, 3, 3]
        Corners [m].
    count : int
        The least number of balls, unless there are fewer triangles.

    Returns
    -------
    centres, radii : array, shape [k, 3] and [k]
        [m]
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
    radii = [np.linalg.norm(each - centre, axis=1).max() for each, centre in zip(corners, centres, strict=True)]
    return centres, np.array(radii)


class Tiles:
    """The squares of the picture that any of some boxes touches, as instances for a shader.

    Parameters
    ----------
    ctx : OwnedObjects
    size : (width, height)
        Of the picture [pixels].
    """

    def __init__(self, ctx: OwnedObjects, size: tuple[int, int]) -> None:
        self._mask = np.zeros((-(-size[1] // _TILE), -(-size[0] // _TILE)), dtype=bool)
        self._scale = 2.0 * _TILE / np.array(size)
        self.buffer: moderngl.Buffer = ctx.buffer(reserve=8 * self._mask.size, dynamic=True)
        self.count = 0

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height of a tile, where the picture reaches from -1 to 1."""
        return float(self._scale[0]), float(self._scale[1])

    def cover(self, boxes: NDArray[np.int64]) -> None:
        """Take the tiles that any of some boxes touches; for the boxes see `boxes_of`."""
        self._mask[...] = False
        for left, lower, right, upper in boxes[(boxes[:, :2] < boxes[:, 2:]).all(axis=1)]:
            self._mask[lower // _TILE : -(-upper // _TILE), left // _TILE : -(-right // _TILE)] = True
        tiles = np.argwhere(self._mask)[:, ::-1]
        self.count = len(tiles)
        if self.count:
            self.buffer.write((tiles * self._scale - 1.0).astype("f4").tobytes())
