"""Threads that share out the charts of each substep among them, without the interpreter."""

from __future__ import annotations

import functools
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numba
import numpy as np
from numba.extending import intrinsic

from ripple_sim.solver.kernel import Ints, kernel

from .arguments import Halo, Kick, Loads, State
from .kernels import fill, kick_drift, kick_irregular, kick_texels

# Counters, each in a cache line of its own: tickets drawn, charts done, substeps open.
_DRAWN, _DONE, _OPEN, _COUNTERS = 0, 16, 32, 48

_MOST = 6  # more threads than this wait for memory


def available() -> int:
    """How many threads can be of use on this machine."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(cores, _MOST)


def advance(threads: int, substeps: int, *fields: Any) -> None:
    """`kernels.advance` of a plain material, in several threads; the height's halo is filled already.

    Nobody waits for a thread that has not yet taken a chart: a late one leaves its share to the others.
    Every texel is computed by the same code whatever the thread, so the numbers do not depend on how many there are.
    """
    share = functools.partial(_advance, substeps, *fields, np.zeros(_COUNTERS, np.int64))
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
def _advance(substeps: int, dt: np.float32, state: State, halo: Halo, kick: Kick, loads: Loads, counters: Ints) -> None:
    """Loop of every thread: draw a ticket for a chart of a substep, wait until that substep is open, and compute it.

    Whoever finishes the last chart of a substep opens the next one.
    """
    half = dt / np.float32(2)
    h, v, h_next = state
    charts = len(h)
    while True:
        ticket = _add(counters, _DRAWN, 1)
        if ticket >= charts * substeps:
            break
        step, chart = ticket // charts, ticket % charts
        while _add(counters, _OPEN, 0) < step:
            _yield_core()
        here, there = (h, h_next) if step % 2 == 0 else (h_next, h)
        drifted = dt if step < substeps - 1 else half
        kick_drift(State(here, v, there), kick, drifted, chart, chart + 1)
        if _add(counters, _DONE, 1) == charts * (step + 1) - 1:
            kick_irregular(State(here, v, there), kick, drifted)
            kick_texels(there, v, loads, drifted)
            fill(there, halo)
            _add(counters, _OPEN, 1)
    while _add(counters, _OPEN, 0) < substeps:
        _yield_core()
