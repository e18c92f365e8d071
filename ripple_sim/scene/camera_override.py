"""A scene seen through another camera, or exposed in another way, than its file says."""

from __future__ import annotations

import dataclasses
from typing import Any

import msgspec

from ripple_sim.errors import SceneError

from .camera import CameraEntry, check_camera
from .scene import Scene


def through_camera(scene: Scene, name: str) -> Scene:
    """The scene seen through a camera of its model.

    Raises
    ------
    SceneError
        If the model has no such camera.
    """
    camera = CameraEntry(name=name)
    check_camera(scene.model, camera)
    return dataclasses.replace(scene, camera=camera)


def with_exposure(scene: Scene, **changes: Any) -> Scene:
    """The scene with other values of its camera's shutter, aperture, focus and exposures; None leaves one as it is.

    Raises
    ------
    SceneError
        If a value is invalid, or would have no effect.
    """
    given = {name: value for name, value in changes.items() if value is not None}
    try:
        camera = msgspec.convert({**msgspec.structs.asdict(scene.camera), **given}, CameraEntry)
    except msgspec.ValidationError as error:
        raise SceneError(f"camera: {str(error).replace('`$.', '`')}") from error
    check_camera(scene.model, camera)
    if "focus" in given and not camera.aperture:
        raise SceneError("a focus needs a lens: give the camera an aperture of more than 0 m, such as 0.05")
    if given.get("exposures", 1) > 1 and not (camera.shutter or camera.aperture):
        raise SceneError(
            f"all {camera.exposures} exposures would be the same: give the camera a shutter angle, such as 180 degrees,"
            " an aperture, such as 0.05 m, or both"
        )
    return dataclasses.replace(scene, camera=camera)
