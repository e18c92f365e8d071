"""Scenes: one MJCF and one TOML file that names its rippling surfaces, the camera, the duration and the script."""

from __future__ import annotations

import dataclasses
import importlib.resources
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import msgspec
import mujoco
import numpy as np

from ripple_sim.coupling.model.geoms import find_target
from ripple_sim.errors import SceneError

from .events import Events, Script
from .motion import DropEntry, ThrowEntry
from .overlays import parse_request
from .randomize import RandomEntry, randomize
from .scene_file import CameraEntry, RippleEntry, parse_scene

Moved = TypeVar("Moved", DropEntry, ThrowEntry)
Edit = Callable[[mujoco.MjSpec], None]


MAX_DURATION = 86_400  # [s], a day


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """A MuJoCo model and what ripples in it.

    Attributes
    ----------
    name : str
    model : mujoco.MjModel
    surfaces : tuple of RippleEntry
    camera : CameraEntry
    duration : float
        [s].
    events : Events
        What happens to bodies and surfaces at given times.
    two_way : bool
        Whether moving surfaces push back on the bodies that touch them.
    overlay : tuple of str
        What is drawn over the pictures, see `parse_request`.
    lighting : str
        One of `LIGHTING`: "auto", "model" or "studio", see `Renderer`.
    """

    name: str
    model: mujoco.MjModel
    surfaces: tuple[RippleEntry, ...]
    camera: CameraEntry
    duration: float
    events: Events = dataclasses.field(default_factory=Events)
    two_way: bool = False
    overlay: tuple[str, ...] = ()
    lighting: str = "auto"


def shipped_scenes() -> list[str]:
    """Names of the scenes that come with ripple-sim."""
    folder = importlib.resources.files("ripple_sim.scenes")
    return sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))


def load_scene(name_or_path: str | Path, edit: Edit | None = None) -> Scene:
    """Load a shipped scene by its name, or any scene by the path of its TOML file.

    Parameters
    ----------
    name_or_path : str or path
    edit : callable, optional
        Called with the model's specification (`mujoco.MjSpec`) before it is compiled, to change it in place.

    Raises
    ------
    SceneError
        If there is no such scene or file, the TOML has an unknown key or a wrong value, MuJoCo refuses the MJCF, or a
        geom or camera is not in it.
    """
    path = _scene_path(str(name_or_path))
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(f"scene file {str(path)!r} cannot be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"scene file {str(path)!r} is not valid TOML: {error}") from error
    content = parse_scene(table, str(path))
    model, shifts = load_model(path.parent / content.model, content.random, edit)
    scene = Scene(
        name=path.stem,
        model=model,
        surfaces=tuple(entry.located(path.parent) for entry in content.ripple),
        camera=content.camera,
        duration=content.duration,
        events=Events(
            drop=_shifted(content.drop, shifts),
            throw=_shifted(content.throw, shifts),
            place=tuple(content.place),
            poke=tuple(content.poke),
            change=tuple(content.change),
            control=tuple(content.control),
        ),
        two_way=content.two_way,
        overlay=tuple(content.overlay),
        lighting=content.lighting,
    )
    check_scene(scene)
    return scene


def _scene_path(name_or_path: str) -> Path:
    shipped = shipped_scenes()
    if name_or_path in shipped:
        return Path(str(importlib.resources.files("ripple_sim.scenes") / f"{name_or_path}.toml"))
    path = Path(name_or_path)
    if path.is_file():
        return path
    raise SceneError(
        f"there is no scene {name_or_path!r}; shipped scenes are {', '.join(shipped)}, or give the path of a TOML file"
    )


def _shifted(entries: Sequence[Moved], shifts: dict[str, np.ndarray]) -> tuple[Moved, ...]:
    """The entries, with their positions moved as far as their bodies were."""
    return tuple(
        msgspec.structs.replace(entry, position=tuple(float(x) for x in np.add(entry.position, shifts[entry.body])))
        if entry.position is not None and entry.body in shifts
        else entry
        for entry in entries
    )


def load_model(
    path: Path, random: RandomEntry | None = None, edit: Edit | None = None
) -> tuple[mujoco.MjModel, dict[str, np.ndarray]]:
    """Compile an MJCF file, and tell how far each of its bodies was shifted at random [m].

    Raises
    ------
    SceneError
        If the file is missing or MuJoCo refuses it, with MuJoCo's reason, or the randomisation is invalid.
    """
    if not path.is_file():
        problem = "is no file" if path.exists() else "does not exist"
        raise SceneError(f"MJCF file {str(path)!r} {problem}; `model` names it, relative to the scene file")
    try:
        if random is None and edit is None:
            return mujoco.MjModel.from_xml_path(str(path)), {}
        spec = mujoco.MjSpec.from_file(str(path))
        shifts = {} if random is None else randomize(spec, random)
        if edit is not None:
            edit(spec)
        return spec.compile(), shifts
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise SceneError(f"MuJoCo refuses {str(path)!r}: {reason}") from error


def check_scene(scene: Scene) -> None:
    """Check a scene's names and numbers against its model.

    Raises
    ------
    SceneError
    SolverError
        For an invalid material.
    """
    # the renderer is not needed for anything but the names of its looks and its cameras
    from ripple_sim.capture.viewpoint import check_camera
    from ripple_sim.render import LIGHTING, LOOKS

    if not scene.surfaces:
        raise SceneError(f"scene {scene.name!r} has no [[ripple]] surface; name at least one geom")
    if not 0 < scene.duration < MAX_DURATION:
        raise SceneError(f"duration is {scene.duration!r} s; valid is a positive number, less than {MAX_DURATION}")
    seen = set()
    for entry in scene.surfaces:
        find_target(scene.model, entry.geom)
        if entry.geom in seen:
            raise SceneError(f"geom {entry.geom!r} has two [[ripple]] entries; valid is one")
        seen.add(entry.geom)
        if entry.look not in LOOKS:
            raise SceneError(f"look {entry.look!r} does not exist; valid are {', '.join(LOOKS)}")
        if entry.color is not None and not all(0 <= part <= 1 for part in entry.color):
            raise SceneError(
                f"color of geom {entry.geom!r} is {entry.color}; valid are three numbers from 0 to 1 (sRGB)"
            )
        entry.material.material()
        for coefficient, each in entry.material.maps().items():
            if not Path(each.map).is_file():
                raise SceneError(
                    f"ripple.material.{coefficient} names the picture {each.map!r}, which does not exist; "
                    "valid is a number, or the path of a picture relative to the scene file"
                )
        if entry.still_map is not None and not Path(entry.still_map).is_file():
            raise SceneError(
                f"ripple.still_map names the picture {entry.still_map!r}, which does not exist; valid is the path of a "
                "picture relative to the scene file"
            )
        for disc in entry.still:
            if not 0 < disc.radius < float("inf"):
                raise SceneError(f"a still disc of geom {entry.geom!r} has radius {disc.radius!r} m; valid is above 0")
    parse_request(scene.overlay)
    if scene.lighting not in LIGHTING:
        raise SceneError(f"lighting is {scene.lighting!r}; valid are {', '.join(map(repr, LIGHTING))}")
    Script(scene.model, scene.events, [entry.geom for entry in scene.surfaces])
    check_camera(scene.model, scene.camera)
