"""Where the TOML file of a scene is, and how it is read as a table."""

from __future__ import annotations

import contextlib
import importlib.resources
import re
import tomllib
from pathlib import Path
from typing import Any

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import shown

# What to do with a mesh, and with a model, in place of a scene file.
_A_MESH = (
    "a mesh, not a scene; `ripple-sim drop` drops bodies on it, and a scene file (TOML) may "
    "name a model with it"
)
_A_MODEL = "a model, not a scene; give the path of a scene file (TOML) that names it as its `model`"

# Kinds of files that may be taken for scene files, by ending, and what to do with them.
_NO_SCENES = {
    ".obj": _A_MESH,
    ".ply": _A_MESH,
    ".stl": _A_MESH,
    ".off": _A_MESH,
    ".glb": _A_MESH,
    ".gltf": _A_MESH,
    ".xml": _A_MODEL,
}

# Largest number of parts of a dotted key: tomllib's time grows with its square. Keys of scene files
# have four.
_MAX_KEY_PARTS = 100


def shipped_scenes() -> list[str]:
    """Names of the scenes that come with ripple-sim."""
    folder = importlib.resources.files("ripple_sim.scenes")
    return sorted(
        item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml")
    )


def scene_path(name_or_path: str | Path) -> Path:
    """Path of a scene's TOML file, from the name of a shipped scene or from the path itself.

    Raises `SceneError` if there is no such scene or file.
    """
    name = str(name_or_path)
    shipped = shipped_scenes()
    if name in shipped:
        return Path(str(importlib.resources.files("ripple_sim.scenes") / f"{name}.toml"))
    path = Path(name)
    with contextlib.suppress(OSError):  # a name longer than the system's
        if path.is_file():
            kind = _NO_SCENES.get(path.suffix.lower())
            if kind is not None:
                raise SceneError(f"{shown(name)} is {kind}")
            return path
        if path.exists() and not path.is_dir():
            raise SceneError(
                f"scene {shown(name)} is not a regular file; give the path of a TOML file"
            )
    raise SceneError(
        f"there is no scene {shown(name)}; shipped scenes are {', '.join(shipped)}, or give the "
        "path of a TOML file"
    )


def read_toml(path: Path, kind: str) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : Path
    kind : str
        Kind of the file, such as "scene file", for messages.

    Raises
    ------
    SceneError
        If it cannot be read or is not valid TOML.
    """
    name = f"{kind} {str(path)!r}"
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise SceneError(f"{name} does not exist; give the path of a TOML file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(f"{name} cannot be read: {error}") from error
    keys = re.split(r"[=,\n]", text)
    parts = max(len(re.findall(r"[^.\s]\s*\.", key)) + 1 for key in keys)
    if parts > _MAX_KEY_PARTS:
        raise SceneError(
            f"{name}: a key must have at most {_MAX_KEY_PARTS} parts with dots between them, "
            f"got {parts}"
        )
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise SceneError(
            f"{name} is nested too deeply; its tables have four levels at most"
        ) from error
    except ValueError as error:  # also raised for a number with thousands of digits
        raise SceneError(f"{name} is not valid TOML: {error}") from error
