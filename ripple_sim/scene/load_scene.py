"""Reading a scene: one MJCF, and one TOML file that names its targets, the camera, the duration and the script.

Names and numbers are checked against the model before anything is simulated, and the files that an MJCF names are
looked at before MuJoCo opens them: it would wait for ever for one that is a FIFO.
"""

from __future__ import annotations

import contextlib
import stat
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar
from xml.parsers import expat

import msgspec
import mujoco
import numpy as np

from ripple_sim.coupling.geoms import find_target, named_collision_geoms, own_model, target_name
from ripple_sim.coupling.stepping import adopt_warnings
from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import PATH, checked
from ripple_sim.solver.files import open_image
from ripple_sim.solver.layouts.build import LAYOUTS

from .drop_model import RandomEntry, randomize
from .events import DropEntry, Events, Script, ThrowEntry
from .scene import MAX_DURATION, Scene, parse_request, read_toml, scene_path
from .scene_file import RippleEntry, SceneFile, check_camera, parse_scene


def check_scene(scene: Scene) -> None:
    """Check a scene's names and numbers against its model.

    Raises
    ------
    SceneError
    SolverError
        For an invalid material.
    """
    from ripple_sim.render import LIGHTING  # brings OpenGL, which reading a scene file can do without until here

    own_model(scene.model)
    if not scene.targets:
        raise SceneError(f"scene {scene.name!r} has no [[ripple]] entry; name at least one geom")
    if not 0 < scene.duration < MAX_DURATION:
        raise SceneError(f"duration is {scene.duration!r} s; valid is a positive number, less than {MAX_DURATION}")
    seen = set()
    for entry in scene.targets:
        if entry.geom in seen:
            raise SceneError(f"geom {entry.geom!r} has two [[ripple]] entries; valid is one")
        seen.add(entry.geom)
        _check_target(scene.model, entry)
    named_collision_geoms(scene.model, [entry.geom for entry in scene.targets], scene.contacts)
    parse_request(scene.overlay)
    if scene.lighting not in LIGHTING:
        raise SceneError(f"lighting is {scene.lighting!r}; valid are {', '.join(map(repr, LIGHTING))}")
    Script(scene.model, scene.events, [entry.geom for entry in scene.targets])
    check_camera(scene.model, scene.camera)


def _check_target(model: mujoco.MjModel, entry: RippleEntry) -> None:
    from ripple_sim.render import LOOKS
    from ripple_sim.solver.operator.assembly import RIMS

    find_target(model, entry.geom)
    for what, name, valid in (("look", entry.look, LOOKS), ("layout", entry.layout, LAYOUTS), ("rim", entry.rim, RIMS)):
        if name not in valid:
            raise SceneError(f"{what} {name!r} does not exist; valid are {', '.join(valid)}")
    if entry.color is not None and not all(0 <= part <= 1 for part in entry.color):
        raise SceneError(f"color of geom {entry.geom!r} is {entry.color}; valid are three numbers from 0 to 1 (sRGB)")
    entry.material.material(np.ones((1, 1, 1)) if entry.inside else None)
    for body in entry.inside:
        body.check()
    if entry.height is not None:
        entry.height.check()
    least, greatest = entry.thickness_limits
    if not 0 <= least <= greatest:
        raise SceneError(
            f"thickness_limits of geom {entry.geom!r} are {entry.thickness_limits} m; valid are two numbers from 0 on, "
            "the least first"
        )
    for coefficient, each in entry.material.maps().items():
        _check_image(
            f"ripple.material.{coefficient}", each.map, "a number, or the path of an image relative to the scene file"
        )
    if entry.still_map is not None:
        _check_image("ripple.still_map", entry.still_map, "the path of an image relative to the scene file")
    for disc in entry.still:
        if not 0 < disc.radius < float("inf"):
            raise SceneError(
                f"a [[ripple.still]] disc of geom {entry.geom!r} has radius {disc.radius!r} m; valid is above 0"
            )


def _check_image(key: str, path: str, valid: str) -> None:
    if not Path(path).is_file():
        raise SceneError(f"{key} names the image {path!r}, which does not exist; valid is {valid}")


# Attributes of <compiler> that name folders, and those that name files.
_FOLDERS = ("meshdir", "texturedir", "assetdir")
_FILES = ("file", "filename", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")

_BAD_CHARACTER = expat.errors.codes[expat.errors.XML_ERROR_BAD_CHAR_REF]

# Elements whose PNG files MuJoCo reads whole, however large.
_IMAGES = ("texture", "hfield")


def check_files(path: Path) -> None:
    """Make sure that an MJCF and all that it includes or names are regular files, as far as they exist.

    Its images must not be larger than pillow allows.

    Raises
    ------
    SceneError
        Naming the file.
    """
    waiting, seen = [path], set()
    folders = {path.parent}
    while waiting:
        xml = waiting.pop()
        if xml in seen:
            continue
        seen.add(xml)
        try:
            root = ElementTree.parse(xml).getroot()
        except ElementTree.ParseError as error:
            if error.code == _BAD_CHARACTER:
                line, column = error.position
                raise SceneError(
                    f"the model {str(xml)!r} refers to an unknown character, at line {line}, column {column}: "
                    "MuJoCo would cut the text there; valid are names without a NUL"
                ) from error
            continue  # MuJoCo says what is wrong
        except (OSError, ValueError, LookupError, RecursionError):
            continue  # likewise
        folders |= {path.parent / each.get(name, "") for each in root.iter("compiler") for name in _FOLDERS}
        for element in root.iter():
            for name in filter(None, map(element.get, _FILES)):
                found = [place for folder in {*folders, xml.parent} if _exists(place := folder / name)]
                if element.tag == "include":
                    waiting += found
                elif element.tag in _IMAGES:
                    for place in found:
                        if place.suffix.lower() == ".png":
                            open_image(SceneError, place, element.tag).close()


def _exists(path: Path) -> bool:
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return False
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise SceneError(
            f"the model names {str(path)!r}, which is not a regular file; a FIFO or a device cannot be read"
        )
    return stat.S_ISREG(mode)


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
