"""The TOML file of a batch: which scenes, what varies, and what is stored."""

from __future__ import annotations

import dataclasses
import glob
import importlib.util
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import msgspec
import trimesh

from ripple_sim.errors import SceneError
from ripple_sim.scene.scene_file import check_keys, converted
from ripple_sim.scene.source import read_toml, shipped_scenes
from ripple_sim.solver.errors import shown
from ripple_sim.video.options import VideoOptions
from ripple_sim.video.settings import check_options

from .distribution import KINDS, Distribution
from .keys import parse_key

# Largest `count` of a plan.
MOST_SCENES = 10_000_000


class StoreEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[store]`: the outputs of each scene."""

    video: Literal["mp4", "webm", "gif", "webp", "png", "exr", "none"] = "mp4"
    """`mp4`, `webm`, `gif`, `webp`; `png` or `exr`: a folder of frames; `none`: nothing is
    drawn."""
    size: tuple[int, int] = (256, 256)
    """Of the frames [pixels]."""
    fps: int = 24
    """Frames per second."""
    duration: float | None = None
    """Length of each scene [s]; by default the scene's."""
    supersample: int = 1
    """Frames are drawn this many times as wide and high, and averaged."""
    resolution: int | None = None
    """Texels along the edge of a chart; by default the scene's."""
    backend: Literal["cpu", "gl", "auto"] = "cpu"
    """Where waves are computed. The same numbers on every machine come from `cpu` alone."""
    overlay: list[str] | None = None
    """Drawn on the video; by default the scene's."""
    passes: list[str] = []
    """Passes of every frame: depth, normal, segmentation, flow, position, height."""
    pass_format: Literal["npz", "exr"] = "npz"
    """Format of the passes."""
    impulses: bool = True
    """`impulses.csv`: every contact's impulse and place, step by step."""
    heights: bool = False
    """`heights.zarr.zip`: the height of each target at every frame."""
    positions: bool = True
    """`qpos.npy`: MuJoCo's generalised positions at every frame, float64 [frames, nq]."""
    format: Literal["folders", "webdataset"] = "folders"
    """A folder a scene, or tar files of many scenes each."""
    scenes_per_tar: int = 100
    """Number of scenes in a tar file."""


def video_name(store: StoreEntry) -> str | None:
    """Name of a scene's video or folder of frames, or None if nothing is drawn."""
    return {"none": None, "png": "frames", "exr": "frames"}.get(store.video, f"video.{store.video}")


def options_of(store: StoreEntry) -> VideoOptions:
    """How the scenes of a batch are rendered."""
    option_names = {field.name for field in dataclasses.fields(VideoOptions)}
    shared_names = option_names & set(StoreEntry.__struct_fields__)
    options = VideoOptions(**{name: getattr(store, name) for name in shared_names})
    return dataclasses.replace(options, frame_format="exr" if store.video == "exr" else "png")


class MeshesEntry(msgspec.Struct, forbid_unknown_fields=True):
    """`[meshes]`: scenes made round mesh files, as `ripple-sim drop` does."""

    files: list[str]
    """Paths of files or folders, or patterns such as `meshes/*.obj`, relative to the plan."""
    bodies: int | Distribution = 12
    """Number of bodies that drop."""
    up: str | None = None
    """Axis of the files that points up: y or z; by default z for STL, else y."""
    look: str = "rubber"
    """Look of the targets."""
    repair: bool = False
    """Close the meshes' holes."""
    wrap: bool = False
    """Take a closed surface round each mesh."""


class PlanFile(msgspec.Struct, forbid_unknown_fields=True):
    """The whole TOML file.

    Its scenes take turns: number 0 is the first, number 1 the second, and so on.
    """

    count: int
    """Number of scenes."""
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
    """The outputs of each scene, see below."""


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


def read_plan(path: str | Path) -> Plan:
    """Read the TOML file of a batch.

    Raises
    ------
    SceneError
        With the key, its value and the expected values.
    """
    path = Path(path)
    if path.exists() and not path.is_file():
        raise SceneError(f"plan {str(path)!r} is not a regular file; give the path of a TOML file")
    table = read_toml(path, "plan")
    title = f"plan {str(path)!r}"
    check_keys(table, PlanFile, title)
    content = converted(table, PlanFile, title)
    plan = Plan(
        count=content.count,
        seed=content.seed,
        sources=tuple(_sources(content, path.parent)),
        meshes=content.meshes,
        vary=dict(_distributions(content.vary, "")),
        model=dict(_distributions(content.model, "")),
        store=content.store,
    )
    check_plan(plan)
    return plan


def check_plan(plan: Plan) -> None:
    """Check before the first scene that a plan can make and store its scenes.

    Raises `RippleError` with the key, its value and the expected values, or a missing package.
    """
    store = plan.store
    for name, value, least, most in (
        ("count", plan.count, 1, MOST_SCENES),
        ("seed", plan.seed, 0, 2**63),
        ("store.scenes_per_tar", store.scenes_per_tar, 1, MOST_SCENES),
    ):
        if not least <= value <= most:
            raise SceneError(
                f"plan: {name} must be a whole number from {least} to {most}, got {value}"
            )
    if not plan.sources:
        raise SceneError(
            "plan: it names no scene; write scenes = ['duck'], or [meshes] with files = ['*.obj']"
        )
    if store.passes and store.video == "none":
        raise SceneError(
            "plan: store.passes need frames, and store.video is 'none'; name a video, or leave "
            "passes out"
        )
    if store.heights and importlib.util.find_spec("zarr") is None:
        raise SceneError(
            "plan: store.heights needs the package zarr; install it with: pip install "
            "'ripple-sim[zarr]'"
        )
    with tempfile.TemporaryDirectory(prefix="ripple-sim-plan-") as folder:
        check_options(options_of(store), Path(folder) / (video_name(store) or "frames"))
    if plan.meshes is not None and isinstance(plan.meshes.bodies, Distribution):
        plan.meshes.bodies.check("meshes.bodies")
    for key, distribution in (*plan.vary.items(), *plan.model.items()):
        parse_key(key)
        distribution.check(key)


def _sources(content: PlanFile, folder: Path) -> Iterator[str]:
    """The sources of a plan: names of scenes, paths of scene files, and paths of meshes."""
    shipped = shipped_scenes()
    for name in content.scenes:
        path = folder / name
        # os.path.isfile returns False for a string that cannot be a path; Path.is_file raises
        if name not in shipped and not os.path.isfile(path):  # noqa: PTH113
            raise SceneError(
                f"plan: there is no scene {shown(name)}; shipped scenes are {', '.join(shipped)}, "
                "or give the path of a TOML file, relative to the plan"
            )
        yield name if name in shipped else str(path.resolve())
    for pattern in content.meshes.files if content.meshes else ():
        meshes = _meshes(folder, pattern)
        if not meshes:
            raise SceneError(
                f"plan: no mesh fits {pattern!r}: give a file, a folder or a pattern, relative "
                "to the plan"
            )
        yield from map(str, meshes)


def _meshes(folder: Path, pattern: str) -> list[Path]:
    """Files that fit a pattern, and the mesh files in folders that fit it."""
    names = sorted(glob.glob(str(folder / pattern)))  # noqa: PTH207 - absolute ones too
    paths = [Path(name).resolve() for name in names]
    meshes = [path for path in paths if path.is_file()]
    for subfolder in filter(Path.is_dir, paths):
        for file in sorted(subfolder.iterdir()):
            if file.suffix[1:].lower() in trimesh.available_formats():
                meshes.append(file)
    return meshes


def _distributions(table: dict[str, Any], prefix: str) -> Iterator[tuple[str, Distribution]]:
    """Distributions by their keys, whether `camera.azimuth` is written with quotes or as tables."""
    for name, value in table.items():
        key = f"{prefix}.{name}" if prefix else name
        is_table = isinstance(value, dict)
        if is_table and not set(value) & {*KINDS, "apply"}:
            yield from _distributions(value, key)
            continue
        fields = value if is_table else {"constant": value}
        yield key, converted(fields, Distribution, f"plan: {key}")
