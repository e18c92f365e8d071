"""The page on the architecture is about the code as it is."""

import importlib
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "architecture.md"
DRAWING = ROOT / "docs" / "pictures" / "architecture.svg"


@pytest.fixture
def architecture(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(ROOT / "examples" / "plots"))
    yield importlib.import_module("architecture")
    for name in ("architecture", "figure", "imports", "layered", "structure"):
        sys.modules.pop(name, None)


def walk() -> list[str]:
    text = PAGE.read_text(encoding="utf-8")
    section = text[text.index("## From a contact to a pixel") : text.index("## Changing it")]
    return re.findall(r"`((?:ripple_sim|solver)/[\w/]+\.py)`", section)


def test_the_walk_names_modules_that_exist_once_each() -> None:
    named = walk()
    assert len(named) > 25
    assert not [path for path in named if not (ROOT / path).is_file()]
    assert len(set(named)) == len(named)


@pytest.mark.parametrize("page", [PAGE, ROOT / "CONTRIBUTING.md"], ids=lambda each: each.stem)
def test_every_file_that_a_page_names_exists(page: Path) -> None:
    named = re.findall(r"`(?:python )?((?:examples|tests|ripple_sim|solver)/[\w/]+\.py)", page.read_text("utf-8"))
    assert len(named) >= 5
    assert not [path for path in named if not (ROOT / path).is_file()]


def test_the_house_stays_small(structure) -> None:
    modules = structure.read()
    lengths = {name: each.text.count("\n") for name, each in modules.items()}
    assert len(modules) <= structure.MOST_MODULES
    assert not {name: length for name, length in lengths.items() if length > structure.MOST_LINES}
    assert structure.with_one_importer(modules) <= structure.MOST_WITH_ONE_IMPORTER


def test_the_drawing_has_the_arrows_of_the_source(architecture) -> None:
    drawn = re.search(r"<dc:description>(.*?)</dc:description>", DRAWING.read_text(encoding="utf-8"), re.DOTALL)
    assert drawn is not None
    assert drawn[1].split(", ") == architecture.summary(architecture.arrows()[0]), (
        "draw it anew: python examples/plots/architecture.py --docs"
    )


def test_the_drawing_is_drawn(architecture, tmp_path: Path) -> None:
    path = architecture.make(tmp_path)
    assert path.stat().st_size > 20_000
    text = path.with_suffix(".svg").read_text(encoding="utf-8")
    assert "coupling to solver/waves" in text
