"""`Scene`: a MuJoCo model, what ripples in it, the camera, the duration and the script.

Where its TOML file is, by a shipped scene's name or a path, and how it is read as a table, whatever it holds; the scene
through another camera, or exposed in another way; and overlays by name, such as "velocity=0.5".
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.resources
import math
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec
import mujoco

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import shown

from .events import Events
from .scene_file import CameraEntry, RippleEntry, SensorEntry, check_camera, converted

MAX_DURATION = 86_400  # [s], a day
MAX_SLOW_MOTION = 1000


def check_duration(duration: float, slow_motion: float = 1.0) -> None:
    """Raise `SceneError` if the duration [s] of a run or its slow motion is out of range."""
    if not 0 < duration < MAX_DURATION:
        raise SceneError(f"duration is {duration!r} s; valid is a positive number, less than {MAX_DURATION}")
    if not 0 < slow_motion <= MAX_SLOW_MOTION:
        raise SceneError(f"slow motion is {slow_motion!r}; valid is a positive number up to {MAX_SLOW_MOTION}")


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
        """Geoms that collide for targets which name them, see `Ripples`."""
        return {entry.geom: entry.contacts for entry in self.targets if entry.contacts is not None}


def through_camera(scene: Scene, name: str) -> Scene:
    """The scene seen through a camera of its model; raises `SceneError` if the model has no such camera."""
    camera = CameraEntry(name=name)
    check_camera(scene.model, camera)
    return dataclasses.replace(scene, camera=camera)


def with_exposure(scene: Scene, **changes: Any) -> Scene:
    """The scene with other values of its camera's shutter, aperture, focus and exposures; None leaves one as it is.

    Raises `SceneError` if a value is invalid, or would have no effect.
    """
    given = {name: value for name, value in changes.items() if value is not None}
    camera = converted({**msgspec.structs.asdict(scene.camera), **given}, CameraEntry, "camera")
    check_camera(scene.model, camera)
    if "focus" in given and not camera.aperture:
        raise SceneError("a focus needs a lens: give the camera an aperture of more than 0 m, such as 0.05")
    if given.get("exposures", 1) > 1 and not (camera.shutter or camera.aperture):
        raise SceneError(
            f"all {camera.exposures} exposures would be the same: give the camera a shutter angle, such as 180 degrees,"
            " an aperture, such as 0.05 m, or both"
        )
    return dataclasses.replace(scene, camera=camera)


HEATMAPS = {"height": "m", "velocity": "m/s"}
NAMES = (*HEATMAPS, "contacts", "grid", "time", "energy", "sensors")


@dataclasses.dataclass(frozen=True)
class Request:
    """Overlays to draw.

    Attributes
    ----------
    heatmap : str or None
        "height" or "velocity": shown as colours on the targets, with a colour bar.
    limit : float or None
        End of the colours, in m or m/s; None: adapts to the waves during the video.
    contacts, grid, time, energy, sensors : bool
        Arrows of the impulses at the contact points; the texel grid; a clock; a plot of the waves' energy, with that of
        bodies and both; the traces of the scene's sensors.
    """

    heatmap: str | None = None
    limit: float | None = None
    contacts: bool = False
    grid: bool = False
    time: bool = False
    energy: bool = False
    sensors: bool = False


def parse_request(words: Iterable[str]) -> Request:
    """Read names of overlays; "height" and "velocity" may have a range, such as "height=0.02" [m, m/s].

    Raises `SceneError` for an unknown name, a range that is not a positive number or of an overlay without range, or
    two heatmaps.
    """
    chosen: dict[str, float | None] = {}
    for word in words:
        name, given, value = word.strip().partition("=")
        if name not in NAMES:
            raise SceneError(f"there is no overlay {name!r}; valid are {', '.join(NAMES)}")
        if given and name not in HEATMAPS:
            raise SceneError(f"overlay {word.strip()!r}: {name} has no range; only {' and '.join(HEATMAPS)} have one")
        chosen[name] = None
        if given:
            limit = math.nan
            with contextlib.suppress(ValueError):
                limit = float(value)
            if not 0 < limit < math.inf:
                raise SceneError(f"overlay {word.strip()!r}: the range must be a positive number [{HEATMAPS[name]}]")
            chosen[name] = limit
    heatmaps = [name for name in HEATMAPS if name in chosen]
    if len(heatmaps) > 1:
        raise SceneError(f"overlays {' and '.join(heatmaps)} cannot both colour the surface; choose one")
    return Request(
        heatmap=heatmaps[0] if heatmaps else None,
        limit=chosen[heatmaps[0]] if heatmaps else None,
        **{name: name in chosen for name in NAMES if name not in HEATMAPS},
    )


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

    Raises `SceneError` if there is no such scene or file.
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


# Parts of one dotted key: tomllib's time grows with their square, and ours have four.
_MOST_PARTS = 100


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : Path
    what : str
        What the file is, for messages.

    Raises
    ------
    SceneError
        If it cannot be read or is not valid TOML.
    """
    name = f"{what} {str(path)!r}"
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise SceneError(f"{name} does not exist; give the path of a TOML file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(f"{name} cannot be read: {error}") from error
    parts = max(len(re.findall(r"[^.\s]\s*\.", line)) + 1 for line in re.split(r"[=,\n]", text))
    if parts > _MOST_PARTS:
        raise SceneError(f"{name} has a key of {parts} parts with dots between them; valid are at most {_MOST_PARTS}")
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise SceneError(f"{name} is nested too deeply; its tables have four levels at most") from error
    except ValueError as error:  # also of a number with thousands of digits
        raise SceneError(f"{name} is not valid TOML: {error}") from error
