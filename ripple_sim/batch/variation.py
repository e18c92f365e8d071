"""One scene of a batch: its seed, its values, and the scene that they make.

Values go into the table of a scene file, and into a MuJoCo model before it is compiled.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import mujoco
import numpy as np

from ripple_sim.errors import SceneError
from ripple_sim.scene.drop import drop_scene
from ripple_sim.scene.loading import load_scene, scene_of
from ripple_sim.scene.scene import Scene
from ripple_sim.scene.scene_file import parse_scene
from ripple_sim.solver.errors import shown

from .distribution import Distribution
from .keys import Step, choose, parse_key
from .plan import MeshesEntry, Plan

# The stream of random numbers of a key.
Stream = Callable[[str], np.random.Generator]

# Keys by which an entry of a list is named, in this order.
_NAME_KEYS = ("geom", "body", "actuator")

# Tags of elements in an MJCF, and the attribute of `MjSpec` that lists them.
ELEMENTS = {
    "body": "bodies",
    "geom": "geoms",
    "joint": "joints",
    "site": "sites",
    "camera": "cameras",
    "light": "lights",
    "material": "materials",
    "texture": "textures",
    "mesh": "meshes",
    "tendon": "tendons",
    "actuator": "actuators",
}

# parts of a specification that have attributes but no elements
_MODEL_GROUPS = ("option", "visual")

# A seed of 29 bits has nine digits at most, as `ripple-sim render --seed` takes them.
_SEED_BITS = 29


def vary_table(
    table: dict[str, Any], entries: Mapping[str, Distribution], stream: Stream
) -> dict[str, Any]:
    """Draw values for the keys of a scene file's table and put them there.

    Returns
    -------
    dict
        The values drawn, by the key of each place.

    Raises
    ------
    SceneError
        If a key fits nothing in the table, or there is no number to add to or to multiply.
    """
    values = {}
    for key, distribution in entries.items():
        for holder, place, name in _places(table, parse_key(key), ""):
            value = values[name] = distribution.draw(stream(key if distribution.together else name))
            if distribution.apply != "set":
                old = holder.get(place) if isinstance(holder, dict) else holder[place]
                try:
                    if old is None:  # left out, which numpy takes for NaN
                        raise TypeError
                    value = combined(np.asarray(old, float), value, distribution.apply).tolist()
                except (TypeError, ValueError, OverflowError) as error:
                    raise SceneError(
                        f"plan: {name} is {shown(old)} in the scene, which {shown(value)} cannot "
                        f"{distribution.apply}; write a number into the scene file, or set the "
                        "value"
                    ) from error
            holder[place] = value
    return values


def _places(
    table: dict[str, Any], steps: Sequence[Step], before: str
) -> Iterator[tuple[Any, Any, str]]:
    """Find the places that a key names.

    Yields the table or list that holds the value, the key or index in it, and the full key.
    """
    (key, chosen) = steps[0]
    rest = steps[1:]
    here = f"{before}.{key}" if before else key
    if not rest and not chosen:
        yield table, key, here
        return
    inner = table.get(key)
    if inner is None and not chosen:
        inner = table[key] = {}
    if isinstance(inner, list) and all(isinstance(item, dict) for item in inner):
        names = [_name_of(item) for item in inner]
        for number in choose(names, steps[0], "the scene"):
            item = f"{here}[{names[number] or number}]"
            if not rest:
                raise SceneError(f"plan: {item} is a table; name one of its keys")
            yield from _places(inner[number], rest, item)
    elif isinstance(inner, list) and not rest and chosen.isdecimal() and int(chosen) < len(inner):
        yield inner, int(chosen), f"{here}[{int(chosen)}]"
    elif isinstance(inner, dict) and not chosen:
        yield from _places(inner, rest, here)
    else:
        raise SceneError(
            f"plan: the scene has no {'.'.join([here, *(name for name, _ in rest)])} to vary"
        )


def _name_of(item: dict[str, Any]) -> str:
    """The name by which a key chooses a table of a list; "" if the table has none."""
    for key in _NAME_KEYS:
        if key in item:
            return str(item[key])
    return ""


def combined(old: Any, value: Any, apply: str) -> Any:
    """A number or vector with a value added, or multiplied by it."""
    return old + np.asarray(value, float) if apply == "add" else old * np.asarray(value, float)


def vary_model(
    spec: mujoco.MjSpec, entries: Mapping[str, Distribution], stream: Stream
) -> dict[str, Any]:
    """Draw values for attributes of a model's elements, and set them in place.

    An attribute is given by a key such as `geom[ball].size`.

    Returns
    -------
    dict
        The values drawn, by the key of each attribute.

    Raises
    ------
    SceneError
        If the model has no such element, the element no such attribute, or the value does not fit.
    """
    values = {}
    for key, distribution in entries.items():
        for element, attribute, index, name in _attributes(spec, key):
            value = values[name] = distribution.draw(stream(key if distribution.together else name))
            try:
                _assign(element, attribute, index, value, distribution.apply)
            except (TypeError, ValueError, IndexError, OverflowError) as error:
                raise SceneError(
                    f"plan: {name} cannot {distribution.apply} {shown(value)}; in the model it is "
                    f"{shown(getattr(element, attribute))}"
                ) from error
    return values


def _attributes(spec: mujoco.MjSpec, key: str) -> Iterator[tuple[Any, str, int | None, str]]:
    """Find the attributes that a key names.

    Yields the element, its attribute, the number in the attribute's brackets, and the full key.
    """
    first, *steps = parse_key(key)
    kind, _ = first
    if not steps or kind not in (*ELEMENTS, *_MODEL_GROUPS):
        raise SceneError(
            f"plan: {key!r} is no attribute of a model: name an element and its attribute, such "
            f"as geom[ball].size, of {', '.join((*ELEMENTS, *_MODEL_GROUPS))}"
        )
    if kind in _MODEL_GROUPS:
        found = [(getattr(spec, kind), kind)]
    else:
        elements = getattr(spec, ELEMENTS[kind])
        names = [each.name for each in elements]
        numbers = choose(names, first, "the model")
        found = [(elements[number], f"{kind}[{names[number] or number}]") for number in numbers]
    attribute, chosen = steps[-1]
    index = int(chosen) if chosen.isdecimal() else None
    for element, name in found:
        for inner, _ in steps[:-1]:
            element = _inner(element, inner, key)
            name = f"{name}.{inner}"
        _inner(element, attribute, key)
        yield element, attribute, index, f"{name}.{attribute}" + (f"[{chosen}]" if chosen else "")


def _inner(element: Any, attribute: str, key: str) -> Any:
    if not hasattr(element, attribute):
        valid = ", ".join(name for name in dir(element) if not name.startswith("_"))
        raise SceneError(
            f"plan: {key!r} names the attribute {attribute!r}, which does not exist; attributes "
            f"are {valid}"
        )
    return getattr(element, attribute)


def _assign(element: Any, attribute: str, index: int | None, value: Any, apply: str) -> None:
    """Set an attribute; a vector takes as many numbers as are given, like an MJCF's."""
    old = getattr(element, attribute)
    if attribute == "mass" and apply == "multiply" and not np.isfinite(old):
        attribute = "density"
        old = element.density
    if isinstance(old, np.ndarray):
        new = old.copy()
        given = np.atleast_1d(np.asarray(value, float))
        part: slice = np.s_[index : index + 1] if index is not None else np.s_[: len(given)]
        if apply == "multiply" and index is None and np.ndim(value) == 0:
            part = np.s_[:]
        new[part] = given if apply == "set" else combined(old[part], given, apply)
        if attribute == "quat" and hasattr(element, "alt"):
            element.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        setattr(element, attribute, new)
    elif isinstance(old, str):
        setattr(element, attribute, value)
    else:
        setattr(
            element, attribute, type(old)(value if apply == "set" else combined(old, value, apply))
        )


class Variation:
    """The scene of a number; it does not depend on the worker or on the order.

    Each key has a stream of random numbers of its own, so a key more in the plan leaves the values
    of the others.

    Attributes
    ----------
    seed : int
        Of the scene: for its `[random]`, or for the bodies that drop on a mesh.
    """

    def __init__(self, plan: Plan, number: int) -> None:
        self.plan = plan
        self.number = number
        self.source = plan.sources[number % len(plan.sources)]
        drawn = np.random.SeedSequence(plan.seed, spawn_key=(number,)).generate_state(1)[0]
        self.seed = int(drawn) >> (32 - _SEED_BITS)

    def stream(self, key: str) -> np.random.Generator:
        """The random numbers of a key."""
        spawned = np.random.SeedSequence(
            self.plan.seed, spawn_key=(self.number, zlib.crc32(key.encode()))
        )
        return np.random.Generator(np.random.PCG64(spawned))

    def load(self) -> tuple[Scene, dict[str, Any]]:
        """Load the scene, and the values drawn for it by their keys.

        Raises `RippleError` if a key of the plan fits nothing, or the scene refuses a value.
        """
        values: dict[str, Any] = {}

        def edit(spec: mujoco.MjSpec) -> None:
            values.update(vary_model(spec, self.plan.model, self.stream))

        def change(table: dict[str, Any]) -> None:
            if "random" in table:
                table["random"]["seed"] = self.seed
            values.update(vary_table(table, self.plan.vary, self.stream))

        if Path(self.source).suffix in ("", ".toml"):
            scene = load_scene(self.source, edit=edit, change=change)
        else:
            meshes = self.plan.meshes or MeshesEntry([], bodies=0)
            bodies = meshes.bodies
            if isinstance(bodies, Distribution):
                bodies = bodies.draw(self.stream("bodies"))
                if not isinstance(bodies, int):
                    raise SceneError(
                        f"plan: the number of bodies is {bodies!r}; draw it from integers"
                    )
            values["bodies"] = bodies
            scene = drop_scene(
                self.source,
                bodies=bodies,
                seed=self.seed,
                up=meshes.up,
                look=meshes.look,
                edit=edit,
                repair=meshes.repair,
                wrap=meshes.wrap,
            )
            # as in a scene file: values that differ from the defaults, as plain values
            parts = {"ripple": list(scene.targets), "camera": scene.camera}
            parts |= {name: list(events) for name, events in vars(scene.events).items()}
            table = {"model": scene.name, "duration": scene.duration, "two_way": scene.two_way}
            table |= {key: msgspec.to_builtins(part) for key, part in parts.items() if part}
            change(table)
            scene = scene_of(scene.name, scene.model, parse_scene(table, scene.name), scene.notes)
        return scene, dict(sorted(values.items()))
