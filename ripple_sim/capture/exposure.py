"""How a frame is exposed: at which times while the shutter is open, and through which points of the lens."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ripple_sim.scene.camera import CameraEntry

_GOLDEN_RATIO = (np.sqrt(5.0) - 1.0) / 2.0
_FULL_TURN = 360.0  # degrees of a rotary shutter: open from one frame to the next


@dataclasses.dataclass(frozen=True, eq=False)
class Exposures:
    """The exposures whose mean is a frame, the same for every frame, in the order of time.

    Attributes
    ----------
    times : float64 [n]
        In frames after the frame's own time, when the shutter opens. The first is 0.
    offsets : float64 [n, 2]
        Point of the lens, to the right and up of its middle [m].
    """

    times: NDArray[np.float64]
    offsets: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.times)

    @classmethod
    def of(cls, camera: CameraEntry) -> Exposures:
        """Exposures of a scene's camera: a single one, through the middle of the lens, without shutter and aperture."""
        count = camera.exposures if camera.shutter > 0 or camera.aperture > 0 else 1
        times = camera.shutter / _FULL_TURN * np.arange(count) / count
        return cls(times, camera.aperture / 2 * _shuffled(disc_points(count)))


def disc_points(count: int) -> NDArray[np.float64]:
    """Points spread evenly over the unit disc, float64 [count, 2], with their mean in its middle.

    A spiral whose points follow one another under the golden angle (Vogel, "A better way to construct the sunflower
    head", Mathematical Biosciences 44, 1979).
    """
    index = np.arange(count)
    radius, angle = np.sqrt((index + 0.5) / count), 2 * np.pi * _GOLDEN_RATIO * index
    points = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return points - points.mean(axis=0)


def _shuffled(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points in an order that visits all parts of the lens in any part of the time.

    From the middle outwards, moving bodies would begin sharp and end blurred.
    """
    return points[np.argsort(np.argsort(np.arange(len(points)) * _GOLDEN_RATIO % 1.0))]
