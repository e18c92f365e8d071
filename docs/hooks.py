"""What the pages take from the code: equations as MathML, and the scene file's tables."""

from __future__ import annotations

import inspect
import re
import typing
from typing import Any

import latex2mathml.converter
import msgspec

from ripple_sim.scene import scene_file
from ripple_sim.scene.material_entry import PRESETS
from ripple_sim.solver import Material

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


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Fill in the scene file's tables and turn `$...$` and `$$...$$` outside code into MathML, which browsers draw."""
    markdown = markdown.replace("<!-- scene file -->", _scene_tables())
    pieces = re.split(r"(```.*?```|`[^`\n]*`)", markdown, flags=re.DOTALL)
    return "".join(piece if piece.startswith("`") else _with_equations(piece) for piece in pieces)


def _with_equations(text: str) -> str:
    text = re.sub(
        r"\$\$(.+?)\$\$", lambda m: latex2mathml.converter.convert(m[1].strip(), "block"), text, flags=re.DOTALL
    )
    return re.sub(r"\$([^$\n]+)\$", lambda m: latex2mathml.converter.convert(m[1]), text)


def _scene_tables() -> str:
    parts = [_table("", scene_file.SceneFile)]
    seen = set()
    for name, entry in scene_file._TABLES.items():
        if entry is scene_file.MapEntry:
            name = "a map in [ripple.material]"
        if entry not in seen:
            parts.append(_table(name, entry))
        seen.add(entry)
    return "\n\n".join(parts)


def _table(name: str, entry: type[msgspec.Struct]) -> str:
    title = f"`[{name}]`" if name and " " not in name else name.capitalize() or "The file"
    lead, _, rest = (entry.__doc__ or "").partition("\n\n")
    lead = re.sub(r"^`\[+[\w.]+\]+`: ", "", " ".join(lead.split()))
    units = _units(entry)
    rows = [
        f"| `{f.name}` | {_kind(f.type)}{units.get(f.name, '')} | {_default(f)} |"
        for f in msgspec.structs.fields(entry)
    ]
    text = [
        f"### {title}",
        lead[:1].upper() + lead[1:],
        " ".join(rest.split()),
        "| key | value | default |\n| --- | --- | --- |\n" + "\n".join(rows),
    ]
    return "\n\n".join(part for part in text if part)


def _units(entry: type[msgspec.Struct]) -> dict[str, str]:
    """Units of a material's coefficients and of the presets' parameters, as the docstrings of `Material` give them."""
    sources = {
        scene_file.MaterialEntry: [Material],
        scene_file.MaterialChange: [Material],
        scene_file.PresetEntry: [getattr(Material, preset) for preset in PRESETS],
    }
    units: dict[str, list[str]] = {}
    for source in sources.get(entry, []):
        for name, unit in re.findall(r"^(\w+) : .*?\[(.+?)\]$", inspect.getdoc(source) or "", re.MULTILINE):
            if unit not in units.setdefault(name, []):
                units[name].append(unit)
    return {name: f" [{' or '.join(each)}]" for name, each in units.items()}


def _kind(hint: Any) -> str:
    arguments = [each for each in typing.get_args(hint) if each is not type(None)]
    if (
        typing.get_origin(hint) is list
        and arguments
        and isinstance(arguments[0], type)
        and issubclass(arguments[0], msgspec.Struct)
    ):
        return "tables"
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
