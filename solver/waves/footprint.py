"""The footprint of a source: smooth weights on the texels within a radius, measured along the surface.

Contacts ask for those of several sources at every step: `weigh_each` makes them in one call.
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
def weigh_each(
    grid: TexelGrid, centers: Ints, points: Floats, radii: Floats, scratch: Floats
) -> tuple[Ints, Ints, Floats, Floats]:
    """Footprints round points [k, 3] whose nearest texels are `centers`; `scratch` is `distance_scratch`.

    Returns
    -------
    begins : int64 [k + 1]
        Texels and weights of footprint i are those from begins[i] to begins[i + 1].
    texels : int64 [m]
    weights : float64 [m]
    radii : float64 [k]
        Those used [m].
    """
    begins, used, room = np.zeros(len(centers) + 1, np.int64), np.empty(len(centers)), 1024
    texels, weights = np.empty(room, np.int64), np.empty(room)
    for i in range(len(centers)):
        radius = used[i] = max(radii[i], MIN_TEXELS * _spacing(grid, centers[i]))
        near, distance, flat = _nearby(grid, centers[i], points[i], radius, scratch)
        if not flat:
            near, distance = _blended(grid, centers[i], points[i], radius, scratch)
        first = end = begins[i]
        if first + len(near) > room:
            room = 2 * (first + len(near))
            more_texels, more_weights = np.empty(room, np.int64), np.empty(room)
            for k in range(first):
                more_texels[k], more_weights[k] = texels[k], weights[k]
            texels, weights = more_texels, more_weights
        total = 0.0
        for k in range(len(near)):
            weight = max(1 - (distance[k] / radius) ** 2, 0.0) ** 3
            if weight > 0:
                texels[end], weights[end] = near[k], weight
                total += weight * grid.areas[near[k]]
                end += 1
        for k in range(first, end):
            weights[k] /= total
        begins[i + 1] = end
    return begins, texels[: begins[-1]], weights[: begins[-1]], used


@kernel(no_cpython_wrapper=True)
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


@kernel(no_cpython_wrapper=True)
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


@kernel(no_cpython_wrapper=True)
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
    grid, scratch = atlas.texels.grid, distance_scratch(atlas.areas.size)
    _, texels, weights, radii = weigh_each(grid, np.array([center]), point[None], np.array([radius]), scratch)
    return Footprint(texels, weights, center, point, float(radii[0]))


def spread(
    atlas: Atlas, name: str, value: float, unit: str, point: ArrayLike, radius: float
) -> tuple[Footprint, NDArray[np.float64]]:
    """Footprint of a point source, and the part of its value on each texel, [k]; `name` and `unit` are for messages."""
    require_finite(name, value, unit)
    where = footprint(atlas, point, radius)
    return where, value * (where.weights * atlas.areas.reshape(-1)[where.texels])
