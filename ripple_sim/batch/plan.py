"""The TOML file of a batch: what varies, how often, and what is stored."""

from __future__ import annotations

import glob
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import trimesh

from ripple_sim.errors import SceneError
from ripple_sim.scene.scene_path import shipped_scenes
from ripple_sim.scene.toml_file import read_toml
from ripple_sim.solver.errors import shown

from .distributions import KINDS, Distribution
from .key_path import parse_key
from .store_entry import StoreEntry, check_store

MOST_SCENES = 10_000_000


class MeshesEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[meshes]`: scenes made round mesh files, as `ripple-sim drop` does."""

    files: list[str]
    """Paths of files or folders, or patterns such as `meshes/*.obj`, relative to the plan."""
    bodies: int | Distribution = 12
    """How many bodies drop."""
    up: str | None = None
    """Axis of the files that points up: y or z; by default z for STL, else y."""
    look: str = "rubber"
    """Of the targets."""
    repair: bool = False
    """Close the meshes' holes."""
    wrap: bool = False
    """Take a closed surface round each mesh."""


class PlanFile(msgspec.Struct, forbid_unknown_fields=True):
    """The whole TOML file. Its scenes take turns: number 0 is the first, number 1 the second, and so on."""

    count: int
    """How many scenes are made."""
    scenes: list[str] = []
    """Names of shipped scenes, or paths of scene files, relative to the plan."""
    meshes: MeshesEntry | None = None
    """Scenes made round meshes, see below."""
    seed: int = 0
    """All random values follow from it."""
    vary: dict[str, Any] = {}
    """Values for keys of the scene files, see below."""
    model: dict[str, Any] = {}
    """Values for attributes of the MJCF's elements, see below."""
    store: StoreEntry = msgspec.field(default_factory=StoreEntry)
    """What is kept, see below."""


class Plan(msgspec.Struct, frozen=True):
    """A plan that has been checked.

    Attributes
    ----------
    sources : tuple of str
        Names of scenes and paths of scene files, then paths of meshes.
    meshes : MeshesEntry or None
        How scenes are made round meshes.
    vary, model : dict
        Distributions by key.
    """

    count: int
    seed: int
    sources: tuple[str, ...]
    meshes: MeshesEntry | None
    vary: dict[str, Distribution]
    model: dict[str, Distribution]
    store: StoreEntry


def read_plan(path: Path) -> Plan:
    """Read the TOML file of a batch.

    Raises
    ------
    SceneError
        Naming the key, its value and what is valid.
    """
    if path.exists() and not path.is_file():
        raise SceneError(f"plan {str(path)!r} is not a regular file; give the path of a TOML file")
    table = read_toml(path, "plan")
    valid = [field.name for field in msgspec.structs.fields(PlanFile)]
    for key in table:
        if key not in valid:
            raise SceneError(f"plan {str(path)!r}: unknown key {key!r}; valid are {', '.join(valid)}")
    try:
        content = msgspec.convert(table, PlanFile)
    except msgspec.ValidationError as error:
        raise SceneError(f"plan {str(path)!r}: {str(error).replace('`$.', '`')}") from error
    _check_numbers(content)
    check_store(content.store)
    if content.meshes is not None and isinstance(content.meshes.bodies, Distribution):
        content.meshes.bodies.check("meshes.bodies")
    return Plan(
        count=content.count,
        seed=content.seed,
        sources=tuple(_sources(content, path.parent)),
        meshes=content.meshes,
        vary=dict(_distributions(content.vary, "")),
        model=dict(_distributions(content.model, "")),
        store=content.store,
    )


def _check_numbers(content: PlanFile) -> None:
    for key, value, least, most in (
        ("count", content.count, 1, MOST_SCENES),
        ("seed", content.seed, 0, 2**63),
        ("store.scenes_per_tar", content.store.scenes_per_tar, 1, MOST_SCENES),
    ):
        if not least <= value <= most:
            raise SceneError(f"plan: {key} is {value}; valid is a whole number from {least} to {most}")


def _sources(content: PlanFile, folder: Path) -> Iterator[str]:
    shipped = shipped_scenes()
    for name in content.scenes:
        path = (folder / name).resolve()
        if name not in shipped and not path.is_file():
            raise SceneError(
                f"plan: there is no scene {shown(name)}; shipped scenes are {', '.join(shipped)}, or give the path of "
                "a TOML file, relative to the plan"
            )
        yield name if name in shipped else str(path)
    for pattern in content.meshes.files if content.meshes else ():
        found = _meshes(folder / pattern)
        if not found:
            raise SceneError(
                f"plan: no mesh fits {pattern!r}; valid is a file, a folder or a pattern, relative to the plan"
            )
        yield from map(str, found)
    if not content.scenes and content.meshes is None:
        raise SceneError("plan: it names no scene; write scenes = ['duck'], or [meshes] with files = ['*.obj']")


def _meshes(pattern: Path) -> list[Path]:
    """Files that fit a pattern; of folders those that hold a mesh by their endings."""
    paths = [Path(name).resolve() for name in sorted(glob.glob(str(pattern)))]  # noqa: PTH207 - absolute ones too
    within = [file for path in paths if path.is_dir() for file in sorted(path.iterdir())]
    endings = trimesh.available_formats()
    return [path for path in paths if path.is_file()] + [file for file in within if file.suffix[1:].lower() in endings]


def _distributions(table: dict[str, Any], before: str) -> Iterator[tuple[str, Distribution]]:
    """Distributions by their keys, whether `camera.azimuth` is written with quotes or as tables."""
    for name, value in table.items():
        key = f"{before}.{name}" if before else name
        if isinstance(value, dict) and not set(value) & {*KINDS, "apply"}:
            yield from _distributions(value, key)
            continue
        try:
            given = msgspec.convert(value if isinstance(value, dict) else {"constant": value}, Distribution)
        except msgspec.ValidationError as error:
            raise SceneError(f"plan: {key}: {str(error).replace('`$.', '`')}") from error
        parse_key(key)
        given.check(key)
        yield key, given
