"""A full disk, closed and full standard streams, no home, no cache: the right status, nothing in the wrong place."""

import errno
import os
import subprocess
import sys
from pathlib import Path
from typing import BinaryIO

import pytest

from ripple_sim.cli import main as cli

MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def run(folder: Path, words: str, redirections: str = "", **environment: str | None) -> subprocess.CompletedProcess:
    """The program in a shell."""
    (folder / "mesh.obj").write_text(MESH)
    command = f"{sys.executable} -m ripple_sim {words} {redirections}"
    kept = {name: value for name, value in os.environ.items() if environment.get(name, "") is not None}
    return subprocess.run(
        ["sh", "-c", command],
        cwd=folder,
        env={**kept, **{name: value for name, value in environment.items() if value is not None}},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


@pytest.mark.parametrize(
    ("words", "redirections", "status"),
    [
        ("atlas missing.obj", ">&- 2>&-", 2),
        ("atlas missing.obj", "2>/dev/full", 2),
        ("completion bash", ">&-", 0),
        ("--help", "| head -c 0", 0),
    ],
)
def test_closed_and_full_streams(tmp_path: Path, words: str, redirections: str, status: int) -> None:
    result = run(tmp_path, words, redirections)
    assert (result.returncode, result.stdout, result.stderr) == (status, "", "")


def test_without_streams_home_and_cache_an_atlas_is_whole(tmp_path: Path) -> None:
    from ripple_sim.solver import load_atlas

    words, cache = "atlas mesh.obj --resolution 4 -o mesh.npz", "/dev/null"
    result = run(tmp_path, words, "<&- >&- 2>&-", HOME=None, XDG_CACHE_HOME=cache)
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")
    assert load_atlas(tmp_path / "mesh.npz").resolution == 4
    assert sorted(each.name for each in tmp_path.iterdir()) == ["mesh.npz", "mesh.obj"]


def test_a_full_disk_is_no_bad_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from ripple_sim.solver.texels import atlas

    def full(file: BinaryIO, *_: object) -> None:
        file.write(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(atlas, "write_arrays", full)
    (tmp_path / "mesh.obj").write_text(MESH)
    assert cli.main(["atlas", str(tmp_path / "mesh.obj"), "--resolution", "4", "-o", str(tmp_path / "a.npz")]) == 1
    assert capsys.readouterr().err.endswith("a.npz' cannot be written: No space left on device\n")
    assert [each.name for each in tmp_path.iterdir()] == ["mesh.obj"]
