"""Keys of a plan, such as `camera.azimuth`, `ripple[duck].look`, `geom[ball*].size[0]`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fnmatch import fnmatchcase

from ripple_sim.errors import SceneError

# One step of a key: a name, perhaps with something in brackets behind it.
_STEP_PATTERN = r"([A-Za-z_][A-Za-z_0-9]*)(?:\[([^\]]+)\])?"


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
