"""The architecture page matches the code, and its program is right on a small tree."""

import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "architecture.md"
DRAWING = ROOT / "docs" / "pictures" / "architecture.svg"


@pytest.fixture(scope="module")
def plots() -> Iterator[SimpleNamespace]:
    names = ("architecture", "figure", "imports", "layered", "structure")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "examples" / "plots"))
        yield SimpleNamespace(**{name: importlib.import_module(name) for name in names})
    for name in names:
        del sys.modules[name]


def test_the_walk_on_the_page_matches_the_source(plots) -> None:
    page = PAGE.read_text(encoding="utf-8")
    walk = re.findall(r"^\d+\. `([\w/]+\.py)`", page, re.MULTILINE)
    assert walk == plots.structure.walk(), (
        "write it anew: python examples/plots/structure.py --docs"
    )


def test_there_are_no_cycles_between_modules(plots) -> None:
    modules = plots.imports.read()
    imports = {name: set(each.imports) & set(modules) for name, each in modules.items()}
    assert plots.imports.cycles(imports) == []


@pytest.mark.parametrize("page", [PAGE, ROOT / "CONTRIBUTING.md"], ids=lambda each: each.stem)
def test_every_file_that_a_page_names_exists(page: Path) -> None:
    named = re.findall(
        r"`(?:python )?((?:examples|tests|ripple_sim|solver)/[\w/]+\.py)", page.read_text("utf-8")
    )
    assert len(named) >= 5
    assert not [path for path in named if not (ROOT / path).is_file()]


def test_the_drawing_has_the_arrows_of_the_source(plots) -> None:
    drawn = re.search(
        r"<dc:description>(.*?)</dc:description>", DRAWING.read_text(encoding="utf-8"), re.DOTALL
    )
    assert drawn is not None
    advice = "draw it anew: python examples/plots/architecture.py --docs"
    assert drawn[1].split(", ") == plots.architecture.summary(plots.architecture.arrows()[0]), (
        advice
    )


def test_the_drawing_is_drawn(plots, tmp_path: Path) -> None:
    path = plots.architecture.make(tmp_path)
    assert path.stat().st_size > 20_000
    text = path.with_suffix(".svg").read_text(encoding="utf-8")
    assert "coupling to solver/waves" in text


TREE = {
    "ripple_sim/__init__.pyi": "from .coupling.ripples import Ripples as Ripples\n",
    "ripple_sim/simulation.py": "from ripple_sim import Ripples\n",
    "ripple_sim/coupling/ripples.py": (
        "from ripple_sim.solver import Material\nfrom . import load\n"
    ),
    "ripple_sim/coupling/load.py": "def late():\n    from .ripples import Ripples\n",
    "solver/__init__.pyi": "from .operator.material import Material as Material\n",
    "solver/operator/material.py": "import numpy\nimport ripple_sim.solver.errors\n",
    "solver/errors.py": "",
    "scenes/__init__.py": "",
}
MATERIAL = "ripple_sim.solver.operator.material"
ERRORS = "ripple_sim.solver.errors"
RIPPLES = "ripple_sim.coupling.ripples"
LOAD = "ripple_sim.coupling.load"
SIMULATION = "ripple_sim.simulation"


def test_imports_are_traced_to_the_defining_modules_and_cycles_are_found(
    plots, tmp_path: Path
) -> None:
    for name, text in TREE.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
        (tmp_path / name).with_name("__init__.py").touch()
    modules = plots.imports.read(tmp_path)
    imports = {name: set(module.imports) for name, module in modules.items()}
    # the first by way of ripple_sim/__init__.pyi, the second inside a function
    assert (imports[SIMULATION], imports[LOAD]) == ({RIPPLES}, {RIPPLES})
    assert (imports[RIPPLES], imports[MATERIAL], imports[ERRORS]) == (
        {MATERIAL, LOAD},
        {ERRORS},
        set(),
    )
    assert plots.imports.cycles(imports) == [[LOAD, RIPPLES]]
    rooms = plots.imports.grouped(modules, {name: plots.imports.room(name) for name in modules})
    assert rooms["ripple_sim.coupling"] == {"ripple_sim.solver.operator"}
    assert plots.imports.cycles(rooms) == []


def test_implied_arrows_are_left_out(plots) -> None:
    arrows = {"a": {"b", "c", "d"}, "b": {"c"}, "c": {"d"}, "d": set()}
    assert plots.layered.without_detours(arrows) == {"a": {"b"}, "b": {"c"}, "c": {"d"}, "d": set()}
