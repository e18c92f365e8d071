"""What the contacts of a step did, kept for those who ask: impulses for the user, touches for two-way coupling."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.contacts.target_contacts import TargetContacts
from ripple_sim.coupling.patches.contact_patches import LoadPoints, Patches
from ripple_sim.coupling.patches.pose import Pose, in_world
from ripple_sim.solver import Load
from ripple_sim.solver.kernel import Floats, Ints

from .footprint_cache import FootprintCache
from .texel_forces import texel_forces


@dataclasses.dataclass(frozen=True, eq=False)
class Impulse:
    """The impulse that one geom gave to one target in one physics step.

    Attributes
    ----------
    geom, other : str
        Names of the target and of the geom that touches it.
    point : float64 [3]
        Force-weighted contact point on the target's true surface, in the world [m].
    impulse : float
        Sum of normal force times time step [N s], not negative; it pushes inwards. Through a flex collider, of the
        whole force along the surface's normal.
    texel : tuple of int
        Chart, row and column of the texel nearest to the point.
    """

    geom: str
    other: str
    point: NDArray[np.float64]
    impulse: float
    texel: tuple[int, int, int]


@dataclasses.dataclass(frozen=True, eq=False)
class Touch:
    """A target and a geom that touches it.

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


class ContactRecord(NamedTuple):
    """The contacts on one target in a step, with their forces before the low-pass filter.

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

    def impulses(self, names: list[str], shape: tuple[int, ...], timestep: float) -> Iterator[Impulse]:
        """One record for each geom that touches.

        Parameters
        ----------
        names : list of str
            Of all geoms.
        shape : (C, n, n)
            Of the target's texels.
        timestep : float
            How long the forces were held [s].
        """
        middles = self.patches.begins[:-1]
        points = in_world(self.surface[middles], self.pose)
        geom, forces = names[self.contacts.target], self.patches.forces.tolist()
        texels, n = self.texels[middles].tolist(), shape[1]
        for other, point, force, texel in zip(self.patches.geoms.tolist(), points, forces, texels, strict=True):
            row = texel // n
            yield Impulse(geom, names[other], point, force * timestep, (row // n, row % n, texel % n))

    def touches(self) -> Iterator[Touch]:
        """One record for each geom that touches."""
        contacts, forces = self.contacts, texel_forces(self.patches, self.points, self.cache)
        for i, other in enumerate(contacts.others.tolist()):
            rows = slice(*contacts.begins[i : i + 2].tolist())
            of_contacts = contacts.forces[rows]
            point = of_contacts @ contacts.points[rows] / of_contacts.sum()
            normal = of_contacts @ contacts.normals[rows]
            at = slice(*forces.begins[i : i + 2].tolist())
            load = Load(forces.texels[at], forces.forces[at])
            yield Touch(contacts.target, other, point, normal / np.linalg.norm(normal), load)
