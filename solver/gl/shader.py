"""GLSL sources: read from packages, their includes resolved, their constants defined by Python.

What Python and GLSL agree on: struct layouts and numbered names, written once here and defined in shaders.
"""

from __future__ import annotations

import functools
import importlib.resources
from enum import IntEnum
from importlib.resources.abc import Traversable
from typing import Any, TypeAlias

import numpy as np

from ..errors import GLError

# Shapes of what std140 and std430 lay out alike, in float32: the columns of a mat3 are padded to four.
_SHAPES: dict[str, tuple[int, ...]] = {"vec4": (4,), "mat3": (3, 4), "mat4": (4, 4)}

Member: TypeAlias = "str | Struct | tuple[str | Struct, int]"


class Struct:
    """A struct in GLSL and the NumPy dtype of the same layout, in uniform blocks (std140) and storage buffers (std430).

    Parameters
    ----------
    name : str
        In GLSL.
    **members
        "vec4", "mat3", "mat4" or another struct, or a pair of one of these and the length of an array of them.

    Attributes
    ----------
    dtype : numpy.dtype
        Matrices are stored column by column: a mat4 is [column, row], a mat3 [column, row and padding].
    members : str
        The declarations, to be put between the braces of a struct or block.
    """

    def __init__(self, name: str, /, **members: Member) -> None:
        self.name = name
        fields: list[tuple[Any, ...]] = []
        declarations = []
        for member, given in members.items():
            kind, count = given if isinstance(given, tuple) else (given, None)
            word = kind if isinstance(kind, str) else kind.name
            declarations.append(f"{word} {member};" if count is None else f"{word} {member}[{count}];")
            base, shape = ("f4", _SHAPES[kind]) if isinstance(kind, str) else (kind.dtype, ())
            fields.append((member, base, shape if count is None else (count, *shape)))
        self.dtype: np.dtype[Any] = np.dtype(fields)
        self.members = " ".join(declarations)

    def defines(self) -> dict[str, str]:
        """`NAME_MEMBERS`: the declarations."""
        return {f"{self.name.upper()}_MEMBERS": self.members}


def numbered(names: type[IntEnum], suffix: str = "") -> dict[str, int]:
    """Defines of an enumeration's names, each with a suffix."""
    return {f"{each.name}{suffix}": each.value for each in names}


def load_shader(package: str, name: str, **defines: object) -> str:
    """Read a shader, resolve its includes, and put the defines behind `#version`.

    Parameters
    ----------
    package : str
        The package below which the shader and whatever it includes lie.
    name : str
        Path of the file below the package, without `.glsl`: "passes/classify_fragment". A line
        `#include "gpu/frame_uniforms.glsl"` is replaced by that file, its path likewise relative to the package; a
        file that was included before is not included again.
    **defines
        Constants, written as `#define NAME value`.

    Raises
    ------
    GLError
        If a file is missing, or the shader does not start with `#version`.
    """
    text = _read(importlib.resources.files(package), f"{name}.glsl", set())
    head, _, body = text.partition("\n")
    if not head.startswith("#version"):
        raise GLError(f"shader {name}.glsl of {package} must start with #version, found {head!r}")
    lines = "".join(f"#define {key} {value}\n" for key, value in defines.items())
    return f"{head}\n{lines}{body}"


def _read(folder: Traversable, path: str, seen: set[str]) -> str:
    """Text of a file with what it includes, unless it has been seen."""
    if path in seen:
        return ""
    seen.add(path)
    file = folder.joinpath(path)
    if not file.is_file():
        raise GLError(f"package {folder.name} has no shader {path}")
    lines = []
    for line in _lines(file):  # type: ignore[arg-type]  # a path can be hashed
        lines.append(_read(folder, line.split('"')[1], seen) if line.startswith("#include") else line)
    return "\n".join(lines) + "\n"


@functools.cache  # a batch makes a renderer for every scene
def _lines(file: Traversable) -> list[str]:
    return file.read_text().splitlines()
