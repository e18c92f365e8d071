"""The footprint of a source: smooth weights on the texels within a radius along the surface.

Contacts need the footprints of several sources at every step: `weigh_each` makes them in one call.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SolverError, is_finite, shown
from ..kernel import Floats, Ints, kernel
from ..mesh.points import check_points
from ..texels.atlas import Atlas
from ..texels.distance import Scratch, clean, distance_scratch, distance_to, march, seeded
from ..texels.texel_mesh import TexelGrid
from .finite import require_finite

# Radius of a footprint in texels, at least: a smaller source would excite waves that the grid
# cannot resolve.
MIN_TEXELS = 2.0

# Ratios of the distance along the surface to the straight distance. Up to the first ratio the
# surface counts as flat, and the straight distance counts. From the second ratio on, the distance
# along the surface counts. In between, the two distances are blended, so that no texel jumps in or
# out.
_FLAT_RATIO = 1.05
_BENT_RATIO = 1.5

# A search along the surface goes as far as this factor times the radius: a bit beyond the radius,
# since distances are blended.
_SEARCHED_RADII = 1.1

# Texels for which `weigh_each` makes room at first, and the factor by which the room grows.
_FIRST_ROOM = 4096
_ROOM_GROWTH = 4

# The four texels beside a texel: their rows and columns in a halo table, from the row and column of
# the texel itself.
_ROWS_BESIDE = np.array([0, 1, 1, 2])
_COLUMNS_BESIDE = np.array([1, 0, 2, 1])


def weigh_each(
    grid: TexelGrid, centers: Ints, points: Floats, radii: Floats
) -> tuple[Ints, Ints, Floats, Floats]:
    """Footprints round points [k, 3] whose nearest texels are `centers`.

    Returns
    -------
    begins : int64 [k + 1]
        Footprint i has the texels and weights from begins[i] to begins[i + 1].
    texels : int64 [m]
    weights : float64 [m]
    radii : float64 [k]
        The radii used [m].
    """
    sources = Sources(centers, points, radii)
    footprints = Footprints(
        begins=np.zeros(len(centers) + 1, np.int64),
        radii=np.empty(len(centers)),
        texels=np.empty(_FIRST_ROOM, np.int64),
        weights=np.empty(_FIRST_ROOM),
    )
    scratch = distance_scratch(len(grid.areas))
    finished = _weigh(grid, sources, scratch, 0, footprints)
    while finished < len(centers):  # there was no room for the next footprint
        footprints = footprints._replace(
            texels=np.resize(footprints.texels, _ROOM_GROWTH * len(footprints.texels)),
            weights=np.resize(footprints.weights, _ROOM_GROWTH * len(footprints.weights)),
        )
        finished = _weigh(grid, sources, scratch, finished, footprints)
    begins = footprints.begins
    end = begins[-1]
    return begins, footprints.texels[:end], footprints.weights[:end], footprints.radii


class Sources(NamedTuple):
    """Sources on a surface, k of them."""

    centers: Ints  # the texel nearest to each, [k]
    points: Floats  # [k, 3] [m]
    radii: Floats  # the radii that are asked for, [k] [m]


class Footprints(NamedTuple):
    """Room for the footprints of k sources; see `weigh_each`."""

    begins: Ints  # [k + 1]
    radii: Floats  # the radii used, [k] [m]
    texels: Ints  # [m]
    weights: Floats  # [m]


@kernel
def _weigh(
    grid: TexelGrid, sources: Sources, scratch: Scratch, first: int, footprints: Footprints
) -> int:
    """Fill in the footprints from number `first` on.

    Returns the number of the first footprint for which there was no room.
    """
    begins = footprints.begins
    texels = footprints.texels
    weights = footprints.weights
    distance = scratch.distance
    for i in range(first, len(sources.centers)):
        center = sources.centers[i]
        point = sources.points[i]
        radius = max(sources.radii[i], MIN_TEXELS * _spacing(grid, center))
        footprints.radii[i] = radius
        reached_count = _nearby(grid, center, point, radius, distance, scratch.reached)
        is_flat = reached_count > 0
        if is_flat:
            near = scratch.reached
            near_count = reached_count
        else:
            seeds = seeded(grid.halo, grid.positions, center, point, distance, scratch.reached)
            reached_count, near_count = march(
                grid.halo, grid.positions, seeds, _SEARCHED_RADII * radius, scratch
            )
            near = scratch.order
        end = begins[i]
        if end + near_count > len(texels):
            clean(scratch, reached_count)
            return i
        total = 0.0
        for k in range(near_count):
            t = near[k]
            away = distance[t]
            if not is_flat:
                away = _blended(away, distance_to(grid.positions, t, point))
            weight = max(1 - (away / radius) ** 2, 0.0) ** 3
            if weight > 0:
                texels[end] = t
                weights[end] = weight
                total += weight * grid.areas[t]
                end += 1
        clean(scratch, reached_count)
        for k in range(begins[i], end):
            weights[k] /= total
        begins[i + 1] = end
    return len(sources.centers)


@kernel(no_cpython_wrapper=True)
def _blended(along_surface: float, straight: float) -> float:
    """Blend the distance along the surface with the straight one [m], by the ratio of the two."""
    if not straight > 0:
        return along_surface
    beyond_flat = (along_surface / straight - _FLAT_RATIO) / (_BENT_RATIO - _FLAT_RATIO)
    bend = min(max(beyond_flat, 0.0), 1.0)
    bend = bend * bend * (3 - 2 * bend)  # without a kink at both ends
    return (1 - bend) * straight + bend * along_surface


@kernel(no_cpython_wrapper=True)
def _spacing(grid: TexelGrid, center: int) -> float:
    """Greatest distance from a texel to its four neighbours."""
    halo = grid.halo
    positions = grid.positions
    n = halo.shape[1] - 2
    chart = center // (n * n)
    row = center // n % n
    column = center % n
    greatest = 0.0
    for k in range(4):
        t = halo[chart, row + _ROWS_BESIDE[k], column + _COLUMNS_BESIDE[k]]
        if t >= 0:
            greatest = max(greatest, distance_to(positions, t, positions[center]))
    return greatest


@kernel(no_cpython_wrapper=True)
def _nearby(
    grid: TexelGrid, center: int, point: Floats, radius: float, distance: Floats, texels: Ints
) -> int:
    """Reach the connected texels within a straight distance of a point [m], if they lie flat.

    Returns the number of `texels` [T] that were reached: 0 if they do not lie flat. They lie flat
    if no normal is farther than acos(1/1.05) from the normal in the middle. The surface is then a
    graph over the tangent plane, and no path along it is longer than 1.05 times the straight
    distance.
    """
    halo = grid.halo
    positions = grid.positions
    normals = grid.normals
    n = halo.shape[1] - 2
    count = 1
    visited = 0
    texels[0] = center
    distance[center] = distance_to(positions, center, point)
    while visited < count:
        t = texels[visited]
        visited += 1
        if distance[t] > radius:
            continue
        cosine = 0.0
        for k in range(3):
            cosine += normals[t, k] * normals[center, k]
        if cosine * _FLAT_RATIO < 1:
            for i in range(count):
                distance[texels[i]] = np.inf
            return 0
        chart = t // (n * n)
        row = t // n % n
        column = t % n
        for i in range(3):
            for j in range(3):
                a = halo[chart, row + i, column + j]
                if a >= 0 and distance[a] == np.inf:
                    distance[a] = distance_to(positions, a, point)
                    texels[count] = a
                    count += 1
    return count


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

    The distance d is straight where the surface is nearly flat within the radius and runs along the
    surface where it is not, so that a source on one side of a thin part does not reach the other
    side.

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
        raise SolverError(
            f"impulse radius must be a finite number, 0 or greater, got {shown(radius)} m"
        )
    points = check_points(point)
    if len(points) != 1:
        raise SolverError(
            f"a source must have one point, [3], got {len(points)} points: call this once for "
            "each of them"
        )
    (closest,), (center,) = atlas.nearest(points)
    return footprint_at(atlas, closest, int(center), float(radius))


def footprint_at(atlas: Atlas, point: NDArray[np.float64], center: int, radius: float) -> Footprint:
    """The footprint round a point of the surface whose nearest texel is `center`.

    See `Atlas.nearest`.
    """
    _, texels, weights, radii = weigh_each(
        atlas.texels.grid, np.array([center]), point[None], np.array([radius])
    )
    return Footprint(texels, weights, center, point, float(radii[0]))


def spread(
    atlas: Atlas, name: str, value: float, unit: str, point: ArrayLike, radius: float
) -> tuple[Footprint, NDArray[np.float64]]:
    """Footprint of a point source, and the share of its value on each texel, [k].

    `name` and `unit` are those of the value, for messages.
    """
    require_finite(name, value, unit)
    where = footprint(atlas, point, radius)
    return where, value * (where.weights * atlas.areas.reshape(-1)[where.texels])
