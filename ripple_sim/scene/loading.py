"""Reading a scene: an MJCF, and a TOML file with everything else.

Names and numbers are checked against the model before anything is simulated. The files that an MJCF
names are examined before MuJoCo opens them: it would wait for a FIFO for ever.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import stat
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.parsers import expat

import msgspec
import mujoco
import numpy as np

from ripple_sim.coupling.collision_geoms import named_collision_geoms
from ripple_sim.coupling.geoms import find_target, target_name
from ripple_sim.coupling.hooks import adopt_warnings
from ripple_sim.coupling.own_model import own_model
from ripple_sim.coupling.rippling import site_on
from ripple_sim.coupling.suited import typical_hit
from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import FUNCTION, PATH, checked, warn_caller
from ripple_sim.solver.images import open_image
from ripple_sim.solver.layouts.build import LAYOUTS

from .bodies import RandomEntry, randomize
from .camera_entry import check_camera
from .events import DropEntry, Events, Script, ThrowEntry
from .material_entry import PresetEntry, given_fields
from .overlays import parse_request
from .paint import paint_from_files
from .scene import Scene, check_duration
from .scene_file import RippleEntry, SceneFile, parse_scene
from .source import read_toml, scene_path
from .target_maps import check_rim

# Attributes of <compiler> that name folders.
_FOLDERS = ("meshdir", "texturedir", "assetdir")

# Attributes of any element that name files.
_FILES = (
    "file",
    "filename",
    "fileright",
    "fileleft",
    "fileup",
    "filedown",
    "filefront",
    "fileback",
)

# expat's error of a reference to a character that does not exist.
_BAD_CHARACTER = expat.errors.codes[expat.errors.XML_ERROR_BAD_CHAR_REF]

# Elements whose PNG files MuJoCo reads whole, however large.
_IMAGE_ELEMENTS = ("texture", "hfield")

# MuJoCo sets up a flexcomp of so many bodies, one for each point of its grid, in this time [s]. The
# time grows with about this power of the number, since MuJoCo lists all bodies again for each.
_MEASURED_BODIES = 15_000
_MEASURED_SECONDS = 30.0
_GROWTH_POWER = 2.6

# Longest time that MuJoCo may take without a warning [s].
_MAX_SILENCE = 10.0

# Changes a model's specification in place, before it is compiled.
Edit = Callable[[mujoco.MjSpec], None]

# Changes a scene file's table in place, before it is checked.
Change = Callable[[dict[str, Any]], None]


def check_scene(scene: Scene) -> None:
    """Check a scene's names and numbers against its model.

    Raises
    ------
    SceneError
    SolverError
        For an invalid material.
    """
    # this import brings OpenGL, which reading a scene file does not need before
    from ripple_sim.render import LIGHTING

    own_model(scene.model)
    if not scene.targets:
        raise SceneError(f"scene {scene.name!r} has no [[ripple]] entry; name at least one geom")
    check_duration(scene.duration)
    geoms = set()
    for entry in scene.targets:
        if entry.geom in geoms:
            raise SceneError(f"geom {entry.geom!r} must have one [[ripple]] entry, got two")
        geoms.add(entry.geom)
        _check_target(scene.model, entry)
    named_collision_geoms(scene.model, [entry.geom for entry in scene.targets], scene.contacts)
    _check_sensors(scene)
    if scene.lighting not in LIGHTING:
        raise SceneError(
            f"lighting must be one of {', '.join(map(repr, LIGHTING))}, got {scene.lighting!r}"
        )
    Script(scene.model, scene.events, [entry.geom for entry in scene.targets])
    _warn_of_late_events(scene)
    check_camera(scene.model, scene.camera)


def _warn_of_late_events(scene: Scene) -> None:
    """Warn of events after the scene's end, once for each kind of event."""
    for field in dataclasses.fields(scene.events):
        times = [event.time for event in getattr(scene.events, field.name)]
        late = [time for time in times if time >= scene.duration]
        if late:
            warn_caller(
                f"a [[{field.name}]] at {late[0]:g} s is not before the scene's end, "
                f"{scene.duration:g} s; give the scene a longer duration, or the event an earlier "
                "time"
            )


def _check_sensors(scene: Scene) -> None:
    """Refuse sensors that share a name, that are on no target, or that have no place or several."""
    targets = [entry.geom for entry in scene.targets]
    names = set()
    for entry in scene.sensors:
        if entry.name in names:
            raise SceneError(
                f"the names of sensors must differ, got two sensors called {entry.name!r}"
            )
        names.add(entry.name)
        if entry.geom not in targets:
            valid = ", ".join(map(repr, targets))
            raise SceneError(
                f"sensor {entry.name!r} is on {entry.geom!r}, which does not ripple; targets "
                f"are {valid}"
            )
        places = [entry.site is not None, entry.point is not None, len(entry.points) > 0]
        if places.count(True) != 1:
            raise SceneError(f"sensor {entry.name!r} needs one of site, point and points")
        if entry.site is not None:
            site_on(scene.model, find_target(scene.model, entry.geom), entry.site)
    if parse_request(scene.overlay).sensors and not scene.sensors:
        raise SceneError(
            "the overlay sensors shows those of the scene, which has no [[sensor]]; add one"
        )


def _check_target(model: mujoco.MjModel, entry: RippleEntry) -> None:
    """Refuse a target with an invalid name, number or file."""
    from ripple_sim.render import LOOKS

    find_target(model, entry.geom)
    for key, name, valid in (("look", entry.look, LOOKS), ("layout", entry.layout, LAYOUTS)):
        if name not in valid:
            raise SceneError(f"{key} must be one of {', '.join(valid)}, got {name!r}")
    check_rim(entry.rim)
    if entry.color is not None and not all(0 <= channel <= 1 for channel in entry.color):
        raise SceneError(
            f"color of geom {entry.geom!r} must be three numbers from 0 to 1 (sRGB), got "
            f"{entry.color}"
        )
    thickness = np.ones((1, 1, 1)) if entry.inside else None  # any, for the check
    entry.material.material(thickness)
    for body in entry.inside:
        body.check()
    if entry.height is not None:
        entry.height.check()
    _check_layer_and_maps(entry)


def _check_layer_and_maps(entry: RippleEntry) -> None:
    """Refuse invalid limits of the thickness, missing images, and discs without a radius."""
    least, greatest = entry.thickness_limits
    if not 0 <= least <= greatest:
        raise SceneError(
            f"thickness_limits of geom {entry.geom!r} must be two numbers from 0 on, the least "
            f"first, got {entry.thickness_limits} m"
        )
    for coefficient, texture in entry.material.maps().items():
        _check_image(
            f"ripple.material.{coefficient}",
            texture.map,
            "a number, or the path of an image relative to the scene file",
        )
    if entry.still_map is not None:
        _check_image(
            "ripple.still_map", entry.still_map, "the path of an image relative to the scene file"
        )
    for disc in entry.still:
        if not 0 < disc.radius < float("inf"):
            raise SceneError(
                f"the radius of a [[ripple.still]] disc of geom {entry.geom!r} must be above 0, "
                f"got {disc.radius!r} m"
            )


def _check_image(key: str, path: str, valid: str) -> None:
    """Refuse an image that does not exist; `valid` describes the values of the key."""
    if not Path(path).is_file():
        raise SceneError(
            f"{key} names the image {path!r}, which does not exist: it must be {valid}"
        )


def check_files(path: Path) -> None:
    """Make sure that an MJCF and all files that it names are regular files, as far as they exist.

    Images must not be larger than Pillow allows. A warning names a flex that takes MuJoCo long to
    set up. Raises `SceneError` naming the file.
    """
    unread = [path]
    read = set()
    folders = {path.parent}
    while unread:
        xml = unread.pop()
        if xml in read:
            continue
        read.add(xml)
        root = _root_of(xml)
        if root is None:
            continue
        for compiler in root.iter("compiler"):
            folders |= {path.parent / compiler.get(name, "") for name in _FOLDERS}
        for element in root.iter():
            if element.tag == "flexcomp":
                _warn_of_many_bodies(element)
            for file in _files_of(element, {*folders, xml.parent}):
                if element.tag == "include":
                    unread.append(file)
                elif element.tag in _IMAGE_ELEMENTS and file.name.lower().endswith(".png"):
                    open_image(SceneError, file, element.tag).close()


def _root_of(xml: Path) -> ElementTree.Element | None:
    """Root element of an XML file; None if it cannot be read, since MuJoCo reports the fault.

    Raises `SceneError` if the file refers to a NUL, at which MuJoCo would cut the text.
    """
    try:
        return ElementTree.parse(xml).getroot()
    except ElementTree.ParseError as error:
        if error.code == _BAD_CHARACTER:
            line, column = error.position
            raise SceneError(
                f"the model {str(xml)!r} refers to an unknown character, at line {line}, column "
                f"{column}: MuJoCo would cut the text there; names must be without a NUL"
            ) from error
        return None
    except (OSError, ValueError, LookupError, RecursionError):
        return None


def _files_of(element: ElementTree.Element, folders: set[Path]) -> list[Path]:
    """Existing files that an element names, in any of the folders."""
    files = []
    for attribute in _FILES:
        name = element.get(attribute)
        if name:
            paths = [folder / name for folder in folders]
            files += [path for path in paths if _exists(path)]
    return files


def _warn_of_many_bodies(flex: ElementTree.Element) -> None:
    """Warn of a flexcomp's grid of bodies that MuJoCo takes long to set up."""
    if (
        flex.get("type", "grid") != "grid"
        or flex.get("rigid") == "true"
        or flex.get("dof", "full") != "full"
    ):
        return
    try:
        bodies = math.prod(int(count) for count in flex.get("count", "").split())
    except ValueError:
        return  # MuJoCo reports the fault
    seconds = _MEASURED_SECONDS * (bodies / _MEASURED_BODIES) ** _GROWTH_POWER
    if seconds > _MAX_SILENCE:
        warn_caller(
            f"flexcomp {flex.get('name', '')!r} has {bodies} points, each a body of its own, which "
            f'MuJoCo takes about {seconds:.0f} s to set up; dof="trilinear", or a count of at most '
            "20 20 20, takes seconds"
        )


def _exists(path: Path) -> bool:
    """Whether a regular file exists; raises `SceneError` for a FIFO or a device."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return False
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise SceneError(
            f"the model names {str(path)!r}, which is not a regular file; a FIFO or a device "
            "cannot be read"
        )
    return stat.S_ISREG(mode)


@checked(SceneError, name_or_path=PATH, edit=FUNCTION, change=FUNCTION)
def load_scene(
    name_or_path: str | Path,
    edit: Edit | None = None,
    seed: int | None = None,
    change: Change | None = None,
) -> Scene:
    """Load a shipped scene by its name, or any scene by the path of its TOML file.

    Parameters
    ----------
    name_or_path : str or path
    edit : callable, optional
        Called with the model's specification (`mujoco.MjSpec`) before it is compiled, to change it
        in place.
    seed : int, optional
        Seed in place of the one in the file's `[random]`.
    change : callable, optional
        Called with the file's table, of dictionaries and lists, before it is checked, to change it
        in place.

    Raises
    ------
    SceneError
        If there is no such scene or file, the TOML has an unknown key or a wrong value, MuJoCo
        refuses the MJCF, or a geom or camera is not in it.
    """
    from ripple_sim.render.visuals import MODEL_LOOK

    path = scene_path(name_or_path)
    table = read_toml(path, "scene file")
    if change is not None:
        change(table)
    content = parse_scene(table, str(path))
    random = content.random
    if seed is not None:
        if random is None:
            raise SceneError(
                f"scene file {str(path)!r} has no [random], so nothing follows the seed {seed}; "
                "leave the seed out, or write what is to vary under [random]"
            )
        random = msgspec.structs.replace(random, seed=seed)
    painted_geoms = [entry.geom for entry in content.ripple if entry.look == MODEL_LOOK]
    model, shifts = load_model(path.parent / content.model, random, edit, painted_geoms)
    targets = []
    for entry in content.ripple:
        # a geom may be named in several ways
        name = target_name(model, find_target(model, entry.geom))
        targets.append(msgspec.structs.replace(entry.located(path.parent), geom=name))
    content.ripple = targets
    moves: list[DropEntry | ThrowEntry] = [*content.drop, *content.throw]
    for event in moves:
        if event.position is not None and event.body in shifts:
            event.position = tuple(np.add(event.position, shifts[event.body]).tolist())
    return scene_of(path.stem, model, content)


def scene_of(
    name: str, model: mujoco.MjModel, content: SceneFile, notes: tuple[str, ...] = ()
) -> Scene:
    """The scene that the content of a scene file makes of a model, checked.

    Raises what `check_scene` raises.
    """
    events_by_kind = {
        field.name: tuple(getattr(content, field.name)) for field in dataclasses.fields(Events)
    }
    scene = Scene(
        name=name,
        model=model,
        targets=tuple(_with_typical_hit(model, entry, content) for entry in content.ripple),
        camera=content.camera,
        duration=content.duration,
        events=Events(**events_by_kind),
        two_way=content.two_way,
        overlay=tuple(content.overlay),
        lighting=content.lighting,
        notes=notes,
        sensors=tuple(content.sensor),
    )
    check_scene(scene)
    return scene


def _with_typical_hit(model: mujoco.MjModel, entry: RippleEntry, content: SceneFile) -> RippleEntry:
    """A target whose preset "suited", if it has that one, has all parameters.

    Those that the scene file leaves out are found from the model.
    """
    preset = entry.material.preset
    preset = PresetEntry(name=preset) if isinstance(preset, str) else preset
    if preset is None or preset.name != "suited":
        return entry
    parameters = given_fields(preset, without="name")
    can_ease = not content.two_way and entry.pulse == "contact"
    if not parameters and can_ease and entry.material.density is None:
        # the model chooses the whole material, as without a preset: rings that can be seen
        preset = None
    else:
        if not {"size", "hit"} <= set(parameters):
            parameters = typical_hit(model, entry.geom) | parameters
        preset = PresetEntry(name="suited", **parameters)
    material = msgspec.structs.replace(entry.material, preset=preset)
    return msgspec.structs.replace(entry, material=material)


def load_model(
    path: Path,
    random: RandomEntry | None = None,
    edit: Edit | None = None,
    looks_of_files: Sequence[str] = (),
) -> tuple[mujoco.MjModel, dict[str, np.ndarray]]:
    """Compile an MJCF file; also return how far each of its bodies was shifted at random [m].

    The geoms named in `looks_of_files` get the materials of their mesh files, see
    `paint_from_files`.

    Raises `SceneError` if the file is missing or MuJoCo refuses it, with MuJoCo's reason, or the
    randomisation is invalid.
    """
    if not path.is_file():
        problem = "is not a file" if path.exists() else "does not exist"
        raise SceneError(
            f"MJCF file {str(path)!r} {problem}; `model` names it, relative to the scene file"
        )
    check_files(path)
    # a NaN is reported once: by an error below, or by MuJoCo's warning where no error sees it
    with warnings.catch_warnings(record=True) as caught, refusal_of(repr(str(path))):
        warnings.simplefilter("always")
        spec = mujoco.MjSpec.from_file(str(path))
        # before the compiler fills in missing values
        keys = [(key.name, len(key.qpos)) for key in spec.keys]
        shifts = {} if random is None else randomize(spec, random)
        for note in paint_from_files(spec, looks_of_files):
            warn_caller(f"{path.name}: {note}")
        if edit is not None:
            edit(spec)
        model = own_model(spec.compile())
    for number, (name, count) in enumerate(keys):
        if edit is None and count not in (0, model.nq):
            raise SceneError(
                f"keyframe {name or number!r} of {str(path)!r} must have {model.nq} positions "
                f"(qpos), as the model has, got {count}"
            )
    for key, numbers in enumerate(np.hstack([model.key_qpos, model.key_qvel])):
        if not np.isfinite(numbers).all():
            raise SceneError(
                f"keyframe {model.key(key).name or key!r} of {str(path)!r} must hold finite "
                "numbers, got NaN or inf"
            )
    for warning in caught:
        warn_caller(str(warning.message), warning.category)
    return model, shifts


@contextlib.contextmanager
def refusal_of(name: str) -> Iterator[None]:
    """Turn MuJoCo's refusal of a model into a `SceneError`, and its warnings into ours.

    `name` is the model's name in messages.
    """
    adopt_warnings()
    try:
        yield
    except ValueError as error:
        reason = " ".join(str(error).split())
        # by default MuJoCo allocates as much as all bodies in one heap would need
        if "allocate memory" in reason:
            reason += '; name in the MJCF how much it may take, such as <size memory="4G"/>'
        raise SceneError(f"MuJoCo refuses {name}: {reason}") from error
