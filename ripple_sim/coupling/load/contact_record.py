"""What the contacts of a step did, kept for those who ask: impulses for the user, touches for two-way coupling."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.contacts.target_contacts import TargetContacts
from ripple_sim.coupling.patches.contact_patches import LoadPoints, Patches
from ripple_sim.coupling.patches.pose import Pose, in_world
from ripple_sim.solver import Atlas, Load
from ripple_sim.solver.kernel import Floats, Ints

from .footprint_cache import FootprintCache
from .texel_forces import texel_forces


@dataclasses.dataclass(frozen=True, eq=False)
class Impulse:
    """The impulse that one geom gave to one target in one physics step.

    Attributes
    ----------
    geom, other : str
        Names of the target and of the geom or flex that touches it.
    point : float64 [3]
        Force-weighted contact point on the target's true surface, in the world [m].
    impulse : float
        Sum of normal force times time step [N s]; it pushes inwards, or is negative where something sticks and pulls.
        Through a flex collider, of the whole force along the surface's normal.
    texel : tuple of int
        Chart, row and column of the texel nearest to the point.
    inner : bool
        Whether the inner side of an open surface was touched: then it pushes outwards.
    """

    geom: str
    other: str
    point: NDArray[np.float64]
    impulse: float
    texel: tuple[int, int, int]
    inner: bool = False


@dataclasses.dataclass(frozen=True, eq=False)
class Touch:
    """A target and a geom that touches it.

    Attributes
    ----------
    target, other : int
        Geom id, and collider id, see `CoupledModel`.
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


class ContactRecord(NamedTuple):
    """The contacts on one target in a step, with their forces before the rest filter.

    Attributes
    ----------
    contacts : TargetContacts
    pose : Pose
        Of the target.
    patches : Patches
    surface, texels : float64 [m, 3], int64 [m]
        Surface points nearest to those of the patches [m], and flat indices of the texels nearest to them.
    points : LoadPoints
    cache : FootprintCache
        With the footprints of the points first.
    """

    contacts: TargetContacts
    pose: Pose
    patches: Patches
    surface: Floats
    texels: Ints
    points: LoadPoints
    cache: FootprintCache

    def impulses(self, names: Sequence[str], owners: Ints, atlas: Atlas, timestep: float) -> Iterator[Impulse]:
        """One record for each geom or flex that touches.

        Parameters
        ----------
        names, owners
            See `CoupledModel`.
        atlas : Atlas
            Of the target.
        timestep : float
            How long the forces were held [s].
        """
        middles, forces = self.patches.begins[:-1], self.patches.forces
        inner = self.points.forces[self.points.begins[:-1]] * forces < 0
        places, texels, mine = self.surface[middles], self.texels[middles], owners[self.patches.geoms]
        # the last ids are those of a flex's vertices, which touch for themselves and are told of together
        if mine[-1] != self.patches.geoms[-1]:
            first = np.flatnonzero(np.diff(mine, prepend=-1))
            weighted = np.add.reduceat(forces[:, None] * places, first)
            forces, mine, inner = np.add.reduceat(forces, first), mine[first], inner[first]
            places, texels = atlas.nearest(weighted / forces[:, None])
        points, n, geom = in_world(places, self.pose), atlas.areas.shape[1], names[self.contacts.target]
        rows = zip(mine.tolist(), points, forces.tolist(), texels.tolist(), inner.tolist(), strict=True)
        for other, point, force, texel, behind in rows:
            row = texel // n
            yield Impulse(geom, names[other], point, force * timestep, (row // n, row % n, texel % n), behind)

    def touches(self) -> Iterator[Touch]:
        """One record for each geom that touches."""
        contacts, forces = self.contacts, texel_forces(self.patches, self.points, self.cache)
        for i, other in enumerate(contacts.others.tolist()):
            rows = slice(*contacts.begins[i : i + 2].tolist())
            of_contacts = np.abs(contacts.forces[rows])
            point = of_contacts @ contacts.points[rows] / of_contacts.sum()
            normal = of_contacts @ contacts.normals[rows]
            at = slice(*forces.begins[i : i + 2].tolist())
            load = Load(forces.texels[at], forces.forces[at])
            yield Touch(contacts.target, other, point, normal / np.linalg.norm(normal), load)
