"""Distance along the surface, by fast marching over the texels."""

from __future__ import annotations

import functools
import threading
from heapq import heapify, heappop, heappush
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import Bools, Floats, Ints, kernel
from .texel_mesh import TexelMesh

# Rows and columns in a halo table of the eight neighbours of a texel, in order round it.
_ROWS = np.array([1, 2, 2, 2, 1, 0, 0, 0])
_COLUMNS = np.array([2, 2, 1, 0, 0, 0, 1, 2])

# Steps round a texel from one neighbour to those that share a triangle with both: the last two only
# if the neighbour lies straight ahead rather than across a corner.
_TURNS = np.array([-1, 1, -2, 2])


class Scratch(NamedTuple):
    """Arrays that marching over T texels writes.

    `clean` resets the texels that were touched, so that a march costs no more on a larger grid.

    Attributes
    ----------
    distance : float64 [T]
        Infinite where a texel has not been reached.
    touched, order : int64 [T]
        Texels that have been reached, and texels whose distance is known, nearest first.
    known : bool [T]
        Whether the distance of a texel is known.
    """

    distance: Floats
    touched: Ints
    order: Ints
    known: Bools


def depth_in_region(texels: TexelMesh, region: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Distance of every texel of a region to the texels outside of it [m], [C, n, n].

    At most 8 % too long; 0 outside, and infinite where there is no outside.
    """
    grid = texels.grid
    scratch = distance_scratch(region.size)
    outside = np.flatnonzero(~region)
    scratch.distance[outside] = 0.0
    scratch.touched[: len(outside)] = outside
    count, _ = march(grid.halo, grid.positions, len(outside), np.inf, scratch)
    depth = scratch.distance.reshape(region.shape).copy()
    clean(scratch, count)
    return depth


def distance_scratch(size: int) -> Scratch:
    """Scratch arrays for a number of texels, one for each thread; whoever uses them cleans them."""
    return _distance_scratch(size, threading.get_ident())


@functools.lru_cache(maxsize=8)
def _distance_scratch(size: int, thread: int) -> Scratch:
    touched, order = np.empty((2, size), np.int64)
    return Scratch(np.full(size, np.inf), touched, order, np.zeros(size, bool))


@kernel(no_cpython_wrapper=True)
def _beside(positions: Floats, distance: Floats, around: Ints, k: int, t: int) -> float:
    """Distance at the k-th neighbour round texel t, by way of t and a third texel that is known.

    It is the distance of a point source, unfolded into the plane of a triangle, if the straight way
    crosses the edge between the two known texels (Novotni and Klein 2002).
    """
    s = around[k]
    dp = distance[t]
    best = dp + distance_to(positions, s, positions[t])
    for turn in range(4 if k % 2 == 0 else 2):
        q = around[(k + _TURNS[turn]) % 8]
        if q < 0 or distance[q] == np.inf:
            continue
        length2 = ps2 = along = 0.0
        for i in range(3):
            pq = positions[q, i] - positions[t, i]
            ps = positions[s, i] - positions[t, i]
            length2 = length2 + pq * pq
            ps2 = ps2 + ps * ps
            along = along + ps * pq
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


@kernel
def march(
    halo: Ints, positions: Floats, seeds: int, limit: float, scratch: Scratch
) -> tuple[int, int]:
    """Fast marching over the triangles of both triangulations of every quad.

    Updates are those of point sources. The first of the `touched` texels are the seeds, whose
    distances are known; see `seeded`. Returns the number of texels that have been touched, and the
    number of texels within the limit whose distance is now known.
    """
    distance = scratch.distance
    touched = scratch.touched
    order = scratch.order
    done = scratch.known
    n = halo.shape[1] - 2
    around = np.empty(8, np.int64)
    count = seeds
    known = 0
    # texels that wait, the nearest first, and of two at one distance the one of the lower index; a
    # texel that came nearer waits more than once
    front = [(distance[t], t) for t in touched[:seeds]]
    heapify(front)
    while len(front) > 0 and front[0][0] <= limit:
        t = heappop(front)[1]
        if done[t]:
            continue
        order[known] = t
        done[t] = True
        known += 1
        chart = t // (n * n)
        row = t // n % n
        column = t % n
        for k in range(8):
            around[k] = halo[chart, row + _ROWS[k], column + _COLUMNS[k]]
        for k in range(8):
            a = around[k]
            if a < 0 or done[a]:
                continue
            best = _beside(positions, distance, around, k, t)
            if best < distance[a]:
                if distance[a] == np.inf:
                    touched[count] = a
                    count += 1
                distance[a] = best
                heappush(front, (best, a))
    return count, known


@kernel
def seeded(
    halo: Ints, positions: Floats, center: int, point: Floats, distance: Floats, touched: Ints
) -> int:
    """Touch the nine texels round the one nearest to a point, at their straight distances.

    Returns how many there are.
    """
    n = halo.shape[1] - 2
    chart = center // (n * n)
    row = center // n % n
    column = center % n
    seeds = 0
    for i in range(3):
        for j in range(3):
            t = halo[chart, row + i, column + j]
            # beyond a rim the halo shows the texel beside it once more
            if t >= 0 and distance[t] == np.inf:
                touched[seeds] = t
                distance[t] = distance_to(positions, t, point)
                seeds += 1
    return seeds


@kernel
def clean(scratch: Scratch, count: int) -> None:
    """Reset the texels that were touched, `count` of them."""
    for i in range(count):
        scratch.distance[scratch.touched[i]] = np.inf
        scratch.known[scratch.touched[i]] = False


@kernel(no_cpython_wrapper=True)
def distance_to(positions: Floats, t: int, point: Floats) -> float:
    """Straight distance of texel t from a point [m]."""
    x = positions[t, 0] - point[0]
    y = positions[t, 1] - point[1]
    z = positions[t, 2] - point[2]
    return np.sqrt(x * x + y * y + z * z)
