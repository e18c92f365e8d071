"""Every file of examples: it is imported, which does nothing else, and run in small where that is quick."""

import importlib.util
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
FILES = sorted(each.relative_to(EXAMPLES).as_posix() for each in EXAMPLES.rglob("*.py"))
# constants that make it quick, arguments of main, and what it then prints
SMALL: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "step_hook.py": ({}, {"duration": 1 / 60}, "1 frames in"),
    "compare_operators.py": ({"SIZE": 60, "RESOLUTION": 16}, {}, "out/compare_operators.png"),
    "benchmarks/finite_guard.py": ({"TIMES": 3}, {}, "| 256 |"),
    "benchmarks/loops.py": ({}, {}, "1.0000"),
    "benchmarks/export.py": ({"RESOLUTION": 16, "TRIANGLES": 1000, "WARM_UP": 1}, {"frames": 3}, "frames a second"),
}


@pytest.fixture
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """An empty folder to stand in; modules that files import from beside themselves are forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["example"])
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        if EXAMPLES in Path(getattr(sys.modules[name], "__file__", None) or "/").parents:
            del sys.modules[name]


def imported(file: str, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    path = EXAMPLES / file
    monkeypatch.syspath_prepend(str(path.parent))
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, path.stem, module)  # dataclasses look themselves up
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("file", FILES)
def test_an_import_does_nothing_else(file: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    if file.startswith("gymnasium"):
        pytest.importorskip("gymnasium")
    gl = os.environ.get("MUJOCO_GL")
    imported(file, monkeypatch)
    assert capsys.readouterr() == ("", "")
    assert not list(folder.iterdir())
    assert os.environ.get("MUJOCO_GL") == gl


@pytest.mark.parametrize("file", SMALL)
def test_an_example_in_small(file: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    constants, arguments, says = SMALL[file]
    module = imported(file, monkeypatch)
    for name, value in constants.items():
        monkeypatch.setattr(module, name, value)
    module.main(**arguments)
    assert says in capsys.readouterr().out


def test_a_part_of_the_paper_is_made(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = imported("paper/figure_8.py", monkeypatch)
    monkeypatch.setattr(module, "TIMES", [0.05])
    monkeypatch.setattr(module, "SIZE", (64, 48))
    part = module.make(folder)
    assert len(part.pictures) == 3
    assert all(picture.is_file() for picture, _ in part.pictures)
