"""The program without what Windows lacks: see tests/support/without_posix."""

import os
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from programs import ended
from small_batch import small_plan

HOOK = Path(__file__).parents[1] / "support" / "without_posix"
SMALL = ["--duration", "0.05", "--resolution", "8"]


@pytest.fixture
def windows() -> dict[str, str]:
    """Environment of processes in which our modules see a system like Windows."""
    return {**os.environ, "PYTHONPATH": str(HOOK)}


def run(windows: dict[str, str], code: str) -> str:
    result = ended("-c", code, env=windows)
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_the_modules_see_a_system_without_posix(windows):
    """Otherwise the other tests here would test nothing."""
    code = """if True:
        from ripple_sim.cli import signals
        from ripple_sim.encode import locks, replace
        from ripple_sim.solver import memory
        print(locks.fcntl, memory.resource, signals._HAS_TIMER, hasattr(replace.os, "fork"))
        """
    assert run(windows, code).split() == ["None", "None", "False", "False"]


def test_commands_need_nothing_of_posix(windows, opengl, tmp_path, tetrahedron):
    atlas = ["atlas", str(tetrahedron), "--resolution", "4", "-o", str(tmp_path / "a.npz")]
    video = ["render", "sphere", "-o", str(tmp_path / "a.mp4"), "--size", "32x24", *SMALL]
    table = ["export", "sphere", "-o", str(tmp_path / "a.csv"), *SMALL]
    code = f"""if True:
        import ripple_sim.bench
        from ripple_sim.cli.main import main
        for words in (["info"], ["cache"], {atlas}, {video}, {video}, {table}):
            assert main(words) == 0, words
        """
    run(windows, code)
    assert sorted(path.name for path in tmp_path.iterdir() if path != tetrahedron) == [
        "a.csv",
        "a.mp4",
        "a.npz",
    ]


def test_a_batch_and_its_processes_need_nothing_of_posix(windows, opengl, tmp_path):
    small_plan(tmp_path, 'video = "none"\nformat = "webdataset"\nscenes_per_tar = 2\n')
    output = tmp_path / "out"
    words = ["batch", str(tmp_path / "plan.toml"), "-o", str(output), "--workers", "1"]
    words += ["--keep-free", "0.001", "--limit", "2"]
    result = ended("-m", "ripple_sim", *words, env=windows)
    assert result.returncode == 0, result.stderr
    assert [path.name for path in (output / "tars").glob("*.tar")] == ["000000.tar"]
    assert not [path for path in (output / "work").iterdir() if "ready" not in path.name]


def test_the_viewer_starts_and_ends_without_posix(windows, opengl, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    words = ["view", "sphere", "--port", str(port), "--resolution", "8"]
    process = subprocess.Popen(
        [sys.executable, "-m", "ripple_sim", *words],
        env={**windows, "BROWSER": "true"},
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        address = re.search(r"http://\S+", process.stdout.readline())
        assert address is not None
        with urllib.request.urlopen(address[0], timeout=60) as page:
            assert b"<html" in page.read()
        process.send_signal(signal.SIGTERM)  # a job in the background ignores SIGINT
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert "Traceback" not in errors
