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

# Gives the stream of random numbers of a key.
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

# Groups of a specification that have attributes but no elements.
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
            value = distribution.draw(stream(key if distribution.together else name))
            values[name] = value
            if distribution.apply != "set":
                old = holder.get(place) if isinstance(holder, dict) else holder[place]
                try:
                    if old is None:  # left out of the table; NumPy would make it NaN
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
    table: dict[str, Any], steps: Sequence[Step], prefix: str
) -> Iterator[tuple[Any, Any, str]]:
    """Find the places that a key names, from its steps; `prefix` is the key of the table.

    Yields the table or list that holds the value, the key or index in it, and the full key.
    """
    key, selector = steps[0]
    later_steps = steps[1:]
    full_key = f"{prefix}.{key}" if prefix else key
    if not later_steps and not selector:
        yield table, key, full_key
        return
    inner = table.get(key)
    if inner is None and not selector:
        inner = table[key] = {}
    if isinstance(inner, list) and all(isinstance(item, dict) for item in inner):
        names = [_name_of(item) for item in inner]
        for index in choose(names, steps[0], "the scene"):
            item_key = f"{full_key}[{names[index] or index}]"
            if not later_steps:
                raise SceneError(f"plan: {item_key} is a table; name one of its keys")
            yield from _places(inner[index], later_steps, item_key)
    elif isinstance(inner, list) and not later_steps and _is_index(selector, inner):
        yield inner, int(selector), f"{full_key}[{int(selector)}]"
    elif isinstance(inner, dict) and not selector:
        yield from _places(inner, later_steps, full_key)
    else:
        missing = ".".join([full_key, *(name for name, _ in later_steps)])
        raise SceneError(f"plan: the scene has no {missing} to vary")


def _is_index(selector: str, items: Sequence[Any]) -> bool:
    """Whether the text in a step's brackets is the index of an item."""
    return selector.isdecimal() and int(selector) < len(items)


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
            value = distribution.draw(stream(key if distribution.together else name))
            values[name] = value
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
        named_elements = [(getattr(spec, kind), kind)]
    else:
        elements = getattr(spec, ELEMENTS[kind])
        names = [element.name for element in elements]
        named_elements = [
            (elements[number], f"{kind}[{names[number] or number}]")
            for number in choose(names, first, "the model")
        ]
    attribute, selector = steps[-1]
    index = int(selector) if selector.isdecimal() else None
    brackets = f"[{selector}]" if selector else ""
    for element, name in named_elements:
        for inner, _ in steps[:-1]:
            element = _attribute(element, inner, key)
            name = f"{name}.{inner}"
        _attribute(element, attribute, key)  # raises if there is none
        yield element, attribute, index, f"{name}.{attribute}{brackets}"


def _attribute(element: Any, attribute: str, key: str) -> Any:
    """The attribute of an element that a key names; raises `SceneError` if there is none."""
    if not hasattr(element, attribute):
        valid = ", ".join(name for name in dir(element) if not name.startswith("_"))
        raise SceneError(
            f"plan: {key!r} names the attribute {attribute!r}, which does not exist; attributes "
            f"are {valid}"
        )
    return getattr(element, attribute)


def _assign(element: Any, attribute: str, index: int | None, value: Any, apply: str) -> None:
    """Set an attribute; a vector takes as many numbers as there are, like an MJCF's."""
    old = getattr(element, attribute)
    # a mass that the MJCF leaves out follows from the density
    if attribute == "mass" and apply == "multiply" and not np.isfinite(old):
        attribute = "density"
        old = element.density
    if isinstance(old, np.ndarray):
        new = old.copy()
        numbers = np.atleast_1d(np.asarray(value, float))
        entries: slice = np.s_[index : index + 1] if index is not None else np.s_[: len(numbers)]
        if apply == "multiply" and index is None and np.ndim(value) == 0:
            entries = np.s_[:]
        new[entries] = numbers if apply == "set" else combined(old[entries], numbers, apply)
        if attribute == "quat" and hasattr(element, "alt"):
            element.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        setattr(element, attribute, new)
    elif isinstance(old, str):
        setattr(element, attribute, value)
    else:
        number = value if apply == "set" else combined(old, value, apply)
        setattr(element, attribute, type(old)(number))


class Variation:
    """The scene of a number; it does not depend on the worker or on the order.

    Each key has a stream of random numbers of its own, so that another key in the plan does not
    change the values of the others.

    Attributes
    ----------
    seed : int
        Of the scene: for its `[random]`, or for the bodies that drop on a mesh.
    """

    def __init__(self, plan: Plan, number: int) -> None:
        self.plan = plan
        self.number = number
        self.source = plan.sources[number % len(plan.sources)]
        sequence = np.random.SeedSequence(plan.seed, spawn_key=(number,))
        self.seed = int(sequence.generate_state(1)[0]) >> (32 - _SEED_BITS)

    def stream(self, key: str) -> np.random.Generator:
        """The random numbers of a key."""
        spawn_key = (self.number, zlib.crc32(key.encode()))
        sequence = np.random.SeedSequence(self.plan.seed, spawn_key=spawn_key)
        return np.random.Generator(np.random.PCG64(sequence))

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
            values["bodies"] = self._body_count()
            scene = self._drop_scene(values["bodies"], edit)
            table = _table_of(scene)
            change(table)
            scene = scene_of(scene.name, scene.model, parse_scene(table, scene.name), scene.notes)
        return scene, dict(sorted(values.items()))

    def _body_count(self) -> int:
        """Number of bodies that drop on a mesh."""
        bodies = 0 if self.plan.meshes is None else self.plan.meshes.bodies
        if isinstance(bodies, Distribution):
            bodies = bodies.draw(self.stream("bodies"))
            if not isinstance(bodies, int):
                raise SceneError(f"plan: the number of bodies is {bodies!r}; draw it from integers")
        return bodies

    def _drop_scene(self, bodies: int, edit: Callable[[mujoco.MjSpec], None]) -> Scene:
        """The scene in which bodies drop on the mesh."""
        meshes = self.plan.meshes or MeshesEntry([])
        return drop_scene(
            self.source,
            bodies=bodies,
            seed=self.seed,
            up=meshes.up,
            look=meshes.look,
            edit=edit,
            repair=meshes.repair,
            wrap=meshes.wrap,
        )


def _table_of(scene: Scene) -> dict[str, Any]:
    """The table of a scene as a scene file has it: values that differ from the defaults."""
    table = {"model": scene.name, "duration": scene.duration, "two_way": scene.two_way}
    entries = {"ripple": list(scene.targets), "camera": scene.camera}
    entries |= {name: list(events) for name, events in vars(scene.events).items()}
    for key, entry in entries.items():
        if entry:
            table[key] = msgspec.to_builtins(entry)
    return table
