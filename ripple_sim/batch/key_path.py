"""Keys of a plan: `camera.azimuth`, `ripple[duck].material.speed`, `geom[ball*].size[0]`."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from fnmatch import fnmatchcase

from ripple_sim.errors import SceneError

_STEP = re.compile(r"([A-Za-z_][A-Za-z_0-9]*)(?:\[([^\]]+)\])?(?:\.|$)")


@dataclasses.dataclass(frozen=True)
class Step:
    """A part of a key: a name, and what stands in brackets behind it: a number, a name, or a pattern with *."""

    name: str
    chosen: str | None = None

    @property
    def index(self) -> int | None:
        """The number in brackets."""
        return int(self.chosen) if self.chosen is not None and self.chosen.isdecimal() else None


def parse_key(key: str) -> tuple[Step, ...]:
    """Read a key of a plan.

    Raises
    ------
    SceneError
        If it is not names between dots.
    """
    steps, place = [], 0
    while place < len(key):
        found = _STEP.match(key, place)
        if found is None:
            break
        steps.append(Step(found[1], found[2]))
        place = found.end()
    if not steps or place < len(key) or key.endswith("."):
        raise SceneError(
            f"plan: {key!r} is not a key; valid are names between dots, with a number, a name or a pattern in "
            "brackets, such as camera.azimuth, ripple[duck].material.speed or geom[ball*].size"
        )
    return tuple(steps)


def choose(names: Sequence[str], step: Step, where: str) -> list[int]:
    """Numbers of the items that a step chooses from items of these names; without brackets all of them.

    Raises
    ------
    SceneError
        If there is none.
    """
    if step.chosen is None:
        found = list(range(len(names)))
    elif step.index is not None and step.chosen not in names:
        found = [step.index] if step.index < len(names) else []
    else:
        found = [number for number, name in enumerate(names) if fnmatchcase(name, step.chosen)]
    if not found:
        listed = ", ".join(name or f"number {number}" for number, name in enumerate(names)) or "none"
        raise SceneError(f"plan: {where} has no {step.name}[{step.chosen or '*'}]; there is {listed}")
    return found
