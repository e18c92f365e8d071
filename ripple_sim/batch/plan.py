"""The TOML file of a batch: varied values, their distributions, and the stored outputs.

Keys of a plan are such as `camera.azimuth`, `ripple[duck].material.speed`, `geom[ball*].size[0]`.
"""

from __future__ import annotations

import dataclasses
import glob
import importlib.util
import math
import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
import trimesh

from ripple_sim.errors import SceneError
from ripple_sim.scene.scene_file import check_keys, converted
from ripple_sim.scene.source import read_toml, shipped_scenes
from ripple_sim.solver.errors import shown
from ripple_sim.video.options import VideoOptions
from ripple_sim.video.settings import check_options

Numbers = float | list[float]

# The kinds of distributions. A distribution has exactly one of them.
KINDS = ("uniform", "log_uniform", "normal", "integers", "choice", "orientation", "constant")

# Normal numbers are drawn at most so many times until they lie within their limits.
_MAX_DRAWS = 10_000

# One step of a key: a name, perhaps with something in brackets behind it.
_STEP_PATTERN = r"([A-Za-z_][A-Za-z_0-9]*)(?:\[([^\]]+)\])?"

# largest `count` of a plan
MOST_SCENES = 10_000_000


class Distribution(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """A distribution, of exactly one kind.

    The kinds are `uniform`, `log_uniform`, `normal`, `integers`, `choice`, `orientation` and
    `constant`.
    """

    uniform: tuple[Numbers, Numbers] | None = None
    """Lowest and highest number, or vectors of these."""
    log_uniform: tuple[Numbers, Numbers] | None = None
    """Likewise, above 0; as many between 1 and 2 as between 2 and 4."""
    normal: tuple[float, float] | None = None
    """Mean and standard deviation."""
    integers: tuple[int, int] | None = None
    """Lowest and highest whole number, both included."""
    choice: list[Any] | None = None
    """Values of any kind."""
    orientation: bool = False
    """A turn, all equally likely, as a unit quaternion w, x, y, z."""
    constant: Any = None
    """Always this value."""
    weights: list[float] | None = None
    """How likely each of the choices is, in any unit; by default all are equally likely."""
    limits: tuple[float, float] | None = None
    """Of a normal one: it is drawn again until it lies between them."""
    length: int | None = None
    """How many numbers are drawn, independently, for a vector."""
    apply: Literal["set", "add", "multiply"] = "set"
    """How the drawn value changes the value in the scene: replace it, add to it, or multiply it."""
    together: bool = False
    """Whether a key that fits several places gives them all the same value."""

    def draw(self, rng: np.random.Generator) -> Any:
        """Draw a value: a float, an int, a list of these, or any of the choices.

        Floats are rounded to 12 digits, so that no processor's last bit counts.
        """
        if self.choice is not None:
            share = (
                None if self.weights is None else np.divide(self.weights, math.fsum(self.weights))
            )
            return self.choice[int(rng.choice(len(self.choice), p=share))]
        if self.constant is not None:
            return self.constant
        if self.orientation:
            turn = rng.standard_normal(4)
            return _plain(turn / math.sqrt(math.fsum(turn**2)))
        if self.integers is not None:
            whole = rng.integers(
                self.integers[0], self.integers[1], size=self.length, endpoint=True
            )
            return whole.tolist() if self.length else int(whole)
        if self.uniform is not None:
            return _plain(rng.uniform(*self.uniform, size=self.length))
        if self.log_uniform is not None:
            low, high = (np.log(np.array(end)) for end in self.log_uniform)
            return _plain(np.exp(rng.uniform(low, high, size=self.length)))
        mean, deviation = self.normal or (0.0, 0.0)
        least, greatest = self.limits or (-math.inf, math.inf)
        number = rng.normal(mean, deviation, size=self.length)
        for _ in range(_MAX_DRAWS):
            outside = (number < least) | (number > greatest)
            if not np.any(outside):
                return _plain(number)
            number = np.where(outside, rng.normal(mean, deviation, size=self.length), number)
        raise SceneError(
            f"normal {self.normal} hardly ever lies within the limits {self.limits}; widen them"
        )

    def check(self, key: str) -> None:
        """Check that there is one kind, and that its numbers are valid.

        Raises `SceneError` with the key.
        """
        given = [kind for kind in KINDS if getattr(self, kind) not in (None, False)]
        if len(given) != 1:
            raise SceneError(
                f"plan: {key} must be drawn from one of {', '.join(KINDS)}, got "
                f"{' and '.join(given) or 'nothing'}"
            )
        kind = given[0]
        for other, extra, fitting in (
            ("weights", self.weights, "choice"),
            ("limits", self.limits, "normal"),
        ):
            if extra is not None and kind != fitting:
                raise SceneError(f"plan: {key} has {other}, which {kind} does not take")
        if self.length is not None and (self.length < 1 or kind not in KINDS[:4]):
            raise SceneError(
                f"plan: the length of {key} must be 1 or more, and its values numbers, got "
                f"length {self.length}"
            )
        problem = self._problem()
        if problem:
            raise SceneError(
                f"plan: {key} is drawn from {kind} = {shown(getattr(self, kind))}; {problem}"
            )

    def _problem(self) -> str | None:
        """The rule that the numbers break, in words; None if they break none."""
        pair = self.uniform or self.log_uniform or self.integers or self.limits
        if pair is not None:
            low = np.array(pair[0], float)
            high = np.array(pair[1], float)
            if low.shape not in ((), high.shape) and high.shape != ():
                return "it must be two numbers, or two vectors of the same length"
            if not (np.isfinite(low).all() and np.isfinite(high).all() and np.all(low <= high)):
                return "it must be two finite numbers, the lower one first"
            if self.log_uniform and np.any(low <= 0):
                return "its numbers must be above 0"
            if self.length is not None and max(low.size, high.size) > 1:
                return "vectors have their own length; leave `length` out"
        if self.normal is not None and not (np.isfinite(self.normal).all() and self.normal[1] >= 0):
            return "it must be a mean and a standard deviation of 0 or more"
        if self.choice is not None:
            if not self.choice:
                return "it must have at least one value"
            weights = self.weights
            if weights is not None and not (
                len(weights) == len(self.choice)
                and min(weights) >= 0
                and 0 < sum(weights) < math.inf
            ):
                return f"it must have {len(self.choice)} weights, none below 0"
        return None


def _plain(value: Any) -> Any:
    """Numbers of numpy as Python's, with 12 digits."""
    if np.ndim(value):
        return [float(f"{number:.12g}") for number in value]
    return float(f"{value:.12g}")


# A part of a key: a name, and what stands in brackets behind it: a number, a name, or a pattern
# with *; "" without.
Step = tuple[str, str]


def parse_key(key: str) -> tuple[Step, ...]:
    """Read a key of a plan; raises `SceneError` if it is not names between dots."""
    if not re.fullmatch(rf"{_STEP_PATTERN}(?:\.{_STEP_PATTERN})*", key):
        raise SceneError(
            "plan: a key must be names between dots, with a number, a name or a pattern in "
            "brackets, such as camera.azimuth, ripple[duck].material.speed or geom[ball*].size, "
            f"got {key!r}"
        )
    return tuple(re.findall(_STEP_PATTERN, key))


def choose(names: Sequence[str], step: Step, where: str) -> list[int]:
    """Indices of the items that a step of a key selects by their names; without brackets all.

    Raises `SceneError` if there is none.
    """
    kind, chosen = step
    if not chosen:
        found = list(range(len(names)))
    elif chosen.isdecimal() and chosen not in names:
        found = [int(chosen)] if int(chosen) < len(names) else []
    else:
        found = [number for number, name in enumerate(names) if fnmatchcase(name, chosen)]
    if not found:
        listed = (
            ", ".join(name or f"number {number}" for number, name in enumerate(names)) or "none"
        )
        raise SceneError(f"plan: {where} has no {kind}[{chosen or '*'}]; there is {listed}")
    return found


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
    """How many scenes a tar file holds."""


def video_name(store: StoreEntry) -> str | None:
    """Name of a scene's video or folder of frames, or None if nothing is drawn."""
    return {"none": None, "png": "frames", "exr": "frames"}.get(store.video, f"video.{store.video}")


def options_of(store: StoreEntry) -> VideoOptions:
    """How the scenes of a batch are rendered."""
    shared = {field.name for field in dataclasses.fields(VideoOptions)} & set(
        StoreEntry.__struct_fields__
    )
    options = VideoOptions(**{name: getattr(store, name) for name in shared})
    return dataclasses.replace(options, frame_format="exr" if store.video == "exr" else "png")


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
    """The whole TOML file.

    Its scenes take turns: number 0 is the first, number 1 the second, and so on.
    """

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
    what = f"plan {str(path)!r}"
    check_keys(table, PlanFile, what)
    content = converted(table, PlanFile, what)
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
    """Make sure that scenes can be made and kept by a plan, before one is made.

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
    for key, given in (*plan.vary.items(), *plan.model.items()):
        parse_key(key)
        given.check(key)


def _sources(content: PlanFile, folder: Path) -> Iterator[str]:
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
        # files that fit; of folders those that hold a mesh by their endings
        fitting = sorted(glob.glob(str(folder / pattern)))  # noqa: PTH207 - absolute ones too
        paths = [Path(name).resolve() for name in fitting]
        within = [file for path in paths if path.is_dir() for file in sorted(path.iterdir())]
        found = [path for path in paths if path.is_file()]
        found += [file for file in within if file.suffix[1:].lower() in trimesh.available_formats()]
        if not found:
            raise SceneError(
                f"plan: no mesh fits {pattern!r}: give a file, a folder or a pattern, relative "
                "to the plan"
            )
        yield from map(str, found)


def _distributions(table: dict[str, Any], before: str) -> Iterator[tuple[str, Distribution]]:
    """Distributions by their keys, whether `camera.azimuth` is written with quotes or as tables."""
    for name, value in table.items():
        key = f"{before}.{name}" if before else name
        if isinstance(value, dict) and not set(value) & {*KINDS, "apply"}:
            yield from _distributions(value, key)
            continue
        yield (
            key,
            converted(
                value if isinstance(value, dict) else {"constant": value},
                Distribution,
                f"plan: {key}",
            ),
        )
