"""From the contacts of a physics step to loads on the texels of the targets."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Load, WaveSolver

from .contacts import ContactPair, contact_pairs, smallest_extents
from .patch import Patch
from .press import Press
from .target import geom_name

# Footprint radius over the touching body's smallest half-extent: about the patch of a ball sunk in by an eighth.
_FOOTPRINT = 0.5

_NOT_CONVEX = (int(mujoco.mjtGeom.mjGEOM_SDF), int(mujoco.mjtGeom.mjGEOM_HFIELD))


@dataclasses.dataclass(frozen=True, eq=False)
class Impulse:
    """What one body gave to one target in one physics step.

    Attributes
    ----------
    geom, other : str
        Names of the target and of the touching geom.
    point : float64 [3]
        Force-weighted contact point on the target's true surface, in the world [m].
    impulse : float
        Sum of normal force times time step [N s], not negative; it presses inwards.
    texel : tuple of int
        Face, row and column of the texel nearest to the point.
    """

    geom: str
    other: str
    point: NDArray[np.float64]
    impulse: float
    texel: tuple[int, int, int]


@dataclasses.dataclass(frozen=True, eq=False)
class Touch:
    """A pair of geoms that touch: its contacts, and the forces on the texels of its target."""

    pair: ContactPair
    load: Load


class Sources:
    """What presses on each target, step by step.

    Parameters
    ----------
    model : mujoco.MjModel
    waves : mapping
        Geom id of every target to its waves. Looked at in each step, so that they may be replaced.

    Attributes
    ----------
    impulses : list of Impulse
        Of the latest step, one for each pair.
    touches : list of Touch
        Of the latest step.
    """

    def __init__(self, model: mujoco.MjModel, waves: Mapping[int, WaveSolver]) -> None:
        self._model, self._waves = model, waves
        self._is_target = np.zeros(model.ngeom, dtype=np.bool_)
        self._is_target[list(waves)] = True
        self._extents = smallest_extents(model)
        self._radius = (_FOOTPRINT * self._extents).tolist()
        self._convex = (~np.isin(model.geom_type, _NOT_CONVEX)).tolist()
        self._names = [geom_name(model, geom) for geom in range(model.ngeom)]
        self._carried = {geom: _carried(each) for geom, each in waves.items()}
        self._presses: dict[tuple[int, int], Press] = {}
        self.clear()

    def clear(self) -> None:
        """Forget all contacts."""
        self._presses.clear()
        self.impulses: list[Impulse] = []
        self.touches: list[Touch] = []

    def renew(self, geom: int) -> None:
        """Go on with the new waves of a target."""
        self._carried[geom] = _carried(self._waves[geom])
        for (target, _), press in self._presses.items():
            if target == geom:
                press.carry(self._carried[geom])

    def loads(self, data: mujoco.MjData, elapsed: float) -> dict[int, list[Load]]:
        """Loads on each target over a time [s], from the contact forces that MuJoCo held over its latest time step."""
        self.impulses, self.touches = [], []
        loads: dict[int, list[Load]] = {geom: [] for geom in self._waves}
        pairs = contact_pairs(self._model, data, self._is_target, self._extents)
        for geom in loads:
            touching = [pair for key, pair in pairs.items() if key[0] == geom]
            if touching:
                loads[geom] += self._press(data, geom, touching, elapsed)
        for key, press in list(self._presses.items()):
            if key not in pairs:
                loads[key[0]].append(press.release(elapsed))
                if press.over:
                    del self._presses[key]
        return loads

    def _press(self, data: mujoco.MjData, geom: int, pairs: list[ContactPair], elapsed: float) -> list[Load]:
        """Loads of the pairs that touch a target; their impulses are noted."""
        waves, timestep = self._waves[geom], self._model.opt.timestep
        position, rotation = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
        begins = np.cumsum([0, *(len(pair.forces) for pair in pairs)])
        forces = np.concatenate([pair.forces for pair in pairs])
        points = (np.concatenate([pair.points for pair in pairs]) - position) @ rotation
        totals = np.add.reduceat(forces, begins[:-1])
        middles = np.add.reduceat(forces[:, None] * points, begins[:-1]) / totals[:, None]
        patches = [
            Patch(points[a:b], pair.forces, min(self._radius[geom], self._radius[pair.other]), self._convex[pair.other])
            for pair, a, b in zip(pairs, begins.tolist(), begins[1:].tolist(), strict=False)
        ]
        # one search for all points: each costs little beside the call
        closest, texels = waves.atlas.nearest(np.concatenate([middles, *(patch.probes for patch in patches)]))
        in_world = position + closest[: len(pairs)] @ rotation.T
        given, nearest = (totals * timestep).tolist(), texels[: len(pairs)].tolist()
        n, begin, loads = waves.atlas.resolution, len(pairs), []
        for i, (pair, patch) in enumerate(zip(pairs, patches, strict=True)):
            self.impulses.append(
                Impulse(
                    geom=self._names[geom],
                    other=self._names[pair.other],
                    point=in_world[i],
                    impulse=given[i],
                    texel=(nearest[i] // (n * n), nearest[i] // n % n, nearest[i] % n),
                )
            )
            rows = slice(begin, begin + len(patch.probes))
            begin = rows.stop
            press = self._presses.get((geom, pair.other))
            if press is None:
                press = self._presses[geom, pair.other] = Press(waves.atlas, self._carried[geom])
            pressed = patch.pressed(closest[rows], timestep / elapsed)
            loads.append(press.press(pressed, (closest[rows], texels[rows]), middles[i], elapsed))
            self.touches.append(Touch(pair, press.latest))
        return loads


def _carried(waves: WaveSolver) -> NDArray[np.float64]:
    return (waves.atlas.areas * waves.operator.carries).reshape(-1)
