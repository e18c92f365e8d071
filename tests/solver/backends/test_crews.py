"""Threads that step a surface together: how many, two solvers at once, forks, and failures."""

import multiprocessing
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from ripple_sim.solver import SolverError, WaveSolver, sphere_atlas
from ripple_sim.solver.backends import crews
from ripple_sim.solver.backends.meeting import Crew, meet
from ripple_sim.solver.backends.pace import Pace
from ripple_sim.solver.cores import available_cores, core_count
from ripple_sim.solver.kernel import kernel

RESOLUTION = 24


def stepped(threads: int) -> np.ndarray:
    """Heights after a kick and 40 substeps."""
    waves = WaveSolver(sphere_atlas(1.0, RESOLUTION), backend="cpu", threads=threads)
    waves.add_impulse((1.0, 0.2, 0.1), 1e-3, radius=0.3)
    dt = 0.9 * waves.stable_timestep
    for _ in range(10):
        waves.step(4 * dt, substeps=4)
    return waves.height


@pytest.mark.parametrize(
    ("files", "quota"),
    [
        ({"proc/self/cgroup": "0::/a/b\n", "sys/fs/cgroup/a/cpu.max": "150000 100000\n"}, 2),
        ({"proc/self/cgroup": "0::/a\n", "sys/fs/cgroup/a/cpu.max": "max 100000\n"}, None),
        (
            {
                "proc/self/cgroup": "4:cpu,cpuacct:/x\n2:memory:/y\n",
                "sys/fs/cgroup/cpu/x/cpu.cfs_quota_us": "50000\n",
                "sys/fs/cgroup/cpu/x/cpu.cfs_period_us": "100000\n",
            },
            1,
        ),
        (
            {
                "proc/self/cgroup": "4:cpu:/x\n",
                "sys/fs/cgroup/cpu/x/cpu.cfs_quota_us": "-1\n",
                "sys/fs/cgroup/cpu/x/cpu.cfs_period_us": "100000\n",
            },
            None,
        ),
        ({}, None),
    ],
)
def test_limit_of_the_cgroup_bounds_the_cores(
    files: dict[str, str], quota: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ripple_sim.solver.cores.available_cores", lambda: list(range(16)))
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    assert core_count(tmp_path) == (quota or 16)


def test_large_surfaces_get_threads_and_small_ones_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crews, "core_count", lambda: 4)
    assert crews.thread_count(6 * 64**2, None) == 1
    assert crews.thread_count(6 * 512**2, None) == 4
    assert crews.thread_count(6 * 512**2, 3) == 3
    monkeypatch.setattr(crews, "core_count", lambda: 1)
    assert crews.thread_count(6 * 512**2, None) == 1


def test_environment_names_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(crews.THREADS_VARIABLE, "3")
    assert crews.checked_threads(None) == 3
    assert crews.checked_threads(2) == 2
    monkeypatch.setenv(crews.THREADS_VARIABLE, "many")
    with pytest.raises(SolverError, match=r"RIPPLE_SIM_THREADS must be a whole number .* 'many'"):
        crews.checked_threads(None)


@pytest.mark.parametrize("threads", [0, -1, 1.5, True, "two", 10**6])
def test_impossible_number_of_threads_is_refused(threads: object) -> None:
    with pytest.raises(SolverError, match="threads must be a whole number from 1"):
        WaveSolver(sphere_atlas(1.0, 8), backend="cpu", threads=threads)


def test_solvers_that_step_at_the_same_time_do_not_wait_for_each_other() -> None:
    expected = stepped(1)
    with ThreadPoolExecutor(4) as executor:
        for height in executor.map(stepped, [3, 2, 3, 2]):
            np.testing.assert_array_equal(height, expected)


def _send_stepped(pipe) -> None:
    pipe.send(stepped(2))


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="no fork on this system"
)
def test_forked_process_steps_with_threads_of_its_own() -> None:
    expected = stepped(2)
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()
    process = context.Process(target=_send_stepped, args=(there,))
    process.start()
    assert here.poll(60), "the forked process does not end"
    np.testing.assert_array_equal(here.recv(), expected)
    process.join()


def test_thread_that_fails_ends_the_waiting_of_the_others() -> None:
    @kernel
    def come(crew: Crew) -> bool:
        return meet(crew)

    met = []

    def task(crew: Crew) -> None:
        if crew.rank == 0:
            raise KeyboardInterrupt
        met.append(come(crew))

    with pytest.raises(KeyboardInterrupt):
        crews.run_together(task, 3)
    assert met == [False, False]
    assert stepped(2).any()  # the threads are free again


def test_cores_are_those_of_this_process() -> None:
    assert 1 <= core_count() <= len(available_cores())


def test_threads_that_lose_are_left_alone_and_tried_again() -> None:
    pace = Pace(2)
    seconds = {1: 1.0, 2: 30.0}  # busy cores
    choices = []
    for _ in range(400):
        threads = pace.choose()
        choices.append(threads)
        pace.note(threads, seconds[threads])
    assert choices[:2] == [2, 1]
    trials = [i for i, threads in enumerate(choices) if threads == 2]
    assert 3 <= len(trials) <= 6  # seldom, and ever more so
    seconds[2] = 0.5  # the cores are free again
    for _ in range(2000):
        threads = pace.choose()
        pace.note(threads, seconds[threads])
    assert pace.choose() == 2


def test_one_thread_stays_one() -> None:
    pace = Pace(1)
    pace.note(1, 1.0)
    assert pace.choose() == 1
