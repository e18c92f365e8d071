"""Reading a scene: one MJCF, and one TOML file that names its targets, the camera, the duration and the script."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import mujoco
import numpy as np

from ripple_sim.coupling.geoms import find_target, target_name
from ripple_sim.coupling.physics_messages import adopt_warnings
from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import PATH, checked

from .check_scene import check_scene
from .events import Events
from .model_files import check_files
from .motion import DropEntry, ThrowEntry
from .randomize import RandomEntry, randomize
from .scene import Scene
from .scene_file import RippleEntry, SceneFile, parse_scene
from .scene_path import scene_path
from .toml_file import read_toml

Moved = TypeVar("Moved", DropEntry, ThrowEntry)
Edit = Callable[[mujoco.MjSpec], None]
Change = Callable[[dict[str, Any]], None]


@checked(SceneError, name_or_path=PATH)
def load_scene(
    name_or_path: str | Path, edit: Edit | None = None, seed: int | None = None, change: Change | None = None
) -> Scene:
    """Load a shipped scene by its name, or any scene by the path of its TOML file.

    Parameters
    ----------
    name_or_path : str or path
    edit : callable, optional
        Called with the model's specification (`mujoco.MjSpec`) before it is compiled, to change it in place.
    seed : int, optional
        In place of the one of the file's `[random]`.
    change : callable, optional
        Called with the file's table, of dictionaries and lists, before it is checked, to change it in place.

    Raises
    ------
    SceneError
        If there is no such scene or file, the TOML has an unknown key or a wrong value, MuJoCo refuses the MJCF, or a
        geom or camera is not in it.
    """
    path = scene_path(name_or_path)
    content = _read(path, change)
    random = content.random if seed is None else _seeded(path, content.random, seed)
    model, shifts = load_model(path.parent / content.model, random, edit)
    scene = Scene(
        name=path.stem,
        model=model,
        targets=tuple(_target(model, entry.located(path.parent)) for entry in content.ripple),
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


def _seeded(path: Path, random: RandomEntry | None, seed: int) -> RandomEntry:
    """The scene's random variation with another seed."""
    if random is None:
        raise SceneError(
            f"scene file {str(path)!r} has no [random], so nothing follows the seed {seed}; leave the seed out, or "
            "write what is to vary under [random]"
        )
    return msgspec.structs.replace(random, seed=seed)


def _target(model: mujoco.MjModel, entry: RippleEntry) -> RippleEntry:
    """The entry with its geom called as everybody calls it."""
    return msgspec.structs.replace(entry, geom=target_name(model, find_target(model, entry.geom)))


def _read(path: Path, change: Change | None) -> SceneFile:
    table = read_toml(path, "scene file")
    if change is not None:
        change(table)
    return parse_scene(table, str(path))


def _shifted(entries: Sequence[Moved], shifts: dict[str, np.ndarray]) -> tuple[Moved, ...]:
    """The entries, with their positions shifted like their bodies."""
    return tuple(
        msgspec.structs.replace(entry, position=tuple(float(x) for x in np.add(entry.position, shifts[entry.body])))
        if entry.position is not None and entry.body in shifts
        else entry
        for entry in entries
    )


def load_model(
    path: Path, random: RandomEntry | None = None, edit: Edit | None = None
) -> tuple[mujoco.MjModel, dict[str, np.ndarray]]:
    """Compile an MJCF file; also return how far each of its bodies was shifted at random [m].

    Raises
    ------
    SceneError
        If the file is missing or MuJoCo refuses it, with MuJoCo's reason, or the randomisation is invalid.
    """
    if not path.is_file():
        problem = "is not a file" if path.exists() else "does not exist"
        raise SceneError(f"MJCF file {str(path)!r} {problem}; `model` names it, relative to the scene file")
    check_files(path)
    with refusal_of(repr(str(path))):
        spec = mujoco.MjSpec.from_file(str(path))
        keys = [(key.name, len(key.qpos)) for key in spec.keys]  # the compiler fills up what is missing
        shifts = {} if random is None else randomize(spec, random)
        if edit is not None:
            edit(spec)
        model = spec.compile()
    for number, (name, given) in enumerate(keys):
        if edit is None and given not in (0, model.nq):
            raise SceneError(
                f"keyframe {name or number!r} of {str(path)!r} has {given} positions (qpos); valid are {model.nq}, "
                "as the model has"
            )
    for key, numbers in enumerate(np.hstack([model.key_qpos, model.key_qvel])):
        if not np.isfinite(numbers).all():
            raise SceneError(
                f"keyframe {model.key(key).name or key!r} of {str(path)!r} holds NaN or inf; valid are finite numbers"
            )
    return model, shifts


@contextlib.contextmanager
def refusal_of(name: str) -> Iterator[None]:
    """Have what MuJoCo says of a model, by its name in messages, as ours: its refusal is a `SceneError`."""
    adopt_warnings()
    try:
        yield
    except ValueError as error:
        reason = " ".join(str(error).split())
        if "allocate memory" in reason:  # by default it takes as much as all bodies in one heap would need
            reason += '; name in the MJCF how much it may take, such as <size memory="4G"/>'
        raise SceneError(f"MuJoCo refuses {name}: {reason}") from error
