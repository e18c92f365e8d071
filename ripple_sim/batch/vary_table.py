"""Values put into the table of a scene file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ripple_sim.errors import SceneError

from .distributions import Distribution
from .key_path import Step, choose, parse_key

# The stream of random numbers of a key.
Stream = Callable[[str], np.random.Generator]

_NAMES = ("geom", "body", "actuator")  # what an entry of a list goes by


class Place(NamedTuple):
    """Where a value stands: the table or list that holds it, the key or number there, and the whole key."""

    holder: Any
    key: Any
    name: str


def vary_table(table: dict[str, Any], entries: Mapping[str, Distribution], stream: Stream) -> dict[str, Any]:
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
        for place in _places(table, parse_key(key), ""):
            value = distribution.draw(stream(key if distribution.together else place.name))
            values[place.name] = value
            _put(place, value, distribution)
    return values


def _places(table: dict[str, Any], steps: Sequence[Step], before: str) -> Iterator[Place]:
    step, rest = steps[0], steps[1:]
    here = f"{before}.{step.name}" if before else step.name
    if not rest and step.chosen is None:
        yield Place(table, step.name, here)
        return
    inner = table.get(step.name)
    if inner is None and step.chosen is None:
        inner = table[step.name] = {}
    if isinstance(inner, list) and all(isinstance(item, dict) for item in inner):
        names = [next((str(item[key]) for key in _NAMES if key in item), "") for item in inner]
        for number in choose(names, step, "the scene"):
            item = f"{here}[{names[number] or number}]"
            if not rest:
                raise SceneError(f"plan: {item} is a table; name one of its keys")
            yield from _places(inner[number], rest, item)
    elif isinstance(inner, list) and not rest and step.index is not None and step.index < len(inner):
        yield Place(inner, step.index, f"{here}[{step.index}]")
    elif isinstance(inner, dict) and step.chosen is None:
        yield from _places(inner, rest, here)
    else:
        raise SceneError(f"plan: the scene has no {'.'.join([here, *(each.name for each in rest)])} to vary")


def _put(place: Place, value: Any, distribution: Distribution) -> None:
    if distribution.apply != "set":
        old = place.holder.get(place.key) if isinstance(place.holder, dict) else place.holder[place.key]
        try:
            if old is None:  # left out, which numpy takes for NaN
                raise TypeError
            value = combined(np.asarray(old, float), value, distribution.apply).tolist()
        except (TypeError, ValueError) as error:
            raise SceneError(
                f"plan: {place.name} is {old!r} in the scene, which {value!r} cannot {distribution.apply}; write a "
                "number into the scene file, or set the value"
            ) from error
    place.holder[place.key] = value


def combined(old: Any, value: Any, apply: str) -> Any:
    """A number or vector with a value added, or multiplied by it."""
    return old + np.asarray(value, float) if apply == "add" else old * np.asarray(value, float)
