"""Bodies that MuJoCo lets sleep: they still press on what they lie on, but have no contacts in its data."""

from __future__ import annotations

import collections
import copy
from collections.abc import Mapping

import mujoco
import numpy as np

from .contacts import Contacts, first_rows
from .model import CoupledModel

SLEEP, _STATE = int(mujoco.mjtEnableBit.mjENBL_SLEEP), int(mujoco.mjtState.mjSTATE_INTEGRATION)

# Contacts of these parameters have no spring, and a share of nearly 1 in what holds bodies: their forces are those of
# statics, however deep the bodies lie in each other.
_NO_SPRING, _RIGID = (1e6, 1.0), (0.9999, 0.9999, 0.001, 0.5, 2.0)
# Geoms that are apart by this share of the smaller one's size are meant to touch.
_NEAR = 1e-3


def at_rest(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData | None:
    """Data with the contacts of all bodies as they lie, all awake and at rest; None where none of them sleeps."""
    if (data.tree_asleep < 0).all():
        return None
    still = copy.copy(model)
    still.opt.enableflags &= ~SLEEP
    for kind in ("geom", "pair", "flex"):
        getattr(still, f"{kind}_solref")[:] = _NO_SPRING
        getattr(still, f"{kind}_solimp")[:] = _RIGID
    # planes, which have no end, are given a radius of 0
    still.geom_margin += _NEAR * np.minimum(still.geom_aabb[:, 3:].min(axis=1), still.geom_rbound)
    state = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, state, _STATE)
    resting = mujoco.MjData(still)
    mujoco.mj_setState(still, resting, state, _STATE)
    resting.qvel[:], resting.qacc_warmstart[:] = 0.0, 0.0
    mujoco.mj_forward(still, resting)
    return resting


_AWAKE = int(mujoco.mjtSleepState.mjS_AWAKE)
# A body falls asleep after it was slow for this many steps: `mjMINAWAKE` of MuJoCo.
_SLOW_STEPS = 10


class SleepingContacts:
    """Holds the contacts of bodies that sleep on a target that sleeps too or is static.

    A sleeping body's contacts stay where they were, with their mean force over the steps before it fell asleep, until
    one of the two wakes.

    Parameters
    ----------
    coupled : CoupledModel
    """

    def __init__(self, coupled: CoupledModel) -> None:
        self._coupled = coupled
        # by target and other: the latest contacts, and their summed forces in the latest steps [N]
        self._pairs: dict[tuple[int, int], tuple[Contacts, collections.deque[float]]] = {}

    def add(self, data: mujoco.MjData, contacts: Mapping[int, Contacts]) -> dict[int, Contacts]:
        """Contacts of each target, by geom id, with those of sleeping bodies."""
        present = {(target, int(pair.others[0])): pair for target, each in contacts.items() for pair in _by_other(each)}
        found = dict(contacts)
        for key, (pair, sums) in list(self._pairs.items()):
            if key in present:
                continue
            if self._sleeps(data, *key):
                mean = pair._replace(forces=pair.forces * (sum(sums) / len(sums) / pair.forces.sum()))
                found[key[0]] = Contacts.together([*([found[key[0]]] if key[0] in found else []), mean])
            else:
                sums.append(0.0)
                if not any(sums):
                    del self._pairs[key]
        for key, pair in present.items():
            _, sums = self._pairs.get(key, (pair, collections.deque[float](maxlen=_SLOW_STEPS)))
            sums.append(float(pair.forces.sum()))
            self._pairs[key] = pair, sums
        return found

    def _sleeps(self, data: mujoco.MjData, target: int, other: int) -> bool:
        """Whether neither of a pair is awake: each sleeps or is static. Vertices between bodies never sleep."""
        bodies = self._coupled.bodies[[target, other]]
        return bool((bodies >= 0).all() and (data.body_awake[bodies] != _AWAKE).all())


def _by_other(contacts: Contacts) -> list[Contacts]:
    """The contacts with each geom."""
    starts = first_rows(contacts.others).tolist()
    return [contacts.rows(slice(a, b)) for a, b in zip(starts, [*starts[1:], None], strict=True)]
