"""Killed at any moment, a job run again ends as if nothing had happened, and nobody else's file is touched."""

import multiprocessing
import os
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from multiprocessing.synchronize import Event
from pathlib import Path

import pytest
from fuzzing import fuzzed_by, home_of_others
from hypothesis import given, strategies as st
from small_batch import PLAN, Here, write_files
from unfinished_videos import contents

SMALL = "--fps 40 --duration 0.2 --size 32x32 --backend cpu"
JOBS = {
    "frames": f"render scene.toml -o out/frames --passes depth,flow {SMALL} --resume",
    "webp": f"render scene.toml -o out/film.webp --passes height {SMALL} --resume",
    "mp4": f"render scene.toml -o out/film.mp4 {SMALL} --resume",
    "chunks": f"export scene.toml -o out/run.usda --chunk 2 {SMALL} --resume",
    "zarr": f"export scene.toml -o out/run.zarr {SMALL}",
    "page": f"export scene.toml -o out/run.html {SMALL}",
    "batch": "batch plan.toml -o out --keep-free 0.01",
    "atlas": "atlas ball.obj --resolution 8 -o out/atlas.npz --plot out/atlas.png",
}
# a process is forked from one that has imported all, so that most moments lie in the work
CONTEXT = multiprocessing.get_context("forkserver")
LOADED = ["ripple_sim.cli.main", "ripple_sim.video.render_video", "ripple_sim.export.exporter", "ripple_sim.batch.run"]


def ended(home: Path, words: str, begun: Event) -> None:
    """What a process does: a command, whose workers are this very process. It can be killed once it has `begun`."""
    from ripple_sim.batch import run
    from ripple_sim.cli.main import main
    from ripple_sim.cli.signals import end_at_once

    signal.signal(signal.SIGINT, signal.default_int_handler)
    end_at_once()  # as the program does before it imports what is above
    os.chdir(home)
    os.environ["XDG_CACHE_HOME"] = str(home / "cache")
    os.dup2(os.open("said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    run.LocalExecutor = Here  # type: ignore[misc,assignment]
    begun.set()
    sys.exit(main(words.split()))


def finish(home: Path, words: str, kill: int = 0, after: float = 300) -> int:
    """Run a command, to its end or until it is killed after some seconds; return its status."""
    (home / "out").mkdir(exist_ok=True)
    begun = CONTEXT.Event()
    process = CONTEXT.Process(target=ended, args=(home, words, begun))
    process.start()
    assert begun.wait(60)
    process.join(after)
    if kill and process.is_alive():
        os.kill(process.pid or 0, kill)
        process.join(60)
    assert process.exitcode is not None, "it hangs"
    lines = (home / "said").read_text().splitlines() if (home / "said").exists() else []
    assert all(line.startswith("ripple-sim: ") for line in lines), lines
    assert sum(not line.startswith("ripple-sim: warning: ") for line in lines) < 2, lines
    return process.exitcode


def made(folder: Path) -> dict[str, bytes]:
    """All that a job makes but for the times in it, and where it was."""
    timed = ("times.json", "index.parquet", "index.html")
    return {
        name: content.replace(str(folder.parent).encode(), b"home")
        for name, content in contents(folder).items()
        if not (name.endswith(timed) or name.startswith("work/") or "/." in f"/{name}")
    }


def write_inputs(home: Path) -> None:
    write_files(home)
    (home / "plan.toml").write_text(PLAN.replace("count = 5", "count = 2").replace("[64, 48]", "[16, 16]"))
    (home / "ball.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")


@pytest.fixture(scope="module")
def undisturbed(opengl: None) -> Iterator[dict[str, tuple[float, dict[str, bytes]]]]:
    """What each job makes, and how long it takes [s]."""
    CONTEXT.set_forkserver_preload(LOADED)
    found = {}
    with tempfile.TemporaryDirectory() as name:
        write_inputs(Path(name))
        for each, words in JOBS.items():
            home = Path(name)
            start = time.monotonic()
            assert finish(home, words) == 0
            found[each] = time.monotonic() - start, made(home / "out")
            (home / "out").rename(home / f"{each} whole")
        yield found


@fuzzed_by(6, share=0.02)
@given(
    st.sampled_from(sorted(JOBS)),
    st.lists(
        st.tuples(st.sampled_from([signal.SIGKILL, signal.SIGTERM, signal.SIGINT]), st.floats(0, 1)),
        min_size=1,
        max_size=2,
    ),
)
def test_a_job_that_is_killed_and_run_again(undisturbed: dict, name: str, kills: list) -> None:
    seconds, expected = undisturbed[name]
    with home_of_others() as home:
        write_inputs(home)
        for kill, moment in kills:
            status = finish(home, JOBS[name], kill, seconds * moment)
            assert status in (-kill, 128 + kill, 0)
            now = made(home / "out") if (home / "out").exists() else {}
            parts = [file for file in now if ".part" not in file]
            if name != "batch":
                assert all(expected.get(file) == now[file] for file in parts), parts
        assert finish(home, JOBS[name]) == 0
        assert made(home / "out") == expected
        if all(kill != signal.SIGKILL for kill, _ in kills):
            assert not [each for each in home.rglob("*") if each.name.endswith(".part")]
