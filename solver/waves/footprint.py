"""The footprint of a source: smooth weights on the texels within a radius, measured along the surface."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checked import is_finite, shown
from ..errors import SolverError
from ..texels.atlas import Atlas, check_points
from ..texels.distance import distance_scratch
from .footprint_weights import weigh


@dataclasses.dataclass(frozen=True, eq=False)
class Footprint:
    """Where a source acts.

    Attributes
    ----------
    texels : int64 [k]
        Flat texel indices (chart n + row) n + column, each once.
    weights : float64 [k]
        Density [1/m^2] with sum(area weight) = 1.
    center : int
        Flat index of the texel nearest to the source.
    point : float64 [3]
        The source's place on the surface [m].
    radius : float
        The radius used [m], at least two texel spacings.
    """

    texels: NDArray[np.int64]
    weights: NDArray[np.float64]
    center: int
    point: NDArray[np.float64]
    radius: float


def footprint(atlas: Atlas, point: ArrayLike, radius: float) -> Footprint:
    """Spread a unit source round a surface point with the kernel (1 - (d/radius)^2)^3.

    The distance d is straight where the surface is nearly flat within the radius and runs along the surface where it is
    not, so that a source on one side of a thin part does not reach the other side.

    Parameters
    ----------
    atlas : Atlas
    point : [3]
        Any point [m]; its nearest surface point is the source.
    radius : float
        [m]. Raised to two texel spacings where it is less.

    Raises
    ------
    SolverError
        If the radius is negative or not finite, or there are several points.
    AtlasError
        If the point is not finite.
    """
    if not (is_finite(radius) and radius >= 0):
        raise SolverError(f"impulse radius is {shown(radius)} m; valid is a finite number, 0 or greater")
    points = check_points(point)
    if len(points) != 1:
        raise SolverError(f"a source has {len(points)} points; valid is one, [3]: call this once for each of them")
    (closest,), (center,) = atlas.nearest(points)
    return footprint_at(atlas, closest, int(center), float(radius))


def footprint_at(atlas: Atlas, point: NDArray[np.float64], center: int, radius: float) -> Footprint:
    """The footprint round a point of the surface whose nearest texel is known, see `Atlas.nearest`."""
    texels, weights, radius = weigh(atlas.texels.grid, center, point, radius, distance_scratch(atlas.areas.size))
    return Footprint(texels, weights, center, point, radius)
