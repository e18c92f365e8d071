"""The orbiting camera of the window: kept level, and the ray through a pixel."""

from __future__ import annotations

import math

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

# Highest elevation, up or down [degrees].
_STEEPEST = 88.0


def level(camera: pv.Camera) -> None:
    """Keep the horizon level, and the camera off the vertical, where there is no horizon."""
    focus = np.array(camera.focal_point)
    x, y, z = np.array(camera.position) - focus
    if x == y == 0:  # straight above or below: what is up in the frame tells where to go
        up = np.array(camera.up[:2])
        x, y = -1e-9 * z * (up if up.any() else np.array([0.0, 1.0]))
    across, most = math.hypot(x, y), math.tan(math.radians(_STEEPEST))
    if across > 0 and abs(z) > most * across:
        distance, slant = math.hypot(across, z), math.hypot(1.0, most)
        flat, high = distance / slant / across, math.copysign(distance * most / slant, z)
        camera.position = focus + np.array([x * flat, y * flat, high])
    camera.up = (0.0, 0.0, 1.0)


def ray(renderer: pv.Renderer, x: int, y: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Origin [m] and unit direction, in the world, of the ray from the camera through a pixel, from the lower left."""
    renderer.SetDisplayPoint(x, y, 0.5)
    renderer.DisplayToWorld()
    point = np.array(renderer.GetWorldPoint())
    eye = np.array(renderer.camera.position)
    along = point[:3] / point[3] - eye
    return eye, along / np.linalg.norm(along)
