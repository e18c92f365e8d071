"""The footprint of a source: smooth weights on the texels within a radius, measured along the surface."""

from __future__ import annotations

import dataclasses
import heapq

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .atlas import Atlas, check_points
from .cubemap import padded_indices
from .errors import SolverError

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
    closest, _ = atlas.project(check_points(point)[:1])
    center = int(atlas.nearest_texel(closest)[0])
    face, row, column = np.unravel_index(center, (6, n, n))
    block = atlas.padded_positions[face, row : row + 3, column : column + 3]
    spacing = np.nanmax(np.linalg.norm(block[[0, 1, 1, 2], [1, 0, 2, 1]] - block[1, 1], axis=1))
    radius = max(float(radius), MIN_TEXELS * float(spacing))
    texels, along = _distances(padded_indices(n), atlas.positions.reshape(-1, 3), center, closest[0], 1.1 * radius)
    straight = np.linalg.norm(atlas.positions.reshape(-1, 3)[texels] - closest[0], axis=1)
    bend = np.clip((along / np.maximum(straight, 1e-300) - _FLAT) / (_BENT - _FLAT), 0, 1)
    bend = np.where(straight > 0, bend * bend * (3 - 2 * bend), 0)
    distance = (1 - bend) * straight + bend * along
    weights = np.maximum(1 - (distance / radius) ** 2, 0) ** 3
    inside = weights > 0
    texels, weights = texels[inside], weights[inside]
    weights /= (weights * atlas.areas.reshape(-1)[texels]).sum()
    return Footprint(texels, weights, center, closest[0], radius)


def _distances(
    index: NDArray[np.int64], positions: NDArray[np.float64], center: int, point: NDArray[np.float64], limit: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Texels within `limit` of the point along the surface, ascending, and their distances [m]."""
    distance = np.full(len(positions), np.inf)
    texels = _march(index, positions, center, point, limit, distance)
    texels.sort()
    return texels, distance[texels]


@numba.njit(cache=True)
def _through(p, q, s, dp, dq):
    """Distance at s of a point source that is dp from p and dq from q, unfolded into the plane of the triangle.

    Infinite if the straight way does not cross the edge pq (Novotni and Klein 2002).
    """
    length2 = (q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2 + (q[2] - p[2]) ** 2
    length = np.sqrt(length2)
    if length == 0:
        return np.inf
    along = ((s[0] - p[0]) * (q[0] - p[0]) + (s[1] - p[1]) * (q[1] - p[1]) + (s[2] - p[2]) * (q[2] - p[2])) / length
    ps2 = (s[0] - p[0]) ** 2 + (s[1] - p[1]) ** 2 + (s[2] - p[2]) ** 2
    above = np.sqrt(max(ps2 - along * along, 0.0))
    source_along = (dp * dp - dq * dq + length2) / (2 * length)
    below2 = dp * dp - source_along * source_along
    if below2 < 0:
        return np.inf
    below = np.sqrt(below2)
    if above + below == 0:
        return np.inf
    crossing = source_along + (along - source_along) * below / (above + below)
    if crossing < 0 or crossing > length:
        return np.inf
    return np.sqrt((along - source_along) ** 2 + (above + below) ** 2)


@numba.njit(cache=True)
def _march(index, positions, center, point, limit, distance):
    """Fast marching with point-source updates over the triangles of both triangulations of every quad."""
    n = index.shape[1] - 2
    # the eight neighbours in order round a texel
    ring_row = (0, 1, 1, 1, 0, -1, -1, -1)
    ring_column = (1, 1, 0, -1, -1, -1, 0, 1)
    around = np.empty(8, np.int64)
    done = set()
    front = [(0.0, center)]
    front.pop()
    face, row, column = center // (n * n), center // n % n, center % n
    for dr in range(3):
        for dc in range(3):
            t = index[face, row + dr, column + dc]
            if t >= 0:
                d = np.sqrt(
                    (positions[t, 0] - point[0]) ** 2
                    + (positions[t, 1] - point[1]) ** 2
                    + (positions[t, 2] - point[2]) ** 2
                )
                distance[t] = d
                heapq.heappush(front, (d, t))
    order = [center]
    order.pop()
    while len(front) > 0:
        d, t = heapq.heappop(front)
        if d > limit:
            break
        if t in done:
            continue
        done.add(t)
        order.append(t)
        face, row, column = t // (n * n), t // n % n, t % n
        for k in range(8):
            around[k] = index[face, row + 1 + ring_row[k], column + 1 + ring_column[k]]
        for k in range(8):
            a = around[k]
            if a < 0 or a in done:
                continue
            dx, dy, dz = (
                positions[a, 0] - positions[t, 0],
                positions[a, 1] - positions[t, 1],
                positions[a, 2] - positions[t, 2],
            )
            best = d + np.sqrt(dx * dx + dy * dy + dz * dz)
            # triangles (t, b, a): b one step round the ring, or two where a is straight ahead (the other diagonal)
            for turn in (-2, -1, 1, 2):
                if (turn == 2 or turn == -2) and k % 2 == 1:
                    continue
                b = around[(k + turn) % 8]
                if b >= 0 and distance[b] < np.inf:
                    best = min(best, _through(positions[t], positions[b], positions[a], d, distance[b]))
            if best < distance[a]:
                distance[a] = best
                heapq.heappush(front, (best, a))
    return np.array(order)
