"""Compiled kernels divide as numpy does, without fast-math; messages of compiling."""

import importlib
import inspect
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np
import pytest
from programs import PROGRAMS, ended
from waves_on_two_surfaces import heights

from ripple_sim.solver.compile_clock import compile_times, compiling, work_clock
from ripple_sim.solver.kernel import kernel
from ripple_sim.solver.kernel_cache import fingerprint


@kernel
def quotient(a, b):
    return a / b


@kernel
def compensated_sum(x):
    """Kahan's sum, whose correction fast-math would strike out."""
    total = 0.0
    lost = 0.0
    for each in x:
        small = each - lost
        grown = total + small
        lost = (grown - total) - small
        total = grown
    return total


@pytest.mark.parametrize(
    ("a", "b", "expected"), [(1.0, 0.0, np.inf), (-1.0, 0.0, -np.inf), (0.0, 0.0, np.nan)]
)
def test_division_by_zero_follows_numpy_and_raises_nothing(
    a: float, b: float, expected: float
) -> None:
    np.testing.assert_equal(quotient(a, b), expected)


def test_literal_arguments_share_one_compiled_version() -> None:
    @kernel
    def doubled(x):
        return 2 * x

    @kernel
    def calls(x):
        return doubled(1) + doubled(2) + doubled(x[0])

    assert calls(np.array([3], np.int32)) == 12
    assert numba.config.DISABLE_JIT or len(doubled.signatures) == 1


def test_sums_are_rounded_as_they_are_written() -> None:
    x = np.full(1000, 0.1)
    x[0] = 1e8
    assert compensated_sum(x) == pytest.approx(1e8 + 99.9, abs=2e-8)
    assert np.cumsum(x)[-1] != compensated_sum(x)


def test_the_first_call_is_compilation_and_the_second_is_work() -> None:
    @numba.njit
    def inner(x):
        return x + 1

    @numba.njit
    def outer(x):
        return inner(x) * 2

    compiled_before = compile_times().get(__name__, 0.0)
    # the process may be held up between two looks at clocks, so there are two durations
    outer_start = time.perf_counter()
    work_before = work_clock()
    inner_start = time.perf_counter()
    assert outer(1) == 4
    shorter = time.perf_counter() - inner_start
    work = work_clock() - work_before
    longer = time.perf_counter() - outer_start
    compiled = compile_times()[__name__] - compiled_before
    assert 0 < compiled < shorter, "a kernel that is compiled for another does not count twice"
    assert shorter - work - 1e-9 <= compiled <= longer - work + 1e-9
    assert compiling() is None
    assert outer(2) == 6
    assert compile_times()[__name__] == compiled_before + compiled


LIBRARY = (PROGRAMS / "library_of_kernels.py").read_text()


@pytest.fixture
def library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], ModuleType]]:
    """Imports a module of a kernel anew, as a new process would, each time it is called."""
    (tmp_path / "library_of_kernels.py").write_text(LIBRARY)
    monkeypatch.syspath_prepend(tmp_path)
    # a change within the second would go unnoticed
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(
        "ripple_sim.solver.kernel_cache.kernel_folder", lambda: tmp_path / "kernels"
    )

    def imported() -> ModuleType:
        sys.modules.pop("library_of_kernels", None)
        importlib.invalidate_caches()
        fingerprint.cache_clear()
        return importlib.import_module("library_of_kernels")

    yield imported
    sys.modules.pop("library_of_kernels", None)
    fingerprint.cache_clear()


def is_loaded(kernel: Any) -> bool:
    """Whether the sum of a kernel's library is right, and came from the disk."""
    assert kernel(np.array([1.0, 2.0, 4.0])) in (7.0, 8.0)
    return bool(kernel.stats.cache_hits) and not kernel.stats.cache_misses


def test_a_kernel_works_while_a_newer_version_is_installed_under_it(
    library, tmp_path: Path
) -> None:
    kernel = library().sum_of
    (tmp_path / "library_of_kernels.py").write_text("from ripple_sim.later import more\n" + LIBRARY)
    assert not is_loaded(kernel)
    assert not list(tmp_path.glob("kernels/*"))


def test_a_kernel_is_compiled_once_and_again_when_its_source_changes(
    library, tmp_path: Path
) -> None:
    assert not is_loaded(library().sum_of)
    assert is_loaded(library().sum_of)
    source = tmp_path / "library_of_kernels.py"
    source.write_text(LIBRARY.replace("total = 0.0", "total = 1.0"))
    assert library().sum_of(np.array([1.0, 2.0, 4.0])) == 8.0
    assert len(list((tmp_path / "kernels").iterdir())) == 1  # the older one is replaced


def test_kernels_with_checks_of_bounds_and_without_never_mix(
    library, monkeypatch: pytest.MonkeyPatch
) -> None:
    values = np.zeros(4)
    for checks in (None, 1, None, 1):
        monkeypatch.setattr(numba.config, "BOUNDSCHECK", checks)
        value_at = library().value_at
        if checks:
            with pytest.raises(IndexError):
                value_at(values, 5)
        else:
            value_at(values, 5)


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("OPT", 0),
        ("DEBUGINFO_DEFAULT", 1),
        ("DEBUG_JIT", 1),
        ("LOOP_VECTORIZE", 0),
        ("LLVM_REFPRUNE_FLAGS", "none"),
    ],
)
def test_a_kernel_compiled_under_another_setting_is_another_file(
    library, monkeypatch, setting: str, value: Any
) -> None:
    cache = library().sum_of._cache
    usual = cache._path("key")
    monkeypatch.setattr(numba.config, setting, value)
    assert cache._path("key") != usual
    monkeypatch.undo()


def test_waves_are_the_same_without_compilation(tmp_path: Path) -> None:
    """NUMBA_DISABLE_JIT: footprints and loops over fields work in plain Python."""
    compiled = heights()
    program = inspect.getfile(heights)
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    ended(program, tmp_path / "plain.npz", env=environment, check=True)
    plain = np.load(tmp_path / "plain.npz")
    assert set(plain) == set(compiled)
    assert plain["square, every, dent"].any()
    for name, expected in compiled.items():
        np.testing.assert_allclose(
            plain[name], expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max(), err_msg=name
        )
