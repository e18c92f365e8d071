"""GLSL sources: read from packages, their includes resolved, their constants defined by Python.

`Struct` and `numbered` write once what Python and GLSL agree on: struct layouts and numbered names.
"""

from __future__ import annotations

import functools
import importlib.resources
import re
from importlib.resources.abc import Traversable

from ..errors import GLError


def load_shader(package: str, name: str, stage: str = "", **defines: object) -> str:
    """Read a shader, resolve its includes, and put the defines behind `#version`.

    Parameters
    ----------
    package : str
        The package below which the shader and whatever it includes lie.
    name : str
        Path of the file below the package, without `.glsl`: "passes/classify". A line `#include "glsl/frame.glsl"` is
        replaced by that file, its path likewise relative to the package; a file that was included before is not
        included again.
    stage : str
        Which of the shaders in the file, if there are several: lines behind `#stage vertex` belong to the stage
        "vertex" alone, up to the next such line; those before the first belong to all. So it is in files included.
    **defines
        Constants, written as `#define NAME value` where the text has the name.

    Raises
    ------
    GLError
        If a file is missing, or the shader does not start with `#version`.
    """
    text = _read(importlib.resources.files(package), f"{name}.glsl", stage, set())
    head, _, body = text.partition("\n")
    if not head.startswith("#version"):
        raise GLError(f"shader {name}.glsl of {package} must start with #version, found {head!r}")
    # only those that it knows: shaders that do not differ in them are the same, and compiled once
    known = set(re.findall(r"\w+", " ".join([body, *map(str, defines.values())])))
    lines = "".join(f"#define {key} {value}\n" for key, value in defines.items() if key in known)
    return f"{head}\n{lines}{body}"


def _read(folder: Traversable, path: str, stage: str, seen: set[str]) -> str:
    """Text of a file with what it includes, as far as it belongs to a stage, unless it has been seen."""
    if path in seen:
        return ""
    seen.add(path)
    file = folder.joinpath(path)
    if not file.is_file():
        raise GLError(f"package {folder.name} has no shader {path}")
    lines, belongs = [], True
    for line in _lines(file):  # type: ignore[arg-type]  # a path can be hashed
        if line.startswith("#stage"):
            belongs = line.split()[1] == stage
        elif belongs:
            lines.append(_read(folder, line.split('"')[1], stage, seen) if line.startswith("#include") else line)
    return "\n".join(lines) + "\n"


@functools.cache  # a batch makes a renderer for every scene
def _lines(file: Traversable) -> list[str]:
    return file.read_text().splitlines()
