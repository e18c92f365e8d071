"""Values put into a MuJoCo model before it is compiled."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import shown

from .distributions import Distribution
from .key_path import choose, parse_key
from .vary_table import Stream, combined

# Elements of an MJCF by their tags, and where a specification lists them.
ELEMENTS = {
    "body": "bodies", "geom": "geoms", "joint": "joints", "site": "sites", "camera": "cameras", "light": "lights",
    "material": "materials", "texture": "textures", "mesh": "meshes", "tendon": "tendons", "actuator": "actuators",
}  # fmt: skip
_GROUPS = ("option", "visual")


def vary_model(spec: mujoco.MjSpec, entries: Mapping[str, Distribution], stream: Stream) -> dict[str, Any]:
    """Draw values for attributes of a model's elements, such as `geom[ball].size`, and set them in place.

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
            except (TypeError, ValueError, IndexError) as error:
                raise SceneError(
                    f"plan: {name} cannot {distribution.apply} {shown(value)}; in the model it is "
                    f"{shown(getattr(element, attribute))}"
                ) from error
    return values


def _attributes(spec: mujoco.MjSpec, key: str) -> Iterator[tuple[Any, str, int | None, str]]:
    """Each element that a key fits, its attribute, the number in the attribute's brackets, and the whole key."""
    first, *steps = parse_key(key)
    if not steps or first.name not in (*ELEMENTS, *_GROUPS):
        raise SceneError(
            f"plan: {key!r} is no attribute of a model; valid are an element and its attribute, such as "
            f"geom[ball].size, of {', '.join((*ELEMENTS, *_GROUPS))}"
        )
    if first.name in _GROUPS:
        found = [(getattr(spec, first.name), first.name)]
    else:
        elements = getattr(spec, ELEMENTS[first.name])
        names = [each.name for each in elements]
        chosen = choose(names, first, "the model")
        found = [(elements[number], f"{first.name}[{names[number] or number}]") for number in chosen]
    last = steps[-1]
    for element, name in found:
        for step in steps[:-1]:
            element, name = _inner(element, step.name, key), f"{name}.{step.name}"
        _inner(element, last.name, key)
        yield element, last.name, last.index, f"{name}.{last.name}" + (f"[{last.chosen}]" if last.chosen else "")


def _inner(element: Any, attribute: str, key: str) -> Any:
    if not hasattr(element, attribute):
        valid = ", ".join(name for name in dir(element) if not name.startswith("_"))
        raise SceneError(f"plan: {key!r} names the attribute {attribute!r}; valid are {valid}")
    return getattr(element, attribute)


def _assign(element: Any, attribute: str, index: int | None, value: Any, apply: str) -> None:
    """Set an attribute; a vector takes as many numbers as are given, like an MJCF's."""
    old = getattr(element, attribute)
    if attribute == "mass" and apply == "multiply" and not np.isfinite(old):
        attribute, old = "density", element.density
    if isinstance(old, np.ndarray):
        new, given = old.copy(), np.atleast_1d(np.asarray(value, float))
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
        setattr(element, attribute, type(old)(value if apply == "set" else combined(old, value, apply)))
