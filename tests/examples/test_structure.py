"""What the drawing of the packages and the table of measures are made of: on a small tree whose imports are known."""

import importlib
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

PLOTS = Path(__file__).parents[2] / "examples" / "plots"

TREE = {
    "ripple_sim/__init__.py": "",
    "ripple_sim/__init__.pyi": "from .coupling.ripples import Ripples as Ripples\n",
    "ripple_sim/simulation.py": "from ripple_sim import Ripples\n\ndef run(self, a, *, b):\n    a += b\n    return a\n",
    "ripple_sim/coupling/__init__.py": "",
    "ripple_sim/coupling/ripples.py": "from ripple_sim.solver import Material\nfrom . import load\n",
    "ripple_sim/coupling/load.py": "def late():\n    from .ripples import Ripples\n",
    "solver/__init__.py": "",
    "solver/__init__.pyi": "from .operator.material import Material as Material\n",
    "solver/operator/__init__.py": "",
    "solver/operator/material.py": "import numpy\nimport ripple_sim.solver.errors\n",
    "solver/errors.py": "",
    "scenes/__init__.py": "",
    "tests/test_it.py": "\n" * 4,
}
MATERIAL, ERRORS = "ripple_sim.solver.operator.material", "ripple_sim.solver.errors"
RIPPLES, LOAD, SIMULATION = "ripple_sim.coupling.ripples", "ripple_sim.coupling.load", "ripple_sim.simulation"


@pytest.fixture
def plots(monkeypatch: pytest.MonkeyPatch):
    names = ("imports", "layered", "structure")
    monkeypatch.syspath_prepend(str(PLOTS))
    yield SimpleNamespace(**{name: importlib.import_module(name) for name in names})
    for name in names:
        del sys.modules[name]


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name, text in TREE.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_imports_are_those_of_the_modules_that_names_come_from(plots, root: Path) -> None:
    modules = plots.imports.read(root)
    assert {name: set(module.imports) for name, module in modules.items()} == {
        SIMULATION: {RIPPLES},  # by way of ripple_sim/__init__.pyi
        RIPPLES: {MATERIAL, LOAD},
        LOAD: {RIPPLES},  # inside a function
        MATERIAL: {ERRORS},
        ERRORS: set(),
    }


def test_cycles_are_found_and_counted_as_the_folders_stand(plots, root: Path) -> None:
    modules = plots.imports.read(root)
    assert plots.imports.cycles({name: set(each.imports) for name, each in modules.items()}) == [[LOAD, RIPPLES]]
    rooms = plots.imports.grouped(modules, {name: plots.imports.room(name) for name in modules})
    assert rooms["ripple_sim.coupling"] == {"ripple_sim.solver.operator"}
    assert plots.imports.cycles(rooms) == []


def test_arrows_that_others_imply_are_left_out(plots) -> None:
    arrows = {"a": {"b", "c", "d"}, "b": {"c"}, "c": {"d"}, "d": set()}
    assert plots.layered.without_detours(arrows) == {"a": {"b"}, "b": {"c"}, "c": {"d"}, "d": set()}
