"""The page on the architecture is about the code as it is."""

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


def test_the_tables_are_those_of_the_source(plots) -> None:
    page = PAGE.read_text(encoding="utf-8")
    walk = re.findall(r"^\d+\. `([\w/]+\.py)`", page, re.MULTILINE)
    figures = plots.structure.counts()
    shown = dict(re.findall(r"^\| ([^|]+) \| [^|]* \| ([^|]*) \|$", page, re.MULTILINE))
    message = "write it anew: python examples/plots/structure.py --docs"
    assert walk == plots.structure.walks()["step"], message
    assert shown["modules run by a step with a contact"] == str(len(walk)), message
    # lines change with every commit: what counts is that the page is not of another house
    for name in ("modules", "folders with Python", "cycles of modules"):
        assert shown[name] == figures[name], message


@pytest.mark.parametrize("page", [PAGE, ROOT / "CONTRIBUTING.md"], ids=lambda each: each.stem)
def test_every_file_that_a_page_names_exists(page: Path) -> None:
    named = re.findall(r"`(?:python )?((?:examples|tests|ripple_sim|solver)/[\w/]+\.py)", page.read_text("utf-8"))
    assert len(named) >= 5
    assert not [path for path in named if not (ROOT / path).is_file()]


def test_the_house_stays_small(plots) -> None:
    modules = plots.imports.read()
    lengths = {name: each.text.count("\n") for name, each in modules.items()}
    assert len(modules) <= plots.structure.MOST_MODULES
    assert not {name: length for name, length in lengths.items() if length > plots.structure.MOST_LINES}
    assert plots.structure.with_one_importer(modules) <= plots.structure.MOST_WITH_ONE_IMPORTER


def test_the_drawing_has_the_arrows_of_the_source(plots) -> None:
    drawn = re.search(r"<dc:description>(.*?)</dc:description>", DRAWING.read_text(encoding="utf-8"), re.DOTALL)
    assert drawn is not None
    assert drawn[1].split(", ") == plots.architecture.summary(plots.architecture.arrows()[0]), (
        "draw it anew: python examples/plots/architecture.py --docs"
    )


def test_the_drawing_is_drawn(plots, tmp_path: Path) -> None:
    path = plots.architecture.make(tmp_path)
    assert path.stat().st_size > 20_000
    text = path.with_suffix(".svg").read_text(encoding="utf-8")
    assert "coupling to solver/waves" in text
