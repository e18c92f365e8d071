"""Several substeps of a plain material in one pass over the memory.

A chart whose fields outgrow the processor's caches is read from memory once a substep by a loop over its texels, and
waits for that. Here a front runs over the rows of a chart: the first substep of a row is followed by the second of the
row before, and so on, while all of them lie in the cache. A texel can get its substep s that way where it lies s or
more texels from the chart's border. What is left, a band along the borders, is then closed substep by substep, with the
halo filled before each. Two fields of heights are enough: a texel that is s steps far has its heights of s - 1 in the
other one, and these are what its neighbour in the band reads.

Every texel is computed once, by the code of the plain pass: the numbers are the same, bit for bit.

Threads that share out the charts among them, without the interpreter; see `blocks`.
"""

from __future__ import annotations

import functools
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.extending import intrinsic

from ..kernel import Ints, kernel
from ..texels.stencil import IrregularLinks
from .kernels import drift_row, fill, kick_drift_row, kick_drift_sides, kick_irregular
from .stencil_loops import Drift, Halo, Kick, Loads, State

# Bytes of a texel in all fields that a substep reads or writes, and of the cache that the rows of a front may take.
_TEXEL, _CACHE = 32, 2**19

# Charts of fewer texels than this along a side for each substep are mostly bands.
_SIDE = 16


def block_length(n: int, pitch: int) -> int:
    """How many substeps one pass over charts of n x n texels, in rows of `pitch`, takes at most: 1 is a plain pass."""
    return max(min(n // _SIDE, _CACHE // (_TEXEL * pitch) - 2), 1)


class Pace(NamedTuple):
    """Substeps of a pass: how many, by how much [s] all but the last drift, and the last one."""

    steps: int
    dt: np.float32
    last: np.float32


def on_borders(links: IrregularLinks | None, n: int) -> bool:
    """Whether all irregular links are between texels on the borders of charts of n x n texels."""
    if links is None:
        return True
    r, c = links.texels // n % n, links.texels % n
    return bool((np.minimum(np.minimum(r, c), n - 1 - np.maximum(r, c)) == 0).all())


@kernel
def passes(substeps: int, most: int) -> list[tuple[int, int]]:
    """Share substeps out evenly: how many are taken before each pass, and how many the pass takes."""
    count = -(-substeps // most)
    begins = [substeps * i // count for i in range(count + 1)]
    return [(begins[i], begins[i + 1] - begins[i]) for i in range(count)]


@kernel
def climb(pace: Pace, state: State, start: Drift, kick: Kick, loads: Loads, chart: int) -> None:
    """Substeps of all texels of a chart that lie far enough from its border; all its texels drift first, by `start`."""
    steps, dt, last = pace
    n = state.h.shape[1] - 2
    there_and_back = State(state.h_next, state.v, state.h)
    for front in range(n):
        if start.dt:
            drift_row(state.h, state.v, start, chart, front + 1)
        for step in range(1, steps + 1):
            r = front - step + 1
            if step < r <= n - step:
                here = state if step % 2 else there_and_back
                drifted = dt if step < steps else last
                kick_drift_row(here, kick, drifted, chart, r, step + 1, n - step)
                if len(loads.addresses):
                    _kick_row(here, loads, drifted, chart, r, step + 1, n - step)


@kernel
def close(pace: Pace, state: State, halo: Halo, kick: Kick, loads: Loads) -> None:
    """The same substeps of the texels near the borders, after `climb` of every chart."""
    steps, dt, last = pace
    h, v, h_next = state
    n = h.shape[1] - 2
    for step in range(1, steps + 1):
        drifted = dt if step < steps else last
        here = State(h, v, h_next)
        fill(h, halo)
        for chart in range(len(h)):
            for i in range(2 * step):
                r = i + 1 if i < step else n - 2 * step + i + 1
                kick_drift_row(here, kick, drifted, chart, r, 1, n)
            kick_drift_sides(here, kick, drifted, chart, step)
        kick_irregular(here, kick, drifted)
        _kick_band(here, loads, drifted, step)
        h, h_next = h_next, h


@kernel
def _kick_row(state: State, loads: Loads, dt: np.float32, chart: int, r: int, first: int, last: int) -> None:
    """Kick the loaded texels in columns first to last of a row, and drift them by that."""
    rows, pitch = state.h.shape[1:]
    start = (chart * rows + r) * pitch
    velocity, height = state.v[chart, r], state.h_next[chart, r]
    begin = np.searchsorted(loads.addresses, start + first)
    end = np.searchsorted(loads.addresses, start + last, side="right")
    for i in range(begin, end):
        c = loads.addresses[i] - start
        velocity[c] += loads.kicks[i]
        height[c] += dt * loads.kicks[i]


@kernel
def _kick_band(state: State, loads: Loads, dt: np.float32, width: int) -> None:
    """Kick the loaded texels that lie less than a width from a chart's border, and drift them by that."""
    rows, pitch = state.h.shape[1:]
    velocities, heights = state.v.reshape(-1), state.h_next.reshape(-1)
    for i in range(len(loads.addresses)):
        address = loads.addresses[i]
        r, c = address // pitch % rows, address % pitch
        if min(r, c, rows - 1 - r, rows - 1 - c) <= width:
            velocities[address] += loads.kicks[i]
            heights[address] += dt * loads.kicks[i]


# Counters, each in a cache line of its own: tickets drawn, charts done, passes open.
_DRAWN, _DONE, _OPEN, _COUNTERS = 0, 16, 32, 48

_MOST = 6  # more threads than this wait for memory


def available() -> int:
    """How many threads can be of use on this machine."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(cores, _MOST)


class Plan(NamedTuple):
    """How many substeps to take, of which length [s], and how many a pass may take."""

    substeps: int
    most: int
    dt: np.float32


def advance(threads: int, plan: Plan, *fields: Any) -> None:
    """Substeps of dt, from the first half drift to the last; the height ends in `h_next` where their number is odd.

    Nobody waits for a thread that has not yet taken a chart: a late one leaves its share to the others.
    Every texel is computed by the same code whatever the thread, so the numbers do not depend on how many there are.
    """
    share = functools.partial(_advance, plan, *fields, np.zeros(_COUNTERS, np.int64))
    helpers = [_pool().submit(share) for _ in range(threads - 1)]
    share()
    for helper in helpers:
        helper.cancel()


@functools.cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_MOST - 1, thread_name_prefix="waves")


_yield_core = numba.types.ExternalFunction("sched_yield", numba.types.int32())


@intrinsic
def _add(context, counters, which, amount):
    """Add to a counter atomically, and return its old value."""

    def generate(context, builder, signature, arguments):
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        place = builder.gep(array.data, [arguments[1]])
        return builder.atomic_rmw("add", place, arguments[2], "seq_cst")

    return numba.types.int64(counters, numba.types.int64, numba.types.int64), generate


@kernel
def _advance(
    plan: Plan,
    state: State,
    halo: Halo,
    kick: Kick,
    loads: Loads,
    start: Drift,
    counters: Ints,
) -> None:
    """Loop of every thread: draw a ticket for a chart of a pass, wait until that pass is open, climb over the chart.

    Whoever finishes the last chart of a pass closes it, and opens the next one.
    """
    substeps, most, dt = plan.substeps, plan.most, plan.dt
    h, v, h_next = state
    charts, taken = len(h), passes(substeps, most)
    still = Drift(start.columns, start.response, start.shift, np.float32(0))
    while True:
        ticket = _add(counters, _DRAWN, 1)
        if ticket >= charts * len(taken):
            break
        turn, chart = ticket // charts, ticket % charts
        before, steps = taken[turn]
        while _add(counters, _OPEN, 0) < turn:
            _yield_core()
        here = state if before % 2 == 0 else State(h_next, v, h)
        pace = Pace(steps, dt, dt if before + steps < substeps else dt / np.float32(2))
        climb(pace, here, start if before == 0 else still, kick, loads, chart)
        if _add(counters, _DONE, 1) == charts * (turn + 1) - 1:
            close(pace, here, halo, kick, loads)
            _add(counters, _OPEN, 1)
    while _add(counters, _OPEN, 0) < len(taken):
        _yield_core()
