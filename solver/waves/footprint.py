"""The footprint of a source: smooth weights on the texels within a radius, measured along the surface.

Contacts ask for the weights at every step; `weigh` is what compiled code calls.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SolverError, is_finite, shown
from ..kernel import Floats, Ints, kernel
from ..texels.atlas import Atlas, check_points
from ..texels.distance import distance_scratch, distance_to, march_from_point, taken
from ..texels.texel_mesh import TexelGrid
from .finite import require_finite

# Fewer texels across than this and the source would excite waves that the grid cannot resolve.
MIN_TEXELS = 2.0

# Distance along the surface over straight distance: up to the first value the surface is flat, from the second on
# only the way along the surface counts. In between the two are blended, so that no texel jumps in or out.
_FLAT, _BENT = 1.05, 1.5


@kernel
def weigh(grid: TexelGrid, center: int, point: Floats, radius: float, scratch: Floats) -> tuple[Ints, Floats, float]:
    """Texels, weights and radius of a footprint; `scratch` is `distance_scratch`."""
    radius = max(radius, MIN_TEXELS * _spacing(grid, center))
    texels, distance, flat = _nearby(grid, center, point, radius, scratch)
    if not flat:
        texels, distance = _blended(grid, center, point, radius, scratch)
    weights = np.empty(len(texels))
    kept, total = 0, 0.0
    for i in range(len(texels)):
        weight = max(1 - (distance[i] / radius) ** 2, 0.0) ** 3
        if weight > 0:
            texels[kept], weights[kept] = texels[i], weight
            total += weight * grid.areas[texels[i]]
            kept += 1
    for i in range(kept):
        weights[i] /= total
    return texels[:kept], weights[:kept], radius


@kernel
def _spacing(grid: TexelGrid, center: int) -> float:
    """Greatest distance from a texel to the four beside it."""
    halo, positions = grid.halo, grid.positions
    n = halo.shape[1] - 2
    chart, row, column = center // (n * n), center // n % n, center % n
    greatest = 0.0
    for down, right in ((0, 1), (1, 0), (1, 2), (2, 1)):
        t = halo[chart, row + down, column + right]
        if t >= 0:
            greatest = max(greatest, distance_to(positions, t, positions[center]))
    return greatest


@kernel
def _nearby(grid: TexelGrid, center: int, point: Floats, radius: float, scratch: Floats) -> tuple[Ints, Floats, bool]:
    """Connected texels within a straight distance of a point, their distances, and whether they lie flat.

    Where no normal is farther than acos(1/1.05) from that in the middle, the surface is a graph over the plane there
    whose slope makes no way along it longer than 1.05 times the straight one.
    """
    halo, positions, normals = grid.halo, grid.positions, grid.normals
    n = halo.shape[1] - 2
    room = 256
    texels = np.empty(room, np.int64)
    count, done, flat = 1, 0, True
    texels[0] = center
    scratch[center] = distance_to(positions, center, point)
    while done < count and flat:
        t = texels[done]
        done += 1
        if scratch[t] > radius:
            continue
        along = 0.0
        for k in range(3):
            along += normals[t, k] * normals[center, k]
        flat = along * _FLAT >= 1
        if count + 8 > room:
            room *= 2
            longer = np.empty(room, np.int64)
            for i in range(count):
                longer[i] = texels[i]
            texels = longer
        chart, row, column = t // (n * n), t // n % n, t % n
        for i in range(3):
            for j in range(3):
                a = halo[chart, row + i, column + j]
                if a >= 0 and scratch[a] == np.inf:
                    scratch[a] = distance_to(positions, a, point)
                    texels[count] = a
                    count += 1
    texels = texels[:count]
    return texels, taken(scratch, texels, texels), flat


@kernel
def _blended(grid: TexelGrid, center: int, point: Floats, radius: float, scratch: Floats) -> tuple[Ints, Floats]:
    """Texels within a little more than the radius along the surface, and the distances that count."""
    texels, distance = march_from_point(grid.halo, grid.positions, center, point, 1.1 * radius, scratch)
    for i in range(len(texels)):
        straight = distance_to(grid.positions, texels[i], point)
        if straight > 0:
            bend = min(max((distance[i] / straight - _FLAT) / (_BENT - _FLAT), 0.0), 1.0)
            bend = bend * bend * (3 - 2 * bend)
            distance[i] = (1 - bend) * straight + bend * distance[i]
    return texels, distance


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


def spread(
    atlas: Atlas, name: str, value: float, unit: str, point: ArrayLike, radius: float
) -> tuple[Footprint, NDArray[np.float64]]:
    """Footprint of a point source, and the part of its value on each texel, [k]; `name` and `unit` are for messages."""
    require_finite(name, value, unit)
    where = footprint(atlas, point, radius)
    return where, value * (where.weights * atlas.areas.reshape(-1)[where.texels])
