"""The cache under stress: several processes at once, a full disk, and no place for it."""

import subprocess
import sys
from pathlib import Path

_BEGIN = """
import os, resource, sys
import numpy as np
from ripple_sim.solver import Mesh, build_atlas
from ripple_sim.solver.cache import cache_path
V = np.vstack([np.zeros(3), np.eye(3)])
mesh = Mesh.from_arrays(V, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
expected = build_atlas(mesh, 8, cache=False).positions
"""

_FOUR = """
ready, go = os.pipe()
for _ in range(4):
    if os.fork() == 0:
        os.close(go)
        os.read(ready, 1)  # until the parent closes its end: all begin at once
        same = [np.array_equal(build_atlas(mesh, 8).positions, expected) for _ in range(3)]
        os._exit(0 if all(same) else 1)
os.close(go)
sys.exit(any(os.wait()[1] for _ in range(4)))
"""

_FULL = """
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
sys.exit(not np.array_equal(build_atlas(mesh, 8).positions, expected))
"""


def run(program: str, cache: Path) -> list[str]:
    """Run a program with a cache of its own; return what it leaves there."""
    environment = {"XDG_CACHE_HOME": str(cache), "PATH": "", "NUMBA_NUM_THREADS": "1"}
    result = subprocess.run(
        [sys.executable, "-c", _BEGIN + program],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert (result.returncode, result.stderr) == (0, "")
    return [each.name for each in cache.rglob("*") if each.is_file()]


def test_four_processes_fill_one_cache_at_once(tmp_path: Path) -> None:
    files = run(_FOUR, tmp_path)
    assert len(files) == 1 and files[0].endswith(".npz")


def test_a_full_disk_costs_the_next_call_its_time_and_leaves_nothing(tmp_path: Path) -> None:
    assert run(_FULL, tmp_path) == []
