"""Threads that share out the charts among them, without the interpreter; see `blocks`."""

from __future__ import annotations

import functools
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.extending import intrinsic

from ..kernel import Ints, kernel
from .arguments import Drift, Halo, Kick, Loads, State
from .blocks import Pace, climb, close, passes

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
