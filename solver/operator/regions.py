"""Regions of an atlas that are held still or absorb waves, by the material's coefficients there."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SolverError
from ..texels.atlas import Atlas
from ..texels.distance import depth_in_region
from ..texels.smoothing import smoothed
from .material import Material

# Held share of a texel's neighbourhood from which on the texel is held wholly. At the outline of a
# region the share is a half.
_WHOLLY_HELD_SHARE = 0.8

# Held share of a texel from which on it is clamped.
_CLAMPED_SHARE = 0.98


def absorbing_damping(
    atlas: Atlas,
    region: ArrayLike,
    speed: float,
    reflection: float = 1e-3,
    width: float | None = None,
) -> NDArray[np.float64]:
    """Damping in a region that absorbs waves: it grows with the square of the depth in the region.

    It grows so gently that little is reflected. A wave that goes through a layer of width w and
    back loses the factor exp(-integral of zeta / c), which for zeta = z (depth / w)^2 is exp(-z w /
    3 c). Waves longer than the layer is wide are partly reflected whatever the damping (Israeli and
    Orszag 1981).

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
        If the region is not a mask of the atlas, covers nothing or everything, or a number is out
        of range.
    """
    mask = np.asarray(region)
    shape = atlas.areas.shape
    if mask.dtype != bool or mask.shape != shape:
        raise SolverError(
            f"absorbing region must be bool of shape {shape}, got {mask.dtype} of shape "
            f"{mask.shape}"
        )
    if mask.all() or not mask.any():
        raise SolverError(
            f"absorbing region must hold some texels and not all, got {mask.sum()} of {mask.size}"
        )
    if not 0 < reflection < 1:
        raise SolverError(f"reflection must be a number between 0 and 1, got {reflection!r}")
    if not 0 < speed < np.inf:
        raise SolverError(f"speed must be a finite number greater than 0, got {speed!r} m/s")
    depth = depth_in_region(atlas.texels, mask)
    if width is None:
        width = float(depth.max())
    if not 0 < width < np.inf:
        raise SolverError(f"width must be a finite number greater than 0, got {width!r} m")
    greatest = 3 * speed * np.log(1 / reflection) / width  # [1/s]
    return greatest * np.minimum(depth / width, 1) ** 2


def hold(atlas: Atlas, material: Material, region: ArrayLike) -> Material:
    """Material that holds a region still: waves reflect from it inverted, as from a clamp.

    Pushes do not move the region. A clamp, like a region of speed 0, ends at texels: its rim is a
    staircase, and the surface is torn or kinked along it. Here springs lead up to the clamp, over a
    few texels about the rim. The springs stiffen with the held share of the neighbourhood, so that
    the height fades out along the region's true outline. They take no energy. Waves turn at the
    outline, within a texel.

    Parameters
    ----------
    atlas : Atlas
    material : Material
        Of the free surface.
    region : bool or float [C, n, n]
        Held share of each texel, from 0 to 1.

    Returns
    -------
    Material
        With springs added to `stiffness`, and the inner part of the region in `fixed`.

    Raises
    ------
    SolverError
        If the region is not a mask of the atlas, or holds shares that are not from 0 to 1.
    """
    share = np.asarray(region, dtype=np.float64)
    if share.shape != atlas.areas.shape:
        raise SolverError(f"held region must have shape {atlas.areas.shape}, got {share.shape}")
    if not ((share >= 0) & (share <= 1)).all():
        raise SolverError(
            "shares of the held region must be numbers from 0 to 1, got one below 0, above 1 or NaN"
        )
    share = np.clip(smoothed(atlas.texels.topology, share) / _WHOLLY_HELD_SHARE, 0, 1)
    shape = atlas.areas.shape
    speed = material.texels("speed", shape)
    bending = material.texels("bending", shape)
    stiffness = material.texels("stiffness", shape)
    fixed = material.texels("fixed", shape)
    # as stiff as the pull of a texel's neighbours: a wave falls to 1/e within a texel
    springs = share**2 * (speed**2 / atlas.areas + bending / atlas.areas**2)
    return dataclasses.replace(
        material, stiffness=stiffness + springs, fixed=fixed | (share >= _CLAMPED_SHARE)
    )
