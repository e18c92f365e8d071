"""Distance along the surface, by fast marching over the texels."""

from __future__ import annotations

import functools
import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Ints, kernel
from .texel_mesh import TexelMesh

# Rows and columns in a halo table of the eight neighbours of a texel, in order round it
_ROWS, _COLUMNS = np.array([1, 2, 2, 2, 1, 0, 0, 0]), np.array([2, 2, 1, 0, 0, 0, 1, 2])

# From one of them to those that share a triangle with it and the texel: the latter two only where it is straight ahead
_TURNS = np.array([-1, 1, -2, 2])


class Scratch(NamedTuple):
    """What marching over T texels writes; `clean` leaves it as it was, so that it costs no more on a larger grid.

    Attributes
    ----------
    distance : float64 [T]
        Infinite where a texel has not been reached.
    touched, order : int64 [T]
        Texels that have been reached, and those whose distance is known, nearest first.
    front, place : int64 [T]
        A heap of the texels that have been reached, the nearest first, and where in it each is, or -1.
    """

    distance: Floats
    touched: Ints
    order: Ints
    front: Ints
    place: Ints


def depth_in_region(texels: TexelMesh, region: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Distance of every texel of a region to the texels outside of it [m], [C, n, n]; 0 outside, at most 8 % too long.

    Infinite where there is no outside.
    """
    grid, scratch = texels.grid, _new_scratch(region.size)
    outside = np.flatnonzero(~region)
    scratch.distance[outside], scratch.touched[: len(outside)] = 0.0, outside
    march(grid.halo, grid.positions, len(outside), np.inf, scratch)
    return scratch.distance.reshape(region.shape)


def distance_scratch(size: int) -> Scratch:
    """Scratch that its users clean up. One for each thread."""
    return _distance_scratch(size, threading.get_ident())


@functools.lru_cache(maxsize=8)
def _distance_scratch(size: int, thread: int) -> Scratch:
    return _new_scratch(size)


def _new_scratch(size: int) -> Scratch:
    touched, order, front = np.empty((3, size), np.int64)
    return Scratch(np.full(size, np.inf), touched, order, front, np.full(size, -1))


@kernel(no_cpython_wrapper=True)
def _beside(positions: Floats, distance: Floats, around: Ints, k: int, t: int) -> float:
    """Distance at neighbour k of those round texel t, by way of that and of those beside it that are known.

    That of a point source, unfolded into the plane of a triangle, where the straight way crosses the edge between the
    two that are known (Novotni and Klein 2002).
    """
    s, dp = around[k], distance[t]
    best = dp + distance_to(positions, s, positions[t])
    for turn in range(4 if k % 2 == 0 else 2):
        q = around[(k + _TURNS[turn]) % 8]
        if q < 0 or distance[q] == np.inf:
            continue
        length2 = ps2 = along = 0.0
        for i in range(3):
            pq, ps = positions[q, i] - positions[t, i], positions[s, i] - positions[t, i]
            length2, ps2, along = length2 + pq * pq, ps2 + ps * ps, along + ps * pq
        length = np.sqrt(length2)
        if length == 0:
            continue
        along /= length
        above = np.sqrt(max(ps2 - along * along, 0.0))
        source_along = (dp * dp - distance[q] * distance[q] + length2) / (2 * length)
        below2 = dp * dp - source_along * source_along
        if below2 < 0:
            continue
        below = np.sqrt(below2)
        if above + below > 0:
            crossing = source_along + (along - source_along) * below / (above + below)
            if 0 <= crossing <= length:
                best = min(best, np.sqrt((along - source_along) ** 2 + (above + below) ** 2))
    return best


@kernel(no_cpython_wrapper=True)
def _comes_first(distance: Floats, a: int, b: int) -> bool:
    """Whether texel a is nearer than b; of two that are as near, the one of the lower index."""
    return distance[a] < distance[b] or (distance[a] == distance[b] and a < b)


@kernel(no_cpython_wrapper=True)
def _rise(front: Ints, place: Ints, distance: Floats, i: int, t: int) -> None:
    """Put a texel into the heap at place i, or nearer to the top."""
    while i > 0 and _comes_first(distance, t, front[(i - 1) // 2]):
        front[i] = front[(i - 1) // 2]
        place[front[i]] = i
        i = (i - 1) // 2
    front[i], place[t] = t, i


@kernel(no_cpython_wrapper=True)
def _sink(front: Ints, place: Ints, distance: Floats, count: int) -> None:
    """Take the first of `count` + 1 texels out of the heap."""
    t, i, child = front[count], 0, 1
    place[front[0]] = -1
    while child < count:
        if child + 1 < count and _comes_first(distance, front[child + 1], front[child]):
            child += 1
        if not _comes_first(distance, front[child], t):
            break
        front[i] = front[child]
        place[front[i]] = i
        i, child = child, 2 * child + 1
    if count > 0:
        front[i], place[t] = t, i


@kernel
def march(halo: Ints, positions: Floats, seeds: int, limit: float, scratch: Scratch) -> tuple[int, int]:
    """Fast marching with point-source updates over the triangles of both triangulations of every quad.

    The first of those `touched` are the seeds, whose distances are known; see `seeded`. Returns how many texels have
    been touched, and of how many within the limit the distance is now known.
    """
    n, distance, touched = halo.shape[1] - 2, scratch.distance, scratch.touched
    order, front, place = scratch.order, scratch.front, scratch.place
    around = np.empty(8, np.int64)
    count, known, waiting = seeds, 0, 0
    for i in range(seeds):
        _rise(front, place, distance, i, touched[i])
        waiting += 1
    while waiting > 0 and distance[front[0]] <= limit:
        t = front[0]
        waiting -= 1
        _sink(front, place, distance, waiting)
        order[known] = t
        known += 1
        chart, row, column = t // (n * n), t // n % n, t % n
        for k in range(8):
            around[k] = halo[chart, row + _ROWS[k], column + _COLUMNS[k]]
        for k in range(8):
            a = around[k]
            if a < 0 or (distance[a] < np.inf and place[a] < 0):  # none, or known
                continue
            best = _beside(positions, distance, around, k, t)
            if best < distance[a]:
                at = place[a]
                if at < 0:
                    touched[count] = a
                    count += 1
                    at = waiting
                    waiting += 1
                distance[a] = best
                _rise(front, place, distance, at, a)
    return count, known


@kernel
def seeded(halo: Ints, positions: Floats, center: int, point: Floats, distance: Floats, touched: Ints) -> int:
    """Touch the nine texels round the one nearest to a point, at their straight distances from it; return how many."""
    n = halo.shape[1] - 2
    chart, row, column = center // (n * n), center // n % n, center % n
    seeds = 0
    for i in range(3):
        for j in range(3):
            t = halo[chart, row + i, column + j]
            # beyond a rim the halo shows the texel beside it once more
            if t >= 0 and distance[t] == np.inf:
                touched[seeds], distance[t] = t, distance_to(positions, t, point)
                seeds += 1
    return seeds


@kernel
def clean(distance: Floats, place: Ints, touched: Ints, count: int) -> None:
    """Leave a scratch as if so many texels had not been touched."""
    for i in range(count):
        distance[touched[i]], place[touched[i]] = np.inf, -1


@kernel
def distance_to(positions: Floats, t: int, point: Floats) -> float:
    """Straight distance of texel t from a point [m]."""
    x, y, z = positions[t, 0] - point[0], positions[t, 1] - point[1], positions[t, 2] - point[2]
    return np.sqrt(x * x + y * y + z * z)
