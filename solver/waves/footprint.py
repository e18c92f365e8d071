"""The footprint of a source: smooth weights on the texels within a radius, measured along the surface."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..atlas.atlas import Atlas, check_points
from ..atlas.cubemap import face_coordinates
from ..errors import SolverError
from .distance import distance_from_point

# Fewer texels across than this and the source would excite waves that the grid cannot carry.
MIN_TEXELS = 2.0

# Distance along the surface over straight distance: up to the first value the surface is flat, from the second on
# only the way along the surface counts. In between the two are blended, so that no texel jumps in or out.
_FLAT, _BENT = 1.05, 1.5


@dataclasses.dataclass(frozen=True, eq=False)
class Footprint:
    """Where a source acts.

    Attributes
    ----------
    texels : int64 [k]
        Flat texel indices (face N + row) N + column.
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
        If the radius is negative or not finite.
    AtlasError
        If the point is not finite.
    """
    if not (np.isfinite(radius) and radius >= 0):
        raise SolverError(f"impulse radius is {radius!r} m; valid is a finite number, 0 or greater")
    n = atlas.resolution
    closest, direction = atlas.project(check_points(point)[:1])
    face, row, column = (int(np.rint(x[0])) for x in face_coordinates(direction, n))
    row, column = min(max(row, 0), n - 1), min(max(column, 0), n - 1)
    center = (face * n + row) * n + column
    block = atlas.padded_positions[face, row : row + 3, column : column + 3]
    spacing = np.nanmax(np.linalg.norm(block[[0, 1, 1, 2], [1, 0, 2, 1]] - block[1, 1], axis=1))
    radius = max(float(radius), MIN_TEXELS * float(spacing))
    texels, along = distance_from_point(atlas, center, closest[0], 1.1 * radius)
    straight = np.linalg.norm(atlas.positions.reshape(-1, 3)[texels] - closest[0], axis=1)
    bend = np.clip((along / np.maximum(straight, 1e-300) - _FLAT) / (_BENT - _FLAT), 0, 1)
    bend = np.where(straight > 0, bend * bend * (3 - 2 * bend), 0)
    distance = (1 - bend) * straight + bend * along
    weights = np.maximum(1 - (distance / radius) ** 2, 0) ** 3
    inside = weights > 0
    texels, weights = texels[inside], weights[inside]
    weights /= (weights * atlas.areas.reshape(-1)[texels]).sum()
    return Footprint(texels, weights, center, closest[0], radius)
