"""Keys of a plan, such as `camera.azimuth`, `ripple[duck].look`, `geom[ball*].size[0]`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fnmatch import fnmatchcase

from ripple_sim.errors import SceneError

# One step of a key: a name, perhaps with brackets behind it.
_STEP_PATTERN = r"([A-Za-z_][A-Za-z_0-9]*)(?:\[([^\]]+)\])?"

# A step of a key: its name, and the text in its brackets, which is a number, a name, or a pattern
# with *. The text is "" without brackets.
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


def choose(names: Sequence[str], step: Step, owner: str) -> list[int]:
    """Indices of the items that a step of a key selects by their names; without brackets all.

    `owner` says in the message what has the items. Raises `SceneError` if none is selected.
    """
    kind, selector = step
    if not selector:
        indices = list(range(len(names)))
    elif selector.isdecimal() and selector not in names:
        indices = [int(selector)] if int(selector) < len(names) else []
    else:
        indices = [index for index, name in enumerate(names) if fnmatchcase(name, selector)]
    if not indices:
        labels = [name or f"number {index}" for index, name in enumerate(names)]
        raise SceneError(
            f"plan: {owner} has no {kind}[{selector or '*'}]; there is "
            f"{', '.join(labels) or 'none'}"
        )
    return indices
