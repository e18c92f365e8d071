"""What is installed is the source tree: pyproject.toml names packages one by one, and one is soon forgotten."""

import zipfile
from pathlib import Path

import pytest
from programs import ended

ROOT = Path(__file__).parents[2]
SUFFIXES = {".py", ".glsl", ".toml", ".xml", ".obj", ".png", ".npy", ".typed"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> set[str]:
    """Names of the files in a wheel built from a copy of the tree."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    for name in ("ripple_sim", "solver", "scenes", "pyproject.toml", "README.md", "LICENSE"):
        (source / name).symlink_to(ROOT / name)
    ended("-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", folder, source, check=True)
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as archive:
        return set(archive.namelist())


def test_every_source_file_is_in_the_wheel(wheel):
    expected = {
        f"{inside}/{path.relative_to(ROOT / folder).as_posix()}"
        for folder, inside in (
            ("ripple_sim", "ripple_sim"),
            ("solver", "ripple_sim/solver"),
            ("scenes", "ripple_sim/scenes"),
        )
        for path in (ROOT / folder).rglob("*")
        if path.suffix in SUFFIXES and "__pycache__" not in path.parts
    }
    assert expected - wheel == set()
    assert "ripple_sim/py.typed" in wheel


def test_nothing_else_becomes_a_top_level_name(wheel):
    tops = {name.split("/")[0] for name in wheel}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"ripple_sim"}
