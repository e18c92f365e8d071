"""Contact marks on a frame: arrows whose length is the impulse, projected onto the frame.

They are faint where a geom hides them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.pose import Pose

from .layout import Layout
from .marks import Mark
from .sprite import HEAD_WIDTH, RIM, Sprite, draw_arrow

# Groups of geoms that MuJoCo shows by default, and that may hide a point.
_SHOWN_GROUPS = np.array([1, 1, 1, 0, 0, 0], np.uint8)

# A geom hides a point if it is in front of it by more than this share of the distance. The geom on
# which a mark stands does not hide it.
_HIDING_GAP = 0.004

# Length of an arrow, at most, over that at the end of the scale: a scale that grows lags for a
# moment.
_MAX_LENGTH = 1.5

_HIDDEN_OPACITY = 0.3  # of the parts of an arrow that are behind other geoms
_SAMPLES = 9  # points along an arrow at which it is tested whether they are hidden


class Projection:
    """The camera of one frame.

    Parameters
    ----------
    pose : Pose
        Of the camera.
    width, height : int
        Of the frame [pixels].
    """

    def __init__(self, pose: Pose, width: int, height: int) -> None:
        self._pose = pose
        self._size = width, height

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels [k, 2] of points [k, 3] in the world [m]: x to the right, y down.

        They are NaN behind the camera.
        """
        pixels, depth = self._pose.pixels(points, self._size)
        return np.where(depth[:, None] > 0, pixels, np.nan)

    def metres(self, point: NDArray[np.float64]) -> float:
        """Length [m] of a pixel at a point's distance."""
        distance = float((self._pose.position - point) @ self._pose.rotation[:, 2])
        return self._pose.pixel_height(distance, self._size[1])

    def seen(self, model: Any, data: Any, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points [k, 3] in the world [m] are not hidden by a geom of a MuJoCo model.

        Targets hide points as if they had no waves.
        """
        rays = self._pose.ways(points)  # from the camera to the points [m]
        hit = np.zeros(1, np.int32)
        # distance of the nearest geom along each ray, in lengths of the ray; negative without one
        reach = np.array(
            [
                mujoco.mj_ray(model, data, point - ray, ray, _SHOWN_GROUPS, 1, -1, hit)
                for point, ray in zip(points, rays, strict=True)
            ]
        )
        return (reach < 0) | (reach > 1 - _HIDING_GAP)


class PlacedMark(NamedTuple):
    """An arrow on a frame: tip and tail [pixels], float64 [2], and the opacity along it [k]."""

    tip: NDArray[np.float64]
    tail: NDArray[np.float64]
    opacity: NDArray[np.float64]


def place_marks(
    marks: Sequence[Mark],
    scale: float,
    layout: Layout,
    projection: Projection,
    model: Any,
    data: Any,
) -> list[PlacedMark]:
    """Place contact marks on a frame.

    Arrows stand on the surface, in perspective except for their size, the same at any distance.
    Hidden parts are faint.

    Parameters
    ----------
    marks : sequence of Mark
    scale : float
        Impulse [N s] of an arrow of length `Layout.arrow_length`, seen from the side.
    projection : Projection
        Of this frame.
    model, data : mujoco.MjModel, mujoco.MjData
        Whose geoms may hide the arrows.
    """
    placed = []
    for mark in marks:
        pixel = projection.metres(mark.point)  # [m]
        length = layout.arrow_length * pixel * min(mark.impulse / scale, _MAX_LENGTH)  # [m]
        points = mark.point + length * np.linspace(0, 1, _SAMPLES)[:, None] * mark.axis
        pixels = projection.pixels(points)
        if np.isfinite(pixels).all():
            is_seen = projection.seen(model, data, points)
            opacity = mark.opacity * np.where(is_seen, 1.0, _HIDDEN_OPACITY)
            placed.append(PlacedMark(pixels[0], pixels[-1], opacity))
    return placed


def draw_marks(frame: NDArray[np.uint8], marks: Sequence[PlacedMark], layout: Layout) -> None:
    """Draw contact marks over a frame, uint8 [height, width, 3 or 4], in place.

    Later marks cover earlier ones.
    """
    thickness = layout.arrow_thickness
    reach = thickness * (HEAD_WIDTH + RIM) + 1
    for tip, tail, opacity in marks:
        low = np.floor(np.maximum(np.minimum(tip, tail) - reach, 0)).astype(int)
        high = np.ceil(np.minimum(np.maximum(tip, tail) + reach, frame.shape[1::-1])).astype(int)
        if (low < high).all():
            sprite = Sprite(int(high[0] - low[0]), int(high[1] - low[1]))
            draw_arrow(sprite, tip - low, tail - low, thickness, opacity)
            sprite.over(frame, int(low[0]), int(low[1]))
