"""Marks of contacts with the targets, which stay long enough to be seen."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.coupling.soft import target_pose
from ripple_sim.simulation import Simulation

# Time in which a mark fades to 1/e [s]: a mark shows the impulse of about this time.
MEMORY = 0.25

# Shares of a mark's largest impulse at which it begins to fade, and at which it disappears.
_FADING = 0.35
_FADED = 0.08

# Distance, over the size of the target, within which two contacts are one contact that moves.
_SAME_PLACE = 0.05


@dataclasses.dataclass(frozen=True, eq=False)
class Mark:
    """A contact.

    Attributes
    ----------
    point : float64 [3]
        On the rippled surface, in the world [m].
    axis : float64 [3]
        Outward normal of the surface at the point; the contact presses against it.
    impulse : float
        Sum of the impulses so far [N s], each with the weight exp(-age / MEMORY).
    opacity : float
        From 1 to 0 as the mark fades.
    """

    point: NDArray[np.float64]
    axis: NDArray[np.float64]
    impulse: float
    opacity: float = 1.0


@dataclasses.dataclass(eq=False)
class _Contact:
    """A contact that is followed: names of the target and of the other geom, place and impulse."""

    geom: str
    other: str
    place: NDArray[np.float64]  # on the surface without waves, in the geom's frame [m]
    texel: tuple[int, int, int]
    impulse: float = 0.0  # [N s]
    largest: float = 0.0  # value of `impulse` so far [N s]


class ContactMarks:
    """Gathers the impulses of a running simulation.

    Parameters
    ----------
    dt : float
        Time between frames [s].
    """

    def __init__(self, simulation: Simulation, dt: float) -> None:
        self._simulation = simulation
        self._fade = math.exp(-dt / MEMORY)  # from frame to frame
        self._contacts: list[_Contact] = []
        # distance within which two contacts are one [m], by target
        self._near: dict[str, float] = {}
        for name in simulation.ripples:
            size = float(np.ptp(simulation.ripples[name].atlas.mesh.V, axis=0).max())
            self._near[name] = _SAME_PLACE * size

    def follow(self) -> list[Mark]:
        """Take in the present frame of the simulation; return the marks, the weakest first."""
        for contact in self._contacts:
            contact.impulse *= self._fade
        for impulse in self._simulation.impulses:
            self._add(impulse)
        self._contacts = [
            contact for contact in self._contacts if contact.impulse > _FADED * contact.largest
        ]
        targets = {contact.geom for contact in self._contacts}
        heights = {name: self._simulation.ripples[name].height for name in sorted(targets)}
        by_impulse = sorted(self._contacts, key=lambda contact: contact.impulse)
        return [self._mark(contact, heights[contact.geom]) for contact in by_impulse]

    def _mark(self, contact: _Contact, heights: NDArray[np.float32]) -> Mark:
        """The mark of a contact on a target with heights [C, n, n] [m]."""
        position, rotation = self._pose(contact.geom)
        waves = self._simulation.ripples[contact.geom]
        normal = waves.atlas.normals[contact.texel]
        height = float(heights[contact.texel])
        place = contact.place
        if waves.vertices is not None:  # the mesh has moved since the contact
            place = waves.atlas.positions[contact.texel]
        opacity = min((contact.impulse / contact.largest - _FADED) / (_FADING - _FADED), 1.0)
        point = position + rotation @ (place + height * normal)
        return Mark(point, axis=rotation @ normal, impulse=contact.impulse, opacity=opacity)

    def _add(self, hit: Impulse) -> None:
        """Add an impulse to the contact that it belongs to, or begin a new contact."""
        if hit.impulse <= 0:
            return
        position, rotation = self._pose(hit.geom)
        atlas = self._simulation.ripples[hit.geom].atlas
        # a fast target has moved since the contact
        place = atlas.project((hit.point - position) @ rotation)[0][0]
        for contact in self._contacts:
            same = (contact.geom, contact.other) == (hit.geom, hit.other)
            if same and np.linalg.norm(contact.place - place) < self._near[hit.geom]:
                break
        else:
            contact = _Contact(hit.geom, hit.other, place, hit.texel)
            self._contacts.append(contact)
        contact.place = place
        contact.texel = hit.texel
        contact.impulse += hit.impulse
        contact.largest = max(contact.largest, contact.impulse)

    def _pose(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return target_pose(self._simulation.data, self._simulation.ripples.geom_ids[name])
