"""The reference pages match the code, and troubleshooting quotes the program's messages."""

import importlib
import importlib.util
import inspect
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec
import pytest

import ripple_sim
import ripple_sim.solver
from ripple_sim.cli import COMMANDS
from ripple_sim.encode import MARK
from ripple_sim.render import LOOKS
from ripple_sim.scene import SceneFile

DOCS = Path(__file__).parents[2] / "docs"


def hook(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, DOCS / "hooks" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TABLES = dict(hook("scene_tables").tables(SceneFile))


def objects() -> list[str]:
    """What the pages on Python show, with all that their modules of errors define."""
    found = []
    pages = "\n".join(page.read_text(encoding="utf-8") for page in sorted(DOCS.glob("python*.md")))
    for path in re.findall(r"^::: (\S+)$", pages, re.MULTILINE):
        if path.startswith(("ripple_sim.gymnasium", "ripple_sim.dm_control")):
            continue  # extras, which may be missing; their own tests import them
        if path.endswith(".errors"):
            module = importlib.import_module(path)
            found += [
                f"{path}.{name}" for name, value in vars(module).items() if inspect.isclass(value)
            ]
        else:
            found.append(path)
    return found


def named(path: str) -> Any:
    home, name = path.rsplit(".", 1)
    return getattr(importlib.import_module(home), name)


@pytest.mark.parametrize("path", objects())
def test_the_import_line_of_a_name_imports_it(path: str) -> None:
    space: dict[str, Any] = {}
    exec(hook("import_lines").import_line(path), space)
    assert space[path.rsplit(".", 1)[1]] is named(path)


def test_the_pages_have_every_public_name() -> None:
    shown = {path.rsplit(".", 1)[1] for path in objects()}
    assert {*ripple_sim.__all__, *ripple_sim.solver.__all__, "SceneError"} <= shown


@pytest.mark.parametrize("path", objects())
def test_parameters_that_share_a_line_share_a_default(path: str) -> None:
    """All names on a line of the page have the default of the first.

    An operator once was \"auto\", a height 1280.
    """
    thing = named(path)
    methods = inspect.getmembers(thing, inspect.isroutine) if inspect.isclass(thing) else []
    for each in [thing, *(method for _, method in methods)]:
        try:
            parameters = inspect.signature(each).parameters
        except (TypeError, ValueError):
            continue
        for line in re.findall(r"^(\w+(?:, \w+)+) : ", inspect.getdoc(each) or "", re.MULTILINE):
            defaults = {
                str(parameters[name].default) for name in line.split(", ") if name in parameters
            }
            assert len(defaults) <= 1, (
                f"{path}: {line} have the defaults {', '.join(sorted(defaults))}"
            )


@pytest.mark.parametrize(
    "entry", [SceneFile, *dict.fromkeys(TABLES.values())], ids=lambda entry: entry.__name__
)
def test_every_key_of_a_scene_file_has_a_text(entry: type[msgspec.Struct]) -> None:
    texts = hook("scene_tables").key_texts(entry)
    assert not [field.name for field in msgspec.structs.fields(entry) if not texts.get(field.name)]


def test_the_page_on_scene_files_has_every_table_and_the_words_of_a_look() -> None:
    text = hook("scene_tables").scene_tables()
    for name in TABLES:
        if not name.startswith("ripple.material."):
            assert f"`[{name}]`" in text
    assert ", ".join(f"`{look}`" for look in LOOKS) in text


def test_tables_of_a_plan_with_free_keys_are_documented_as_tables() -> None:
    text = hook("scene_tables").plan_tables()
    assert all(f"| `{name}` | table |" in text for name in ("vary", "model"))


def test_the_page_on_commands_has_the_help_of_every_command_in_a_column_that_fits() -> None:
    text = hook("command_help").all_help()
    assert re.findall(r"^## (\w+)$", text, re.MULTILINE) == list(COMMANDS)
    assert all(f"usage: ripple-sim {name}" in text for name in COMMANDS)
    assert max(map(len, text.splitlines())) <= 88


def test_links_of_the_readme_lead_to_files_and_stay_inside_the_documentation() -> None:
    text = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", text)
    assert len(links) > 20
    assert not [link for link in links if not (DOCS.parent / link).is_file()]
    inside = re.findall(r"\]\(([^)#]+)[^)]*\)", hook("readme").for_documentation(text))
    assert not [link for link in inside if not (DOCS / link).is_file()]


QUOTED = re.findall(
    r"(?<![*\w])\*([^*|]+)\*(?![*\w])", (DOCS / "troubleshooting.md").read_text(encoding="utf-8")
)


@pytest.fixture(scope="module")
def messages() -> str:
    """The source, with strings that go on in the next line in one piece."""
    files = [
        file for name in ("ripple_sim", "solver") for file in (DOCS.parent / name).rglob("*.py")
    ]
    source = "\n".join(file.read_text(encoding="utf-8") for file in files)
    return re.sub(r'"\s*\n\s*f?"', "", source).replace("{MARK}", MARK)


@pytest.mark.parametrize("words", QUOTED)
def test_a_quoted_message_is_the_programs(words: str, messages: str) -> None:
    assert words in messages
