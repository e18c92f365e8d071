"""From the contacts of a physics step to loads on the texels of the targets."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.contacts.flex_contacts import ShellContacts
from ripple_sim.coupling.contacts.geom_contacts import Contacts, pressing_contacts, smallest_extents
from ripple_sim.coupling.model.target import geom_name, shells
from ripple_sim.solver import Load, WaveSolver

from .contact_load import Press, Pressed

# Footprint radius over the touching body's smallest half-extent: about the patch of a ball sunk in by an eighth.
FOOTPRINT = 0.5

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
        Sum of normal force times time step [N s], not negative; it presses inwards. On a flex that stands for the geom,
        of the whole force along the surface's normal.
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
    """A pair of geoms that touch.

    Attributes
    ----------
    target, other : int
        Geom ids.
    point : float64 [3]
        Force-weighted contact point in the world [m].
    normal : float64 [3]
        Unit normal in the world, from the target to the other geom.
    load : Load
        Forces on the texels of the target.
    """

    target: int
    other: int
    point: NDArray[np.float64]
    normal: NDArray[np.float64]
    load: Load


class Sources:
    """What presses on each target, step by step.

    Parameters
    ----------
    model : mujoco.MjModel
    waves : mapping
        Geom id of every target to its waves. Looked at again by `renew` and `clear`.
    """

    def __init__(self, model: mujoco.MjModel, waves: Mapping[int, WaveSolver]) -> None:
        self._model, self._waves = model, waves
        self._is_target = np.zeros(model.ngeom, dtype=np.bool_)
        self._is_target[list(waves)] = True
        self._extents = smallest_extents(model)
        self._convex = ~np.isin(model.geom_type, _NOT_CONVEX)
        self._shells = None
        if shells(model):
            self._shells = ShellContacts(model, {geom: each.atlas.mesh for geom, each in waves.items()})
            self._is_target[self._shells.targets] = False
            self._convex[list(shells(model))] = False
        self._names = [geom_name(model, geom) for geom in range(model.ngeom)]
        self.clear()

    def clear(self) -> None:
        """Forget all contacts."""
        self._presses = {
            geom: Press(waves, FOOTPRINT * self._extents, self._convex) for geom, waves in self._waves.items()
        }
        self.skip()

    def skip(self) -> None:
        """Forget what the latest step gave: there was none."""
        self._pressed: list[Pressed] = []
        self._impulses: list[Impulse] | None = None

    def renew(self, geom: int) -> None:
        """Go on with the new waves of a target."""
        self._presses[geom].renew(self._waves[geom])

    def loads(self, data: mujoco.MjData, elapsed: float) -> dict[int, Load]:
        """Load on each target over a time [s], from the contact forces that MuJoCo held over its latest time step."""
        loads = {}
        self.skip()
        self._timestep = self._model.opt.timestep
        touched = self._touched(data)
        for geom, press in self._presses.items():
            if geom in touched:
                # copies, since MuJoCo's own arrays will move on
                position, rotation = data.geom_xpos[geom].copy(), data.geom_xmat[geom].reshape(3, 3).copy()
                loads[geom], pressed = press.press(touched[geom], position, rotation, self._timestep, elapsed)
                self._pressed.append(pressed)
            else:
                loads[geom] = press.release(elapsed)
        return loads

    def _touched(self, data: mujoco.MjData) -> dict[int, Contacts]:
        """What presses on each target."""
        if self._shells is None:
            return pressing_contacts(self._model, data, self._is_target, self._extents)
        geoms = self._shells.geoms(data)
        touched = pressing_contacts(self._model, data, self._is_target, self._extents, geoms)
        return touched | self._shells.pressing(data, geoms, self._extents)

    @property
    def impulses(self) -> list[Impulse]:
        """What was given in the latest step, one record for each pair."""
        if self._impulses is None:
            self._impulses = [impulse for pressed in self._pressed for impulse in self._given(pressed)]
        return self._impulses

    @property
    def touches(self) -> list[Touch]:
        """What touched in the latest step."""
        return [touch for pressed in self._pressed for touch in _touches(pressed)]

    def _given(self, pressed: Pressed) -> Iterator[Impulse]:
        target = pressed.contacts.target
        geom, n = self._names[target], self._waves[target].atlas.resolution
        points, texels = pressed.in_world()
        for other, point, force, texel in zip(
            pressed.contacts.others.tolist(), points, pressed.patches.forces.tolist(), texels.tolist(), strict=True
        ):
            place = (texel // (n * n), texel // n % n, texel % n)
            yield Impulse(geom=geom, other=self._names[other], point=point, impulse=force * self._timestep, texel=place)


def _touches(pressed: Pressed) -> Iterator[Touch]:
    contacts, pressure = pressed.contacts, pressed.pressure
    for i, other in enumerate(contacts.others.tolist()):
        rows = slice(*contacts.begins[i : i + 2].tolist())
        forces = contacts.forces[rows]
        point, normal = forces @ contacts.points[rows] / forces.sum(), forces @ contacts.normals[rows]
        texels = slice(*pressure.begins[i : i + 2].tolist())
        load = Load(pressure.texels[texels], pressure.forces[texels])
        yield Touch(contacts.target, other, point, normal / np.linalg.norm(normal), load)
