"""Saving what the viewer shows as a scene file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from ripple_sim.scene.camera_entry import CameraEntry, check_camera
from ripple_sim.scene.saving import write_model, write_scene
from ripple_sim.scene.scene import Scene
from ripple_sim.scene.scene_file import RippleEntry, SceneFile, converted, parse_scene
from ripple_sim.scene.source import read_toml

from .opening import Opened

# What a free camera does not keep of the camera that the user has moved away from.
_PLACES = ("name", "track", "orbit", "key", "lookat", "distance", "azimuth", "elevation", "fovy")


def save_scene(
    origin: Opened, targets: Sequence[RippleEntry], camera: CameraEntry, path: Path
) -> None:
    """Write a scene file that shows a scene with other materials or from another camera.

    A scene file names the MJCF of its origin by its full path. A mesh gets an MJCF of its own, of
    the same name with the ending .xml.

    Raises
    ------
    OSError
        If a file cannot be written.
    SceneError
        If the origin can no longer be read.
    """
    entries = [entry.located(Path.cwd()) for entry in targets]
    if origin.file is not None:
        content = parse_scene(read_toml(origin.file, "scene file"), str(origin.file))
        content.model = str((origin.file.parent / content.model).absolute())
        content.ripple = entries
    else:
        model = path.with_suffix(".xml")
        write_model(origin.spec.copy(), model)
        scene = origin.scene
        content = SceneFile(
            model=model.name,
            ripple=entries,
            duration=scene.duration,
            lighting=scene.lighting,
            drop=list(scene.events.drop),
        )
    content.camera = camera
    write_scene(content, path)


def moved_camera(scene: Scene, place: dict[str, Any]) -> CameraEntry:
    """The scene's camera as a free camera at another place: lookat, distance, angles and fovy.

    Raises `SceneError` for an impossible place.
    """
    other_settings = {
        name: value
        for name, value in msgspec.structs.asdict(scene.camera).items()
        if name not in _PLACES
    }
    camera = converted({**other_settings, **place}, CameraEntry, "camera")
    check_camera(scene.model, camera)
    return camera
