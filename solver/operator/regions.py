"""Regions held still, whose rim follows their outline rather than the texels' staircase."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike

from ..errors import SolverError
from ..texels.atlas import Atlas
from ..texels.smoothing import smoothed
from .material import Material

# Stiffness of the rim, in units of what a texel's neighbours have: a wave falls to 1/e within a texel.
_STIFFNESS = 1.0

# Where so much of the neighbourhood is held a texel is held wholly: at the outline it is a half.
_WHOLE = 0.8

# Texels that are held by this much and more are clamped.
_CLAMPED = 0.98


def hold(atlas: Atlas, material: Material, region: ArrayLike) -> Material:
    """Material that holds a region still: waves reflect from it inverted, as from a clamp, and pushes do not move it.

    A clamp, like a region of speed 0, ends at texels: its rim is a staircase, and the surface is torn or kinked along
    it. Here springs lead up to the clamp, over a few texels about the rim. They stiffen with the share of the
    neighbourhood that is held, so that the height fades out along the region's true outline. They take no energy. Waves
    turn at the outline, within a texel.

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
        raise SolverError(f"held region has shape {share.shape}; valid is {atlas.areas.shape}")
    if not ((share >= 0) & (share <= 1)).all():
        raise SolverError("held region has shares below 0, above 1 or NaN; valid are numbers from 0 to 1")
    share = np.clip(smoothed(atlas.texels.topology, share) / _WHOLE, 0, 1)
    speed, bending, stiffness, fixed = (
        material.texels(name, atlas.areas.shape) for name in ("speed", "bending", "stiffness", "fixed")
    )
    neighbours = speed**2 / atlas.areas + bending / atlas.areas**2
    return dataclasses.replace(
        material, stiffness=stiffness + _STIFFNESS * share**2 * neighbours, fixed=fixed | (share >= _CLAMPED)
    )
