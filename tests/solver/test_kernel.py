"""What every compiled kernel promises: numpy's division, no fast-math unless asked for, options handed on.

Compilation is timed by module, and its time is not that of the work in which it happened.
"""

import time

import numba
import numpy as np
import pytest

from ripple_sim.solver.kernel import compile_times, compiling, kernel, work_clock


@kernel
def quotient(a, b):
    return a / b


@kernel
def compensated_sum(x):
    """Kahan's sum, whose correction fast-math would strike out."""
    total, lost = 0.0, 0.0
    for each in x:
        small = each - lost
        grown = total + small
        lost = (grown - total) - small
        total = grown
    return total


@kernel(inline="always")
def doubled(x):
    return 2 * x


@pytest.mark.parametrize(("a", "b", "expected"), [(1.0, 0.0, np.inf), (-1.0, 0.0, -np.inf), (0.0, 0.0, np.nan)])
def test_division_by_zero_follows_numpy_and_raises_nothing(a: float, b: float, expected: float) -> None:
    np.testing.assert_equal(quotient(a, b), expected)


def test_sums_are_rounded_as_they_are_written() -> None:
    x = np.full(1000, 0.1)
    x[0] = 1e8
    naive = 0.0
    for each in x:
        naive += each
    assert compensated_sum(x) == pytest.approx(1e8 + 99.9, abs=2e-8)
    assert naive != compensated_sum(x)


def test_options_are_handed_to_the_compiler() -> None:
    assert doubled.targetoptions["inline"] == "always"
    assert doubled(21) == 42
    for each in (quotient, doubled):
        assert each.targetoptions["nogil"]
        assert "fastmath" not in each.targetoptions


@kernel
def twice_quotient(a, b):
    return 2 * quotient(a, b)


def test_a_kernel_called_by_another_is_compiled_for_that_alone_and_for_python_once_it_is_called_there() -> None:
    assert twice_quotient(np.float32(3), np.float32(2)) == 3
    for_float32 = [each for each in quotient.signatures if each[0].name == "float32"]
    assert not for_float32
    assert quotient(np.float32(3), np.float32(2)) == 1.5


def test_the_first_call_is_compilation_and_the_second_is_work() -> None:
    @numba.njit
    def inner(x):
        return x + 1

    @numba.njit
    def outer(x):
        return inner(x) * 2

    before = time.perf_counter()
    clock = work_clock()
    start = time.perf_counter()
    assert outer(1) == 4
    least = time.perf_counter() - start
    work = work_clock() - clock
    most = time.perf_counter() - before  # the process may have been held up at any of the clocks
    compiled = compile_times()[__name__]
    assert 0 < compiled < least, "a kernel that is compiled for another does not count twice"
    assert least - work - 1e-9 <= compiled <= most - work + 1e-9
    assert compiling() is None
    assert outer(2) == 6
    assert compile_times()[__name__] == compiled
