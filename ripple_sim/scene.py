"""Scenes: one MJCF and one TOML file that names its rippling surfaces, the camera and the duration."""

from __future__ import annotations

import dataclasses
import importlib.resources
import tomllib
from pathlib import Path
from typing import Any

import msgspec
import mujoco

from ripple_sim.solver import Material

from .drops import DropEntry, Drops
from .errors import SceneError
from .target import find_target

Color = tuple[float, float, float]


class MaterialEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[ripple.material]`: the wave equation's coefficients, see `Material`.

    Units: speed [m/s], damping [1/s], stiffness [1/s^2], viscosity [m^2/s], density [kg/m^2].
    """

    speed: float = 1.0
    damping: float = 0.0
    stiffness: float = 0.0
    viscosity: float = 0.0
    density: float = 1.0

    def material(self) -> Material:
        """The solver's material."""
        return Material(**msgspec.structs.asdict(self))


class RippleEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[[ripple]]`: one surface that carries waves, and how it looks."""

    geom: str
    resolution: int = 128
    look: str = "rubber"
    color: Color | None = None
    material: MaterialEntry = msgspec.field(default_factory=MaterialEntry)


class CameraEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[camera]`: a camera of the MJCF by name, or MuJoCo's free camera (metres, degrees), orbiting if wished."""

    name: str | None = None
    lookat: tuple[float, float, float] | None = None
    distance: float | None = None
    azimuth: float = 90.0
    elevation: float = -20.0
    fovy: float = 45.0
    orbit: float = 0.0


class SceneFile(msgspec.Struct, forbid_unknown_fields=True):
    """The whole TOML file."""

    model: str
    ripple: list[RippleEntry]
    duration: float = 5.0
    camera: CameraEntry = msgspec.field(default_factory=CameraEntry)
    drop: list[DropEntry] = []


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
    drops : tuple of DropEntry
        Bodies that are let go at given times.
    """

    name: str
    model: mujoco.MjModel
    surfaces: tuple[RippleEntry, ...]
    camera: CameraEntry
    duration: float
    drops: tuple[DropEntry, ...] = ()


def shipped_scenes() -> list[str]:
    """Names of the scenes that come with ripple-sim."""
    folder = importlib.resources.files("ripple_sim.scenes")
    return sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))


def load_scene(name_or_path: str | Path) -> Scene:
    """Load a shipped scene by its name, or any scene by the path of its TOML file.

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
    scene = Scene(
        name=path.stem,
        model=load_model(path.parent / content.model),
        surfaces=tuple(content.ripple),
        camera=content.camera,
        duration=content.duration,
        drops=tuple(content.drop),
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


def parse_scene(table: dict[str, Any], origin: str) -> SceneFile:
    """Check a scene's table against the schema.

    Raises
    ------
    SceneError
        Naming the place, the value and what is valid.
    """
    _check_keys(table, SceneFile, "", origin)
    try:
        return msgspec.convert(table, SceneFile)
    except msgspec.ValidationError as error:
        raise SceneError(f"scene file {origin!r}: {str(error).replace('`$.', '`')}") from error


_TABLES: dict[str, type[msgspec.Struct]] = {
    "ripple": RippleEntry,
    "camera": CameraEntry,
    "material": MaterialEntry,
    "drop": DropEntry,
}


def _check_keys(table: Any, schema: type[msgspec.Struct], place: str, origin: str) -> None:
    """Refuse unknown keys before msgspec does, with the list of valid ones."""
    if not isinstance(table, dict):
        return
    fields = {field.name: field.type for field in msgspec.structs.fields(schema)}
    for key, value in table.items():
        if key not in fields:
            where = f" in [{place}]" if place else ""
            raise SceneError(f"scene file {origin!r}: unknown key {key!r}{where}; valid are {', '.join(fields)}")
        inner = _TABLES.get(key)
        if inner is not None:
            for item in value if isinstance(value, list) else [value]:
                _check_keys(item, inner, f"{place}.{key}" if place else key, origin)


def load_model(path: Path) -> mujoco.MjModel:
    """Compile an MJCF file.

    Raises
    ------
    SceneError
        If the file is missing or MuJoCo refuses it, with MuJoCo's reason.
    """
    if not path.is_file():
        raise SceneError(f"MJCF file {str(path)!r} does not exist")
    try:
        return mujoco.MjModel.from_xml_path(str(path))
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
    # the renderer is not needed for anything but the names of its looks
    from .render import LOOKS

    if not scene.surfaces:
        raise SceneError(f"scene {scene.name!r} has no [[ripple]] surface; name at least one geom")
    if not 0 < scene.duration < float("inf"):
        raise SceneError(f"duration is {scene.duration!r} s; valid is a positive number")
    seen = set()
    for entry in scene.surfaces:
        find_target(scene.model, entry.geom)
        if entry.geom in seen:
            raise SceneError(f"geom {entry.geom!r} has two [[ripple]] entries; valid is one")
        seen.add(entry.geom)
        if entry.look not in LOOKS:
            raise SceneError(f"look {entry.look!r} does not exist; valid are {', '.join(LOOKS)}")
        entry.material.material()
    Drops(scene.model, scene.drops)
    name = scene.camera.name
    if name is not None and mujoco.mj_name2id(scene.model, mujoco.mjtObj.mjOBJ_CAMERA, name) < 0:
        names = [scene.model.camera(i).name for i in range(scene.model.ncam)]
        raise SceneError(f"the model has no camera {name!r}; its cameras are {', '.join(names) or 'none'}")
