"""Pages name tests, and choose them by `pytest -k`: such tests exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [*sorted((ROOT / "docs").glob("*.md")), ROOT / "README.md", ROOT / "CHANGELOG.md"]


def names_in(path: Path) -> set[str]:
    """File and function of each test in a file or folder, as one text."""
    files = path.rglob("test_*.py") if path.is_dir() else [path]
    return {
        f"{file.stem} {name}"
        for file in files
        for name in re.findall(r"^ *def (test_\w+)", file.read_text(), re.MULTILINE)
    }


@pytest.fixture(scope="module")
def all_tests() -> set[str]:
    return names_in(ROOT / "tests")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tests_that_a_page_names_exist(page: Path, all_tests: set[str]) -> None:
    # not parts of paths, such as those of other packages' tests
    named = re.findall(r"`(test_\w+)`", page.read_text())
    known = {test.split()[1] for test in all_tests}
    assert [name for name in named if name not in known] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_each_word_that_a_page_gives_to_pytest_chooses_a_test(page: Path) -> None:
    command = r'pytest ((?:tests/[\w/.]+ )+)-k (?:"([^"`]+)"|(\w+))'
    for paths, expression, word in re.findall(command, page.read_text()):
        tests = set.union(*(names_in(ROOT / path) for path in paths.split()))
        for each in re.split(r" or | and ", expression or word):
            assert [test for test in tests if each in test] != [], f"-k {each} chooses none"
