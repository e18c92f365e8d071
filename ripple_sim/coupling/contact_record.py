"""What the contacts of a step did, kept for those who ask: impulses for the user, touches for two-way coupling."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas, Load
from ripple_sim.solver.kernel import Bools, Floats, Ints

from .contacts import TargetContacts
from .pose import Pose, in_frame, in_world


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


class Touches(NamedTuple):
    """What is told of the geoms that touch a target in a step, before the rest filter.

    Attributes
    ----------
    points : float64 [p, 3]
        Surface points nearest to the middles of their contacts, in the world [m].
    pushes : float64 [p]
        Their normal forces [N].
    texels : int64 [p]
        Flat indices of the texels nearest to the points.
    inner : bool [p]
        Whether the inner side of an open surface is touched.
    begins : int64 [p + 1]
        The texels under geom i are those from begins[i] to begins[i + 1].
    under : int64 [k]
        Flat texel indices.
    forces : float64 [k]
        On them [N].
    """

    points: Floats
    pushes: Floats
    texels: Ints
    inner: Bools
    begins: Ints
    under: Ints
    forces: Floats


class ContactRecord(NamedTuple):
    """The contacts on one target in a step, the target's pose, and its touches."""

    contacts: TargetContacts
    pose: Pose
    told: Touches

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
        points, forces, texels, inner = self.told[:4]
        n, geom, others = atlas.areas.shape[1], names[owners[self.contacts.target]], owners[self.contacts.others]
        # the last ids are those of a flex's vertices, which touch for themselves and are told of together
        if others[-1] != self.contacts.others[-1]:
            first = np.flatnonzero(np.diff(others, prepend=-1))
            weighted = np.add.reduceat(forces[:, None] * in_frame(points, self.pose), first)
            forces, others, inner = np.add.reduceat(forces, first), others[first], inner[first]
            places, texels = atlas.nearest(weighted / forces[:, None])
            points = in_world(places, self.pose)
        rows = zip(others.tolist(), points, forces.tolist(), texels.tolist(), inner.tolist(), strict=True)
        for other, point, force, texel, behind in rows:
            row = texel // n
            yield Impulse(geom, names[other], point, force * timestep, (row // n, row % n, texel % n), behind)

    def touches(self) -> Iterator[Touch]:
        """One record for each geom that touches."""
        contacts, told = self.contacts, self.told
        for i, other in enumerate(contacts.others.tolist()):
            rows = slice(*contacts.begins[i : i + 2].tolist())
            of_contacts = np.abs(contacts.forces[rows])
            point = of_contacts @ contacts.points[rows] / of_contacts.sum()
            normal = of_contacts @ contacts.normals[rows]
            at = slice(*told.begins[i : i + 2].tolist())
            load = Load(told.under[at], told.forces[at])
            yield Touch(contacts.target, other, point, normal / np.linalg.norm(normal), load)
