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

# Steps round a texel from one of the eight neighbours to those that share a triangle with both. The
# last two do so only if the neighbour lies straight ahead rather than across a corner.
_TURNS = np.array([-1, 1, -2, 2])


class Scratch(NamedTuple):
    """Arrays that marching over T texels writes.

    `clean` resets the texels that were reached, so that a march costs no more on a larger grid.

    Attributes
    ----------
    distance : float64 [T]
        Distance [m]; infinite where a texel has not been reached.
    reached : int64 [T]
        Texels that have been reached: they have a distance, which may still become less.
    order : int64 [T]
        Texels whose distance is final, nearest first.
    is_final : bool [T]
        Whether the distance of a texel is final.
    """

    distance: Floats
    reached: Ints
    order: Ints
    is_final: Bools


def depth_in_region(texels: TexelMesh, region: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Distance of every texel of a region to the texels outside of it [m], [C, n, n].

    At most 8 % too long; 0 outside, and infinite where there is no outside.
    """
    grid = texels.grid
    scratch = distance_scratch(region.size)
    outside = np.flatnonzero(~region)
    scratch.distance[outside] = 0.0
    scratch.reached[: len(outside)] = outside
    reached_count, _ = march(grid.halo, grid.positions, len(outside), np.inf, scratch)
    depth = scratch.distance.reshape(region.shape).copy()
    clean(scratch, reached_count)
    return depth


def distance_scratch(size: int) -> Scratch:
    """Scratch arrays for so many texels, of this thread alone; call `clean` after a march."""
    return _distance_scratch(size, threading.get_ident())


@functools.lru_cache(maxsize=8)
def _distance_scratch(size: int, thread: int) -> Scratch:
    return Scratch(
        distance=np.full(size, np.inf),
        reached=np.empty(size, np.int64),
        order=np.empty(size, np.int64),
        is_final=np.zeros(size, bool),
    )


@kernel(no_cpython_wrapper=True)
def _distance_by_way_of(positions: Floats, distance: Floats, around: Ints, k: int, t: int) -> float:
    """Distance [m] at neighbour k of texel t, by way of t and of a third texel q with a distance.

    The source is unfolded into the plane of the triangle of the three texels, where its distances
    from t and from q put it. The straight way to the neighbour counts if it crosses the edge
    between t and q (Novotni and Klein 2002). Otherwise the way leads through t.

    `around` [8] are the neighbours of t, in order round it. Places in the plane have a coordinate
    along the edge, from t, and one across it: the neighbour lies above the edge, and the source
    below.
    """
    neighbour = around[k]
    best = distance[t] + distance_to(positions, neighbour, positions[t])
    turns = 4 if k % 2 == 0 else 2
    for turn in range(turns):
        q = around[(k + _TURNS[turn]) % 8]
        if q < 0 or distance[q] == np.inf:
            continue
        edge_squared = 0.0
        way_squared = 0.0
        way_times_edge = 0.0
        for i in range(3):
            edge = positions[q, i] - positions[t, i]
            way = positions[neighbour, i] - positions[t, i]
            edge_squared = edge_squared + edge * edge
            way_squared = way_squared + way * way
            way_times_edge = way_times_edge + way * edge
        edge_length = np.sqrt(edge_squared)
        if edge_length == 0:
            continue
        along = way_times_edge / edge_length
        above = np.sqrt(max(way_squared - along * along, 0.0))
        t_squared = distance[t] * distance[t]
        q_squared = distance[q] * distance[q]
        source_along = (t_squared - q_squared + edge_squared) / (2 * edge_length)
        below_squared = t_squared - source_along * source_along
        if below_squared < 0:
            continue
        below = np.sqrt(below_squared)
        across = above + below
        if across > 0:
            crossing = source_along + (along - source_along) * below / across
            if 0 <= crossing <= edge_length:
                best = min(best, np.sqrt((along - source_along) ** 2 + across**2))
    return best


@kernel
def march(
    halo: Ints, positions: Floats, seeds: int, limit: float, scratch: Scratch
) -> tuple[int, int]:
    """Fast marching over the triangles of both triangulations of every quad, up to a limit [m].

    Updates are those of point sources. The first `seeds` of the `reached` texels are the seeds,
    which have distances already; see `seeded`. Returns the number of texels that have been reached,
    and the number of texels within the limit, whose distance is now final.
    """
    distance = scratch.distance
    reached = scratch.reached
    is_final = scratch.is_final
    n = halo.shape[1] - 2
    around = np.empty(8, np.int64)
    reached_count = seeds
    final_count = 0
    # texels that wait, the nearest first, and of two at one distance the one of the lower index; a
    # texel that came nearer waits more than once
    front = [(distance[t], t) for t in reached[:seeds]]
    heapify(front)
    while len(front) > 0 and front[0][0] <= limit:
        t = heappop(front)[1]
        if is_final[t]:
            continue
        scratch.order[final_count] = t
        is_final[t] = True
        final_count += 1
        chart = t // (n * n)
        row = t // n % n
        column = t % n
        for k in range(8):
            around[k] = halo[chart, row + _ROWS[k], column + _COLUMNS[k]]
        for k in range(8):
            neighbour = around[k]
            if neighbour < 0 or is_final[neighbour]:
                continue
            shorter = _distance_by_way_of(positions, distance, around, k, t)
            if shorter < distance[neighbour]:
                if distance[neighbour] == np.inf:
                    reached[reached_count] = neighbour
                    reached_count += 1
                distance[neighbour] = shorter
                heappush(front, (shorter, neighbour))
    return reached_count, final_count


@kernel
def seeded(
    halo: Ints, positions: Floats, center: int, point: Floats, distance: Floats, reached: Ints
) -> int:
    """Reach the nine texels round the one nearest to a point, at their straight distances [m].

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
                reached[seeds] = t
                distance[t] = distance_to(positions, t, point)
                seeds += 1
    return seeds


@kernel
def clean(scratch: Scratch, count: int) -> None:
    """Reset the texels that were reached, `count` of them."""
    for i in range(count):
        t = scratch.reached[i]
        scratch.distance[t] = np.inf
        scratch.is_final[t] = False


@kernel(no_cpython_wrapper=True)
def distance_to(positions: Floats, t: int, point: Floats) -> float:
    """Straight distance of texel t from a point [m]."""
    x = positions[t, 0] - point[0]
    y = positions[t, 1] - point[1]
    z = positions[t, 2] - point[2]
    return np.sqrt(x * x + y * y + z * z)
