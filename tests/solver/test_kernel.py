"""What every compiled kernel promises: numpy's division, no fast-math unless asked for, options handed on.

Compilation is timed by module, and its time is not that of the work in which it happened. Without compilation, for a
debugger, kernels are plain Python with the same results.
"""

import io
import os
import subprocess
import sys
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


def test_the_first_call_is_compilation_and_the_second_is_work() -> None:
    @numba.njit
    def inner(x):
        return x + 1

    @numba.njit
    def outer(x):
        return inner(x) * 2

    known = compile_times().get(__name__, 0.0)
    before = time.perf_counter()
    clock = work_clock()
    start = time.perf_counter()
    assert outer(1) == 4
    least = time.perf_counter() - start
    work = work_clock() - clock
    most = time.perf_counter() - before  # the process may have been held up at any of the clocks
    compiled = compile_times()[__name__] - known
    assert 0 < compiled < least, "a kernel that is compiled for another does not count twice"
    assert least - work - 1e-9 <= compiled <= most - work + 1e-9
    assert compiling() is None
    assert outer(2) == 6
    assert compile_times()[__name__] == known + compiled


WAVES = """
import io, sys
import numpy as np
from hand_made import square
from ripple_sim.solver import Material, WaveSolver, sphere_atlas, texel_atlas

results = {}
for name, atlas in {"sphere": sphere_atlas(1.0, 4), "square": texel_atlas(square(4))}.items():
    plain = Material(speed=1.0)
    every = Material(speed=1.0, bending=1e-3, viscosity=1e-3, yield_height=1e-3, density=2 + atlas.positions[..., 1])
    for kind, material in {"plain": plain, "every": every}.items():
        waves = WaveSolver(atlas, material, backend="cpu")
        waves.add_impulse([0.2, 0.3, 1.0], 0.1, 0.6)
        waves.add_force([0.2, -0.3, 1.0], 0.1, 0.6)
        waves.step(0.2)
        results[f"{name}, {kind}"] = waves.height
        results[f"{name}, {kind}, dent"] = waves.dent
"""


def test_without_compilation_waves_are_the_same() -> None:
    """NUMBA_DISABLE_JIT: impulses find their texels, and loops run over fields and numbers, in plain Python."""
    compiled: dict[str, dict[str, np.ndarray]] = {"results": {}}
    exec(WAVES, compiled)
    save = "file = io.BytesIO(); np.savez(file, **results); sys.stdout.buffer.write(file.getvalue())"
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", WAVES + save], env=environment, capture_output=True, check=True)
    plain = np.load(io.BytesIO(done.stdout))
    assert set(plain) == set(compiled["results"])
    assert plain["square, every, dent"].any()
    for name, expected in compiled["results"].items():
        np.testing.assert_allclose(plain[name], expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max(), err_msg=name)
