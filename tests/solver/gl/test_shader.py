"""GLSL sources: found below their package, with includes and defines put in."""

import sys
from pathlib import Path

import pytest

from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import load_shader


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Name of a package with shaders in two folders."""
    (tmp_path / "some_shaders" / "shared").mkdir(parents=True)
    (tmp_path / "some_shaders" / "passes").mkdir()
    (tmp_path / "some_shaders" / "__init__.py").touch()
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "some_shaders", raising=False)
    files = {
        "passes/one.glsl": '#version 430\n#include "shared/outer.glsl"\n#include "shared/inner.glsl"\nvoid main() {}\n',
        "shared/outer.glsl": '#include "shared/inner.glsl"\n// outer, HALF\n',
        "shared/inner.glsl": "// inner, N\n",
        "passes/lost.glsl": '#version 430\n#include "shared/none.glsl"\n',
        "passes/bare.glsl": "void main() {}\n",
    }
    for path, text in files.items():
        (tmp_path / "some_shaders" / path).write_text(text)
    return "some_shaders"


def test_includes_are_put_in_once_and_defines_at_the_top(package: str) -> None:
    text = load_shader(package, "passes/one", N=8, HALF=0.5, OTHER=1)
    assert text == "#version 430\n#define N 8\n#define HALF 0.5\n// inner, N\n\n// outer, HALF\n\n\nvoid main() {}\n"


def test_a_missing_file_is_named(package: str) -> None:
    with pytest.raises(GLError, match=r"some_shaders has no shader shared/none\.glsl"):
        load_shader(package, "passes/lost")
    with pytest.raises(GLError, match=r"has no shader passes/two\.glsl"):
        load_shader(package, "passes/two")


def test_a_shader_starts_with_its_version(package: str) -> None:
    with pytest.raises(GLError, match="must start with #version"):
        load_shader(package, "passes/bare")


def test_a_stage_is_what_stands_before_all_and_its_own_part(package: str, tmp_path: Path) -> None:
    folder = tmp_path / "some_shaders"
    (folder / "rays.glsl").write_text("all\n#stage vertex\ncast\n#stage fragment\nmeet\n")
    text = '#version 430\n#include "rays.glsl"\n#stage fragment\nshade\n#stage vertex\nplace\n'
    (folder / "pass.glsl").write_text(text)
    lines = {stage: load_shader(package, "pass", stage).split() for stage in ("vertex", "fragment")}
    assert lines["vertex"][2:] == ["all", "cast", "place"]
    assert lines["fragment"][2:] == ["all", "meet", "shade"]
