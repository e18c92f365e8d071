"""The contacts of sleeping bodies, which MuJoCo does not report."""

from __future__ import annotations

import collections
from typing import NamedTuple

import mujoco
import numpy as np

from ripple_sim.solver.kernel import Floats

from .contacts import TargetContacts
from .model import CoupledModel

_AWAKE = int(mujoco.mjtSleepState.mjS_AWAKE)
# A body falls asleep after it was slow for this many steps: `mjMINAWAKE` of MuJoCo.
_SLOW_STEPS = 10


class _Pair(NamedTuple):
    """The latest contacts of a collider with a target, and their summed forces in the latest steps [N]."""

    points: Floats
    forces: Floats
    normals: Floats
    sums: collections.deque[float]


class SleepingContacts:
    """Holds the contacts of bodies that sleep on a target that sleeps too or is static.

    A sleeping body still presses on what it lies on. Its contacts stay where they were, with their mean force over the
    steps before it fell asleep, until one of the two wakes.

    Parameters
    ----------
    coupled : CoupledModel
    """

    def __init__(self, coupled: CoupledModel) -> None:
        self._coupled = coupled
        self._pairs: dict[tuple[int, int], _Pair] = {}

    def add(self, data: mujoco.MjData, contacts: dict[int, TargetContacts]) -> dict[int, TargetContacts]:
        """Contacts of each target, by geom id, with those of sleeping bodies."""
        if not self._coupled.model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP:
            return contacts
        present = {(target, pair[0]): pair for target, each in contacts.items() for pair in _split(each)}
        held: dict[int, list[tuple[int, Floats, Floats, Floats]]] = {}
        for key, pair in list(self._pairs.items()):
            if key in present:
                continue
            if self._sleeps(data, *key):
                share = sum(pair.sums) / len(pair.sums) / pair.forces.sum()
                held.setdefault(key[0], []).append((key[1], pair.points, share * pair.forces, pair.normals))
            else:
                pair.sums.append(0.0)
                if not any(pair.sums):
                    del self._pairs[key]
        for key, (_, points, forces, normals) in present.items():
            sums = self._pairs[key].sums if key in self._pairs else collections.deque(maxlen=_SLOW_STEPS)
            sums.append(float(forces.sum()))
            self._pairs[key] = _Pair(points, forces, normals, sums)
        if not held:
            return contacts
        return {
            target: _joined(target, [*(_split(contacts[target]) if target in contacts else ()), *held.get(target, ())])
            for target in sorted(contacts.keys() | held.keys())
        }

    def _sleeps(self, data: mujoco.MjData, target: int, other: int) -> bool:
        """Whether neither of a pair is awake: each sleeps or is static. Vertices between bodies never sleep."""
        bodies = self._coupled.bodies[[target, other]]
        return bool((bodies >= 0).all() and (data.body_awake[bodies] != _AWAKE).all())


def _split(contacts: TargetContacts) -> list[tuple[int, Floats, Floats, Floats]]:
    """Collider id, points, forces and normals of each pair."""
    begins = contacts.begins.tolist()
    return [
        (other, contacts.points[a:b], contacts.forces[a:b], contacts.normals[a:b])
        for other, a, b in zip(contacts.others.tolist(), begins, begins[1:], strict=False)
    ]


def _joined(target: int, pairs: list[tuple[int, Floats, Floats, Floats]]) -> TargetContacts:
    """The opposite of `_split`."""
    others, points, forces, normals = zip(*sorted(pairs, key=lambda pair: pair[0]), strict=True)
    return TargetContacts(
        target=target,
        others=np.array(others),
        begins=np.cumsum([0, *map(len, forces)]),
        points=np.concatenate(points),
        forces=np.concatenate(forces),
        normals=np.concatenate(normals),
    )
