"""`Scene`: a MuJoCo model, what ripples in it, the camera, the duration and the script."""

from __future__ import annotations

import dataclasses

import mujoco

from .camera import CameraEntry
from .events import Events
from .scene_file import RippleEntry

MAX_DURATION = 86_400  # [s], a day


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
        What was done to its mesh on reading, one line each, where it was made from one.
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

    @property
    def contacts(self) -> dict[str, list[str]]:
        """Geoms that collide for targets which name them, see `Ripples`."""
        return {entry.geom: entry.contacts for entry in self.targets if entry.contacts is not None}
