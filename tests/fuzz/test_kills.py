"""A job that was killed at any moment ends as if unbroken when it runs again."""

import functools
import multiprocessing
import os
import random
import re
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from fuzzing import EXAMPLES, home_of_others
from programs import begin_command
from small_batch import PLAN, write_files
from unfinished_videos import contents

SMALL = "--fps 40 --duration 0.2 --size 32x32 --backend cpu"
# the tests run the first of them, `make fuzz` runs all
JOBS = {
    "frames": f"render scene.toml -o out/frames --passes depth,flow {SMALL} --resume",
    "batch": "batch plan.toml -o out --keep-free 0.01",
    "chunks": f"export scene.toml -o out/run.usda --chunk 2 {SMALL} --resume",
    "atlas": "atlas ball.obj --resolution 8 -o out/atlas.npz --plot out/atlas.png",
    "webp": f"render scene.toml -o out/film.webp --passes height {SMALL} --resume",
    "mp4": f"render scene.toml -o out/film.mp4 {SMALL} --resume",
    "zarr": f"export scene.toml -o out/run.zarr {SMALL}",
    "page": f"export scene.toml -o out/run.html {SMALL}",
}
# processes are forked from a server that has imported everything, so that most kills hit the work
CONTEXT = multiprocessing.get_context("forkserver")
LOADED = [
    "batch.worker",
    "cli.main",
    "export.fields",
    "export.page",
    "export.usd",
    "figures.atlas_plot",
]


def finish(home: Path, words: str, kill: int = 0, after: float = 300) -> tuple[int, float]:
    """Run a command to its end or kill it after some seconds; return status and time."""
    (home / "out").mkdir(exist_ok=True)
    begun = CONTEXT.Event()
    process = CONTEXT.Process(target=begin_command, args=(home, words, begun))
    process.start()
    assert begun.wait(60)
    start = time.monotonic()
    process.join(after)
    seconds = time.monotonic() - start
    if kill and process.is_alive():
        os.kill(process.pid or 0, kill)
        process.join(60)
    assert process.exitcode is not None, "it hangs"
    lines = (home / "said").read_text().splitlines() if (home / "said").exists() else []
    assert all(line.startswith("ripple-sim: ") for line in lines), lines
    # a slow machine shows progress, and kernels that are compiled
    other = re.compile(r"ripple-sim: (warning: |compiling |\d+ % done)")
    assert sum(other.match(line) is None for line in lines) < 2, lines
    return process.exitcode, seconds


def made(folder: Path) -> dict[str, bytes]:
    """The files of a job, without times and without the path of its folder."""
    timed = ("times.json", "index.parquet", "index.html")
    return {
        name: content.replace(str(folder.parent).encode(), b"home")
        for name, content in contents(folder).items()
        if not (name.endswith(timed) or name.startswith("work/") or "/." in f"/{name}")
    }


def write_inputs(home: Path) -> None:
    write_files(home)
    (home / "plan.toml").write_text(
        PLAN.replace("count = 5", "count = 2").replace("[64, 48]", "[16, 16]")
    )
    (home / "ball.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )


class UnbrokenJob(NamedTuple):
    """A job that was not killed: how long it took [s], and its files."""

    seconds: float
    files: dict[str, bytes]


UnbrokenJobs = Callable[[str], UnbrokenJob]


@pytest.fixture(scope="module")
def unbroken(opengl: None) -> Iterator[UnbrokenJobs]:
    """Unbroken jobs by name; each runs when it is asked for."""
    CONTEXT.set_forkserver_preload([*(f"ripple_sim.{each}" for each in LOADED), "pandas"])
    with tempfile.TemporaryDirectory() as folder:

        @functools.cache
        def run(name: str) -> UnbrokenJob:
            home = Path(folder) / name
            home.mkdir()
            write_inputs(home)
            status, seconds = finish(home, JOBS[name])
            assert status == 0
            return UnbrokenJob(seconds, made(home / "out"))

        yield run


@pytest.mark.parametrize("seed", range(EXAMPLES // 50 or 4))
def test_a_killed_job_that_runs_again_makes_the_same_files(
    unbroken: UnbrokenJobs, seed: int
) -> None:
    chance = random.Random(seed)
    name = list(JOBS)[seed % len(JOBS)]
    kills = chance.choices([signal.SIGKILL, signal.SIGTERM, signal.SIGINT], k=chance.choice([1, 2]))
    seconds, expected = unbroken(name)
    with home_of_others() as home:
        write_inputs(home)
        for kill in kills:
            status, _ = finish(home, JOBS[name], kill, seconds * chance.random())
            assert status in (-kill, 128 + kill, 0)
            now = made(home / "out") if (home / "out").exists() else {}
            whole = [file for file in now if ".part" not in file]
            if name != "batch":
                assert all(expected.get(file) == now[file] for file in whole), whole
        assert finish(home, JOBS[name])[0] == 0
        assert made(home / "out") == expected
        if signal.SIGKILL not in kills:
            assert not [each for each in home.rglob("*") if each.name.endswith(".part")]
