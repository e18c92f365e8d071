"""`Source`: what an export records; `Writer`: the interface of everything that writes an export."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Protocol

import mujoco

from ripple_sim.capture.scene_camera import viewpoint
from ripple_sim.coupling.ripples import Impulse, Ripples
from ripple_sim.encode.part import Settings
from ripple_sim.render.pose import Pose
from ripple_sim.scene.camera_entry import CameraEntry
from ripple_sim.solver.waves.sensor import Sensor

from .moving_mesh import MovingMesh


@dataclasses.dataclass(frozen=True, eq=False)
class Source:
    """The recorded data of a frame.

    Attributes
    ----------
    model : mujoco.MjModel
    ripples : Ripples
    fps : float
        Frames in a second of the file.
    slow_motion : float
        Seconds of the file per second of the simulation.
    camera : CameraEntry
    size : (width, height)
        Of the frames that the camera is meant for [pixels].
    lighting : str
        One of `LIGHTING`.
    paints : mapping
        Look, one of `LOOKS`, and sRGB colour of a target if it is given one, by its name.
    limited : mapping
        Whether heights are bent, by the target's name.
    tessellation, triangles : str, int
        Of the surfaces, see `MovingMesh`.
    chunk : int
        Frames in each of the files over which a run is divided, or 0: it is one file.
    output : Path
        Of a run in chunks; beside it stands NAME.part with the complete ones until all is complete.
    settings : mapping, optional
        All settings that the output depends on, by name. With them complete chunks survive an
        interruption.
    resume : bool
        Keep those that are there.
    sensors : mapping
        Of a scene, by name.
    signals : bool
        Whether a table is of their samples.
    replay : bool
        Whether a page plays recorded heights rather than solve the waves itself.
    mesh_format : str
        "ply" or "glb", of the files in a folder of meshes.
    height_colors : float or "auto", optional
        Height at which the colours of meshes end [m]; "auto" is the greatest in each file.
    """

    model: mujoco.MjModel
    ripples: Ripples
    fps: float
    camera: CameraEntry
    size: tuple[int, int]
    lighting: str
    paints: Mapping[str, tuple[str, tuple[float, float, float] | None]]
    limited: Mapping[str, bool]
    tessellation: str
    triangles: int
    slow_motion: float = 1.0
    chunk: int = 0
    output: Path = Path()
    settings: Settings | None = None
    resume: bool = False
    sensors: Mapping[str, Sensor] = dataclasses.field(default_factory=dict)
    signals: bool = False
    replay: bool = False
    mesh_format: str = "ply"
    height_colors: float | Literal["auto"] | None = None

    def mesh(self, name: str) -> MovingMesh:
        """The surface of a target."""
        return MovingMesh(
            self.ripples[name].rest, self.tessellation, self.limited[name], self.triangles
        )

    def pose(self, data: mujoco.MjData) -> Pose:
        """The camera in the world."""
        return viewpoint(self.model, data, self.camera, data.time).pose()


class Writer(Protocol):
    """Writes a run to a file or folder, frame by frame; it is made with its source and path."""

    # what there is to say of the complete file, in a line of the summary
    note: str = ""

    _file: Any = None  # the file that is open all the time, if there is one

    def write(self, number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Add a frame with its number, from 0, and the impulses since the frame before.

        The ripples are those of the source.
        """

    def finish(self) -> None:
        """Complete the file."""

    def close(self) -> str:
        """Leave the file incomplete; say which files are kept for resuming, if any."""
        with contextlib.suppress(OSError):
            if self._file is not None:
                self._file.close()
        return ""
