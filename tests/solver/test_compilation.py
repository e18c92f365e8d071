"""Compilation is timed by module, and its time is not that of the work in which it happened."""

import time

import numba
import pytest

from ripple_sim.solver.compilation import compile_times, compiling, work_clock


def test_the_first_call_is_compilation_and_the_second_is_work() -> None:
    @numba.njit
    def inner(x):
        return x + 1

    @numba.njit
    def outer(x):
        return inner(x) * 2

    start, clock = time.perf_counter(), work_clock()
    assert outer(1) == 4
    wall, work = time.perf_counter() - start, work_clock() - clock
    compiled = compile_times()[__name__]
    assert 0 < compiled < wall, "a kernel that is compiled for another does not count twice"
    assert wall - work == pytest.approx(compiled, abs=1e-3)
    assert compiling() is None
    assert outer(2) == 6
    assert compile_times()[__name__] == compiled
