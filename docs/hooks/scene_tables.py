"""The tables of keys of scene files and plans, for the documentation.

Words, units, defaults and texts are read from the code.
"""

from __future__ import annotations

import ast
import inspect
import itertools
import re
import textwrap
import typing
from collections.abc import Iterable, Iterator
from typing import Any

import msgspec

from ripple_sim.batch.distribution import Distribution
from ripple_sim.batch.plan import MeshesEntry, PlanFile, StoreEntry
from ripple_sim.render import LIGHTING, LOOKS
from ripple_sim.scene import scene_file
from ripple_sim.scene.bodies import BODY_SHAPES
from ripple_sim.scene.material_entry import (
    LAWS,
    MapEntry,
    MaterialChange,
    MaterialEntry,
    PresetEntry,
)
from ripple_sim.scene.overlays import NAMES as OVERLAYS
from ripple_sim.solver import Material
from ripple_sim.solver.layouts.build import LAYOUTS
from ripple_sim.solver.operator.plate_rim import RIMS
from ripple_sim.solver.operator.presets import PRESETS
from ripple_sim.solver.texels.maps import CHANNELS

_TYPES = {
    "tuple[float, float, float]": "three numbers",
    "tuple[float, float, float, float]": "four numbers",
    "tuple[float, float]": "two numbers",
    "list[str]": "texts",
    "str": "text",
    "float": "number",
    "int": "whole number",
    "bool": "true or false",
    "MapEntry": "table",
}


# Words that a key takes; a list takes any number of them.
_WORDS: dict[str, Iterable[str]] = {
    "look": LOOKS,
    "layout": LAYOUTS,
    "rim": RIMS,
    "lighting": LIGHTING,
    "overlay": OVERLAYS,
    "preset": (*LAWS, *PRESETS),
    "name": (*LAWS, *PRESETS),
    "shapes": BODY_SHAPES,
    "channel": CHANNELS,
}


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Fill in the tables of a page that asks for them."""
    for mark, tables in (
        ("<!-- scene file -->", scene_tables),
        ("<!-- plan file -->", plan_tables),
    ):
        if mark in markdown:
            markdown = markdown.replace(mark, tables())
    return markdown


def plan_tables() -> str:
    """All tables of a batch's plan."""
    return "\n\n".join(
        _table(name, entry)
        for name, entry in (
            ("", PlanFile),
            ("meshes", MeshesEntry),
            ("store", StoreEntry),
            ("a value that is drawn", Distribution),
        )
    )


def tables(
    outer: type[msgspec.Struct], before: str = ""
) -> Iterator[tuple[str, type[msgspec.Struct]]]:
    """The tables in a table, with their names in a scene file."""
    for field in msgspec.structs.fields(outer):
        entry = scene_file.table_of(field.type)
        if entry is not None:
            yield before + field.name, entry
            yield from tables(entry, f"{before}{field.name}.")


def scene_tables() -> str:
    """All tables, from the classes that scene files are read into."""
    parts = [_table("", scene_file.SceneFile)]
    seen = set()
    for name, entry in tables(scene_file.SceneFile):
        if entry is MapEntry:
            name = "a map in [ripple.material]"
        if entry not in seen:
            parts.append(_table(name, entry))
        seen.add(entry)
    return "\n\n".join(parts)


def _table(name: str, entry: type[msgspec.Struct]) -> str:
    title = f"`[{name}]`" if name and " " not in name else name.capitalize() or "The file"
    lead, _, rest = (entry.__doc__ or "").partition("\n\n")
    lead = re.sub(r"^`\[+[\w.]+\]+`: ", "", " ".join(lead.split()))
    texts = key_texts(entry)
    rows = [
        f"| `{f.name}` | {_values(entry, f)} | {_default(f)} | {texts.get(f.name, '')} |"
        for f in msgspec.structs.fields(entry)
    ]
    text = [
        f"### {title}",
        lead[:1].upper() + lead[1:],
        " ".join(rest.split()),
        "| key | value | default | |\n| --- | --- | --- | --- |\n" + "\n".join(rows),
    ]
    return "\n\n".join(part for part in text if part)


def key_texts(entry: type[msgspec.Struct]) -> dict[str, str]:
    """The text of each key.

    It is the string under the field, or what `Material` says about the coefficient or parameter.
    """
    sources = {
        MaterialEntry: {"": Material},
        MaterialChange: {"": Material},
        PresetEntry: {f"`{preset}`: ": getattr(Material, preset) for preset in LAWS},
    }
    texts: dict[str, list[str]] = {"name": ["The preset."]} if entry is PresetEntry else {}
    for where, source in sources.get(entry, {}).items():
        for name, kind, text in re.findall(
            r"^(\w+) : (.*)(?:\n|$)((?:    .*(?:\n|$))*)",
            inspect.getdoc(source) or "",
            re.MULTILINE,
        ):
            texts.setdefault(name, []).append(
                where + ": ".join(filter(None, [kind, " ".join(text.split())]))
            )
    return {name: "; ".join(each) for name, each in texts.items()} | _own_texts(entry)


def _own_texts(entry: type[msgspec.Struct]) -> dict[str, str]:
    [body] = ast.parse(textwrap.dedent(inspect.getsource(entry))).body
    assert isinstance(body, ast.ClassDef)
    texts = {}
    for field, text in itertools.pairwise(body.body):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(text, ast.Expr)
            and isinstance(text.value, ast.Constant)
        ):
            texts[ast.unparse(field.target)] = " ".join(str(text.value.value).split())
    return texts


def _values(entry: type[msgspec.Struct], field: msgspec.structs.FieldInfo) -> str:
    words = _WORDS.get(field.name) if field.name != "name" or entry is PresetEntry else None
    if words is None:
        return _kind(field.type)
    listed = ", ".join(f"`{word}`" for word in words)
    return f"texts: {listed}" if typing.get_origin(field.type) is list else listed


def _kind(hint: Any) -> str:
    arguments = [each for each in typing.get_args(hint) if each is not type(None)]
    if (
        typing.get_origin(hint) is list
        and arguments
        and isinstance(arguments[0], type)
        and issubclass(arguments[0], msgspec.Struct)
    ):
        return "tables"
    if typing.get_origin(hint) is dict:
        return "table"
    if typing.get_origin(hint) is typing.Literal:
        return ", ".join(f"`{each}`" for each in arguments)
    if arguments and typing.get_origin(hint) not in (tuple, list):
        return " or ".join(_kind(each) for each in arguments)
    plain = getattr(hint, "__name__", str(hint)) if not arguments else str(hint)
    return _TYPES.get(plain, "table")


def _default(field: msgspec.structs.FieldInfo) -> str:
    if field.required:
        return "required"
    value = field.default_factory() if field.default is msgspec.NODEFAULT else field.default
    if value is None or value == [] or isinstance(value, msgspec.Struct):
        return "none"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"
