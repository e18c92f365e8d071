"""Volumes of voxels, as a scan gives them, and the surfaces in them."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checked import is_finite, shown
from ..errors import MeshError
from .isosurface import zero_surface


@dataclasses.dataclass(frozen=True, eq=False)
class Volume:
    """Values at the nodes of a regular grid, and the value at which a body begins.

    Attributes
    ----------
    values : [i, j, k]
        Along x, y and z; higher inside of the body.
    threshold : float
        Value at the body's surface.
    spacing : float or [3]
        Between nodes [m].
    origin : [3]
        Where node (0, 0, 0) is [m].
    directions : [3, 3]
        Its columns are the ways along which i, j and k grow: unit vectors at right angles.
    """

    values: ArrayLike
    threshold: float
    spacing: float | ArrayLike = 1.0
    origin: ArrayLike = (0.0, 0.0, 0.0)
    directions: ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def surface(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Vertices [n, 3] [m] and triangles [m, 3] of the surface at the threshold, by marching cubes; often noisy.

        Raises
        ------
        MeshError
            If the grid is no volume of finite numbers, or no value reaches the threshold.
        """
        values = np.asarray(self.values, dtype=np.float64)
        spacing = np.broadcast_to(np.asarray(self.spacing, dtype=np.float64), 3)
        if values.ndim != 3 or min(values.shape) < 2 or not np.isfinite(values).all():
            raise MeshError(
                f"a volume has shape {values.shape}; valid are finite numbers [i, j, k], two or more along each side"
            )
        if not (spacing > 0).all() or not is_finite(self.threshold):
            raise MeshError(
                f"a volume has spacing {shown(self.spacing)} m and threshold {shown(self.threshold)}; valid are finite "
                "numbers, the spacing greater than 0"
            )
        if not values.min() < self.threshold < values.max():
            raise MeshError(
                f"the volume's values are from {values.min():g} to {values.max():g}; valid is a threshold between, not "
                f"{self.threshold:g}"
            )
        V, F = zero_surface(self.threshold - values, np.zeros(3), spacing)
        directions = np.asarray(self.directions, dtype=np.float64)
        turned = V @ directions.T + np.asarray(self.origin, dtype=np.float64)
        return turned, F if np.linalg.det(directions) > 0 else F[:, ::-1]
