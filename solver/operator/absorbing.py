"""Absorbing regions: waves enter and do not return."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SolverError
from ..texels.atlas import Atlas
from ..texels.distance import depth_in_region


def absorbing_damping(
    atlas: Atlas, region: ArrayLike, speed: float, reflection: float = 1e-3, width: float | None = None
) -> NDArray[np.float64]:
    """Damping that grows with the square of the depth in a region, so gently that little is reflected.

    A wave that goes through a layer of width w and back loses the factor exp(-integral of zeta / c), which for
    zeta = z (depth / w)^2 is exp(-z w / 3 c). Waves longer than the layer is wide are partly reflected whatever the
    damping (Israeli and Orszag 1981).

    Parameters
    ----------
    atlas : Atlas
    region : bool [C, n, n]
        Where waves are to die.
    speed : float
        Wave speed in the region [m/s].
    reflection : float
        Amplitude that may come back, over that which went in.
    width : float, optional
        Depth from which on the damping grows no more [m]; by default the region's deepest place.

    Returns
    -------
    float64 [C, n, n]
        zeta [1/s] for `Material`, 0 outside the region.

    Raises
    ------
    SolverError
        If the region is not a mask of the atlas, covers nothing or everything, or a number is out of range.
    """
    mask = np.asarray(region)
    shape = atlas.areas.shape
    if mask.dtype != bool or mask.shape != shape:
        raise SolverError(f"absorbing region has type {mask.dtype} and shape {mask.shape}; valid is bool, {shape}")
    if mask.all() or not mask.any():
        raise SolverError(f"absorbing region holds {mask.sum()} of {mask.size} texels; valid is some, but not all")
    if not 0 < reflection < 1:
        raise SolverError(f"reflection is {reflection!r}; valid is a number between 0 and 1")
    if not 0 < speed < np.inf:
        raise SolverError(f"speed is {speed!r} m/s; valid is a finite number greater than 0")
    depth = depth_in_region(atlas.texels, mask)
    if width is None:
        width = float(depth.max())
    if not 0 < width < np.inf:
        raise SolverError(f"width is {width!r} m; valid is a finite number greater than 0")
    return 3 * speed * np.log(1 / reflection) / width * np.minimum(depth / width, 1) ** 2
