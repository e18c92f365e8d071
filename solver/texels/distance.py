"""Distance along the surface, by fast marching over the texels."""

from __future__ import annotations

import functools
import heapq
import threading

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Ints, kernel
from .texel_mesh import TexelMesh


def depth_in_region(texels: TexelMesh, region: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Distance of every texel of a region to the texels outside of it [m], [C, n, n]; 0 outside, at most 8 % too long.

    Infinite where there is no outside.
    """
    grid = texels.grid
    outside = np.flatnonzero(~region)
    distance = np.full(len(grid.positions), np.inf)
    distance[outside] = 0.0
    if len(outside):
        march(grid.halo, grid.positions, outside, np.inf, distance)
    return distance.reshape(region.shape)


def distance_scratch(size: int) -> NDArray[np.float64]:
    """Scratch that its users clean up, so that a footprint costs no more on a larger grid. One for each thread."""
    return _distance_scratch(size, threading.get_ident())


@functools.lru_cache(maxsize=8)
def _distance_scratch(size: int, thread: int) -> NDArray[np.float64]:
    return np.full(size, np.inf)


@kernel
def _through(positions: Floats, p: int, q: int, s: int, dp: float, dq: float) -> float:
    """Distance at s of a point source that is dp from p and dq from q, unfolded into the plane of the triangle.

    Infinite if the straight way does not cross the edge pq (Novotni and Klein 2002).
    """
    length2 = ps2 = along = 0.0
    for k in range(3):
        pq, ps = positions[q, k] - positions[p, k], positions[s, k] - positions[p, k]
        length2, ps2, along = length2 + pq * pq, ps2 + ps * ps, along + ps * pq
    length = np.sqrt(length2)
    if length == 0:
        return np.inf
    along /= length
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


@kernel
def _beside(positions: Floats, distance: Floats, around: Ints, k: int, t: int, d: float) -> float:
    """Distance at neighbour k of those round a texel, which is d away, by way of it and of those that are known."""
    a = around[k]
    best = d + distance_to(positions, a, positions[t])
    # triangles (t, b, a): b one step round the texel, or two where a is straight ahead (the other diagonal)
    for turn in (-2, -1, 1, 2):
        b = around[(k + turn) % 8]
        if b >= 0 and distance[b] < np.inf and (turn % 2 or k % 2 == 0):
            best = min(best, _through(positions, t, b, a, d, distance[b]))
    return best


@kernel
def march(halo: Ints, positions: Floats, seeds: Ints, limit: float, distance: Floats) -> tuple[Ints, Ints]:
    """Fast marching with point-source updates over the triangles of both triangulations of every quad.

    `distance` holds the seeds' distances, and infinity elsewhere. Returns the texels within the limit in the order of
    their distances, and those whose entry in `distance` was written.
    """
    n = halo.shape[1] - 2
    # the eight neighbours in order round a texel
    neighbour_row = (0, 1, 1, 1, 0, -1, -1, -1)
    neighbour_column = (1, 1, 0, -1, -1, -1, 0, 1)
    around = np.empty(8, np.int64)
    done = np.zeros(len(distance), np.bool_)
    front = [(distance[seeds[0]], seeds[0])]
    for t in seeds[1:]:
        heapq.heappush(front, (distance[t], t))
    order = [seeds[0]]
    order.pop()
    touched = list(seeds)
    while len(front) > 0:
        d, t = heapq.heappop(front)
        if d > limit:
            break
        if done[t]:
            continue
        done[t] = True
        order.append(t)
        chart, row, column = t // (n * n), t // n % n, t % n
        for k in range(8):
            around[k] = halo[chart, row + 1 + neighbour_row[k], column + 1 + neighbour_column[k]]
        for k in range(8):
            a = around[k]
            if a < 0 or done[a]:
                continue
            best = _beside(positions, distance, around, k, t, d)
            if best < distance[a]:
                if distance[a] == np.inf:
                    touched.append(a)
                distance[a] = best
                heapq.heappush(front, (best, a))
    return np.array(order), np.array(touched)


@kernel
def march_from_point(
    halo: Ints, positions: Floats, center: int, point: Floats, limit: float, scratch: Floats
) -> tuple[Ints, Floats]:
    """Texels within a distance along the surface of a point, nearest first, and their distances.

    The nine texels round the point's nearest one are taken straight.
    """
    n = halo.shape[1] - 2
    chart, row, column = center // (n * n), center // n % n, center % n
    seeds = np.empty(9, np.int64)
    count = 0
    for i in range(3):
        for j in range(3):
            t = halo[chart, row + i, column + j]
            # beyond a rim the halo shows the texel beside it once more
            if t >= 0 and scratch[t] == np.inf:
                seeds[count] = t
                scratch[t] = distance_to(positions, t, point)
                count += 1
    texels, touched = march(halo, positions, seeds[:count], limit, scratch)
    return texels, taken(scratch, texels, touched)


@kernel
def taken(scratch: Floats, texels: Ints, touched: Ints) -> Floats:
    """The scratch's distances at some texels; it is then infinite again wherever it was touched."""
    distance = np.empty(len(texels))
    for i in range(len(texels)):
        distance[i] = scratch[texels[i]]
    for i in range(len(touched)):
        scratch[touched[i]] = np.inf
    return distance


@kernel
def distance_to(positions: Floats, t: int, point: Floats) -> float:
    """Straight distance of texel t from a point [m]."""
    x, y, z = positions[t, 0] - point[0], positions[t, 1] - point[1], positions[t, 2] - point[2]
    return np.sqrt(x * x + y * y + z * z)
