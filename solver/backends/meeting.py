"""Meetings of the threads that take a wave step together.

Each thread runs the same kernel without the interpreter's lock. At a meeting a thread waits until
all threads have come. If each thread has its own core, a meeting takes a microsecond, a fiftieth
of the time of Python's `threading.Barrier`.
"""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from ..kernel import Ints, kernel

# A waiting thread reads the counter this often, for a few microseconds in all, before it gives its
# core to others.
_EAGER_LOOKS = 5_000

_ARRIVALS = 0  # element that counts how often threads have come to a meeting
_ABANDONED = 1  # element that is not 0 if a thread will never come

# Gives the core to another thread: a function of the system's library.
_give_way = types.ExternalFunction(
    "SwitchToThread" if os.name == "nt" else "sched_yield", types.int32()
)


class Crew(NamedTuple):
    """The threads that take a step together, from the view of one thread."""

    rank: int  # number of this thread, from 0
    size: int  # number of threads
    counters: Ints  # shared by all threads, [2]


def alone() -> Crew:
    """The crew of one thread."""
    return Crew(rank=0, size=1, counters=np.zeros(2, np.int64))


def abandon(counters: Ints) -> None:
    """End all waiting, because a thread will not come."""
    counters[_ABANDONED] = 1


def _pointer(context: Any, builder: ir.IRBuilder, array_type: Any, array: Any, index: Any) -> Any:
    """Address of an element of an int64 array, in compiled code."""
    data = context.make_array(array_type)(context, builder, array).data
    return builder.gep(data, [index])


@intrinsic
def _add_one(typing_context, counters, index):
    """Add 1 to an element atomically, and return its former value."""

    def code(context, builder, signature, arguments):
        place = _pointer(context, builder, signature.args[0], *arguments)
        return builder.atomic_rmw("add", place, ir.Constant(ir.IntType(64), 1), "seq_cst")

    return types.int64(counters, types.intp), code


@intrinsic
def _look(typing_context, counters, index):
    """Read an element from memory, with all writes of other threads before its last change."""

    def code(context, builder, signature, arguments):
        place = _pointer(context, builder, signature.args[0], *arguments)
        return builder.load_atomic(place, "acquire", 8)

    return types.int64(counters, types.intp), code


@kernel(no_cpython_wrapper=True)
def meet(crew: Crew) -> bool:
    """Wait until all threads have come to this meeting; False if the step is abandoned."""
    if crew.size == 1:
        return True
    meetings_before = _add_one(crew.counters, _ARRIVALS) // crew.size
    all_arrivals = (meetings_before + 1) * crew.size
    looks = 0
    while _look(crew.counters, _ARRIVALS) < all_arrivals:
        if _look(crew.counters, _ABANDONED) != 0:
            return False
        looks += 1
        if looks > _EAGER_LOOKS:
            _give_way()
    return True


@kernel(no_cpython_wrapper=True)
def share(count: int, crew: Crew) -> tuple[int, int]:
    """First and last + 1 of this thread's items of `count`; the shares differ by one at most."""
    return count * crew.rank // crew.size, count * (crew.rank + 1) // crew.size
