"""The installed packages are the source tree: pyproject.toml lists every package."""

import re
import tomllib
import zipfile
from pathlib import Path

import pytest
from programs import PROGRAMS, ended

import ripple_sim

ROOT = Path(__file__).parents[2]
FOLDERS = {"ripple_sim": "ripple_sim", "solver": "ripple_sim/solver", "scenes": "ripple_sim/scenes"}
SUFFIXES = {".py", ".glsl", ".toml", ".xml", ".obj", ".png", ".npy", ".typed"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> set[str]:
    """Names of the files in a wheel built from a copy of the tree."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    for name in (*FOLDERS, "pyproject.toml", "README.md", "LICENSE"):
        (source / name).symlink_to(ROOT / name)
    ended(
        "-m",
        "pip",
        "wheel",
        "-q",
        "--no-deps",
        "--no-build-isolation",
        "-w",
        folder,
        source,
        check=True,
    )
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as archive:
        return set(archive.namelist())


def test_every_source_file_is_in_the_wheel(wheel):
    expected = {
        f"{inside}/{path.relative_to(ROOT / folder).as_posix()}"
        for folder, inside in FOLDERS.items()
        for path in (ROOT / folder).rglob("*")
        if path.suffix in SUFFIXES and "__pycache__" not in path.parts
    }
    assert expected - wheel == set()
    assert "ripple_sim/py.typed" in wheel


def test_the_version_is_the_same_wherever_it_stands():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    cited = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)[1]
    assert project == cited == ripple_sim.__version__
    assert f"\n## {project} - " in (ROOT / "CHANGELOG.md").read_text()


def test_nothing_else_becomes_a_top_level_name(wheel):
    tops = {name.split("/")[0] for name in wheel}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"ripple_sim"}


def test_waves_need_nothing_of_posix_and_videos_no_viewer(tmp_path):
    """So contacts make waves on Windows, too."""
    result = ended(PROGRAMS / "run_without_posix.py", tmp_path / "a.mp4", check=True)
    assert result.stdout.splitlines()[-1] == "[]"
