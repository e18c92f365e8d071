"""GLSL sources: read from packages, with their includes resolved and Python's constants defined."""

from __future__ import annotations

import functools
import importlib.resources
import re
from importlib.resources.abc import Traversable

from ..errors import GLError


# Steps and frames ask for their shaders anew. Typed, since 1 and 1.0 are written differently.
@functools.lru_cache(maxsize=None, typed=True)
def load_shader(package: str, name: str, stage: str = "", **defines: object) -> str:
    """Read a shader, resolve its includes, and put the defines behind `#version`.

    Parameters
    ----------
    package : str
        The package below which the shader and its included files lie.
    name : str
        Path of the file below the package, without `.glsl`: "passes/classify". A line `#include
        "glsl/frame.glsl"` is replaced by that file, its path likewise relative to the package; a
        file that was included before is not included again.
    stage : str
        Which of the shaders in the file, if there are several: lines behind `#stage vertex` belong
        to the stage "vertex" only, up to the next such line. Lines before the first `#stage` belong
        to all stages. The same holds for included files.
    **defines
        Constants, written as `#define NAME value` where the text has the name. GROUP is the number
        of threads in a group of a compute shader; the group's layout is declared as well.

    Raises
    ------
    GLError
        If a file is missing, or the shader does not start with `#version`.
    """
    text = _read(importlib.resources.files(package), f"{name}.glsl", stage, set())
    head, _, body = text.partition("\n")
    if not head.startswith("#version"):
        raise GLError(f"shader {name}.glsl of {package} must start with #version, found {head!r}")
    # only names that occur: shaders that differ in other names alone have the same text, which is
    # compiled once
    used_names = set(re.findall(r"\w+", " ".join([body, *map(str, defines.values())])))
    lines = ""
    for key, value in defines.items():
        if key in used_names:
            lines += f"#define {key} {value}\n"
    layout = f"layout(local_size_x = {defines['GROUP']}) in;\n" if "GROUP" in defines else ""
    return f"{head}\n{lines}{layout}{body}"


def _read(folder: Traversable, path: str, stage: str, seen: set[str]) -> str:
    """Text of a file and its included files, as far as it belongs to a stage.

    The text of a file that was `seen` before is empty.
    """
    if path in seen:
        return ""
    seen.add(path)
    file = folder.joinpath(path)
    if not file.is_file():
        raise GLError(f"package {folder.name} has no shader {path}")
    lines = []
    belongs = True
    for line in _lines(file):  # type: ignore[arg-type]  # a path can be hashed
        if line.startswith("#stage"):
            belongs = line.split()[1] == stage
        elif belongs and line.startswith("#include"):
            lines.append(_read(folder, line.split('"')[1], stage, seen))
        elif belongs:
            lines.append(line)
    return "\n".join(lines) + "\n"


@functools.cache  # a batch makes a renderer for every scene
def _lines(file: Traversable) -> list[str]:
    return file.read_text(encoding="utf-8").splitlines()
