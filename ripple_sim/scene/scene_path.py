"""Where a scene is: the TOML file of a shipped scene's name, or the path of another one."""

from __future__ import annotations

import contextlib
import importlib.resources
from pathlib import Path

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import shown

# By ending: what a file is that is taken for a scene file, and what to do with it.
_A_MESH = "a mesh, not a scene; `ripple-sim drop` drops bodies on it, and a scene file (TOML) may name a model with it"
_NO_SCENES = dict.fromkeys((".obj", ".ply", ".stl", ".off", ".glb", ".gltf"), _A_MESH) | {
    ".xml": "a model, not a scene; give the path of a scene file (TOML) that names it as its `model`"
}


def shipped_scenes() -> list[str]:
    """Names of the scenes that come with ripple-sim."""
    folder = importlib.resources.files("ripple_sim.scenes")
    return sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))


def scene_path(name_or_path: str | Path) -> Path:
    """Path of a scene's TOML file, of a shipped scene's name or as it is given.

    Raises
    ------
    SceneError
        If there is no such scene or file.
    """
    name, shipped = str(name_or_path), shipped_scenes()
    if name in shipped:
        return Path(str(importlib.resources.files("ripple_sim.scenes") / f"{name}.toml"))
    path = Path(name)
    with contextlib.suppress(OSError):  # a name longer than the system's
        if path.is_file():
            if kind := _NO_SCENES.get(path.suffix.lower()):
                raise SceneError(f"{shown(name)} is {kind}")
            return path
        if path.exists() and not path.is_dir():
            raise SceneError(f"scene {shown(name)} is not a regular file; give the path of a TOML file")
    raise SceneError(
        f"there is no scene {shown(name)}; shipped scenes are {', '.join(shipped)}, or give the path of a TOML file"
    )
