"""Triangles on MuJoCo's height fields."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray


def height_field_triangles(model: mujoco.MjModel, field: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices [m], [n, 3], on the top of a height field in the frame of its geom, and triangles, [m, 3], facing up.

    The cells are cut along the diagonal along which MuJoCo cuts them into prisms (`mjc_ConvexHField`).
    """
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    first, size = int(model.hfield_adr[field]), model.hfield_size[field]
    x, y = np.meshgrid(np.linspace(-size[0], size[0], columns), np.linspace(-size[1], size[1], rows))
    z = size[2] * model.hfield_data[first : first + rows * columns].astype(np.float64)
    number = np.arange(rows * columns).reshape(rows, columns)
    south_west, south_east = number[:-1, :-1].ravel(), number[:-1, 1:].ravel()
    north_west, north_east = number[1:, :-1].ravel(), number[1:, 1:].ravel()
    F = [
        np.stack([south_west, south_east, north_east], axis=1),
        np.stack([south_west, north_east, north_west], axis=1),
    ]
    return np.stack([x.ravel(), y.ravel(), z], axis=1), np.concatenate(F)
