"""Fingerprints of a scene with all its files, and of the software that simulates and renders it."""

from __future__ import annotations

import functools
import hashlib
from importlib.metadata import version
from pathlib import Path

import msgspec
import mujoco
import numpy as np

from ripple_sim.scene.scene import Scene
from ripple_sim.solver.gl import GLContext

_PACKAGES = ("ripple-sim", "mujoco", "numpy", "numba", "moderngl", "av", "pillow")


def provenance(scene: Scene, gl: GLContext) -> dict[str, str]:
    """Fingerprint of a scene, name of the OpenGL driver, and versions of the packages, by name."""
    return {**origin(scene), "the OpenGL driver": f"{gl.renderer}, {gl.version}"}


def origin(scene: Scene) -> dict[str, str]:
    """Fingerprint of a scene and versions of the packages, by name."""
    return {"the scene's fingerprint": scene_digest(scene), **_versions()}


@functools.cache
def _versions() -> dict[str, str]:
    return {f"the version of {package}": version(package) for package in _PACKAGES}


def scene_digest(scene: Scene) -> str:
    """Fingerprint of the model, the surfaces, the camera and the script, 16 hexadecimal digits."""
    hasher = hashlib.blake2b(digest_size=8)
    model = np.zeros(mujoco.mj_sizeModel(scene.model), np.uint8)
    mujoco.mj_saveModel(scene.model, None, model)
    hasher.update(model.tobytes())
    for entry in scene.targets:
        for each in entry.material.maps().values():
            hasher.update(Path(each.map).read_bytes())
        if entry.still_map is not None:
            hasher.update(Path(entry.still_map).read_bytes())
    hasher.update(msgspec.json.encode((scene.targets, scene.camera, scene.events, scene.two_way)))
    return hasher.hexdigest()
