"""`Scene`: a MuJoCo model, what ripples in it, the camera, the duration and the script."""

from __future__ import annotations

import dataclasses
from typing import Any

import msgspec
import mujoco

from ripple_sim.errors import SceneError

from .camera_entry import CameraEntry, check_camera
from .events import Events
from .scene_file import RippleEntry, SensorEntry, converted

# A run takes less than this, a day [s].
MAX_DURATION = 86_400

# Highest factor by which a video is slower than the simulation.
MAX_SLOW_MOTION = 1000


def check_duration(duration: float, slow_motion: float = 1.0) -> None:
    """Raise `SceneError` if the duration [s] of a run or its slow motion is out of range."""
    if not 0 < duration < MAX_DURATION:
        raise SceneError(
            f"duration must be a positive number, less than {MAX_DURATION}, got {duration!r} s"
        )
    if not 0 < slow_motion <= MAX_SLOW_MOTION:
        raise SceneError(
            f"slow motion must be a positive number up to {MAX_SLOW_MOTION}, got {slow_motion!r}"
        )


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """A MuJoCo model and what ripples in it.

    Attributes
    ----------
    name : str
    model : mujoco.MjModel
    targets : tuple of RippleEntry
    camera : CameraEntry
    duration : float
        [s].
    events : Events
        Timed events of bodies and surfaces.
    two_way : bool
        Whether rippling surfaces push back on the bodies that touch them.
    overlay : tuple of str
        Overlays of the frames, see `parse_request`.
    lighting : str
        One of `LIGHTING`: "auto", "model" or "studio", see `Renderer`.
    notes : tuple of str
        What was done to the mesh on reading, one line each, if the scene was made from a mesh.
    sensors : tuple of SensorEntry
    """

    name: str
    model: mujoco.MjModel
    targets: tuple[RippleEntry, ...]
    camera: CameraEntry
    duration: float
    events: Events = dataclasses.field(default_factory=Events)
    two_way: bool = False
    overlay: tuple[str, ...] = ()
    lighting: str = "auto"
    notes: tuple[str, ...] = ()
    sensors: tuple[SensorEntry, ...] = ()

    @property
    def contacts(self) -> dict[str, list[str]]:
        """Geoms that collide for a target, by target, if its entry names them; see `Ripples`."""
        return {entry.geom: entry.contacts for entry in self.targets if entry.contacts is not None}


def through_camera(scene: Scene, name: str | None) -> Scene:
    """The scene seen through a camera of its model; None leaves it as it is.

    Raises `SceneError` if the model has no such camera.
    """
    if name is None:
        return scene
    camera = CameraEntry(name=name)
    check_camera(scene.model, camera)
    return dataclasses.replace(scene, camera=camera)


def with_exposure(scene: Scene, **changes: Any) -> Scene:
    """The scene with other values of its camera's shutter, aperture, focus and exposures.

    None leaves a value as it is. Raises `SceneError` if a value is invalid, or would have no
    effect.
    """
    values = {name: value for name, value in changes.items() if value is not None}
    fields = {**msgspec.structs.asdict(scene.camera), **values}
    camera = converted(fields, CameraEntry, "camera")
    check_camera(scene.model, camera)
    if "focus" in values and not camera.aperture:
        raise SceneError(
            "a focus needs a lens: give the camera an aperture of more than 0 m, such as 0.05"
        )
    if values.get("exposures", 1) > 1 and not (camera.shutter or camera.aperture):
        raise SceneError(
            f"all {camera.exposures} exposures would be the same: give the camera a shutter angle, "
            "such as 180 degrees, an aperture, such as 0.05 m, or both"
        )
    return dataclasses.replace(scene, camera=camera)
