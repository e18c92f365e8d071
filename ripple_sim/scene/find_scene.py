"""A scene by its name, its file, or the mesh on which bodies drop."""

from __future__ import annotations

from pathlib import Path

from ripple_sim.errors import SceneError

from .drop import drop_scene
from .load_scene import load_scene
from .scene import Scene
from .scene_path import scene_path, shipped_scenes


def find_scene(target: str | Path, *, seed: int | None = None) -> Scene:
    """Scene of a shipped scene's name, a TOML file or a mesh file.

    Parameters
    ----------
    target : str or path
    seed : int, optional
        As for `load_scene`, or of `drop_scene`.

    Raises
    ------
    SceneError
        If there is no such scene or file, or it is invalid.
    MeshError
        If a mesh cannot be read.
    """
    return load_scene(target, seed=seed) if is_scene(target) else drop_scene(target, seed=seed or 0)


def is_scene(target: str | Path) -> bool:
    """Whether a target is a scene, by its name or its file, and not a mesh.

    Raises
    ------
    SceneError
        If there is neither.
    """
    path = Path(target)
    if str(target) in shipped_scenes() or path.suffix.lower() == ".toml":
        scene_path(target)
        return True
    if path.is_file():
        return False
    raise SceneError(
        f"there is no scene or mesh {str(target)!r}; shipped scenes are {', '.join(shipped_scenes())}, or give the "
        "path of a scene file (TOML) or of a mesh"
    )
