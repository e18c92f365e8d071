"""Marks of contacts with the targets and their impulses, which stay long enough to be seen."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.coupling.soft_ids import target_pose
from ripple_sim.simulation import Simulation

MEMORY = 0.25  # time in which a mark fades to 1/e [s]; it holds the impulse of about this time
_FADING, _FADED = 0.35, 0.08  # shares of its largest impulse at which a mark begins to fade, and disappears
_SAME_PLACE = 0.05  # contacts closer than this share of the target's size are one moving contact


@dataclasses.dataclass(frozen=True, eq=False)
class Mark:
    """A contact.

    Attributes
    ----------
    point : float64 [3]
        On the rippled surface, in the world [m].
    axis : float64 [3]
        The surface's outward normal there, against which the contact presses.
    impulse : float
        [N s], with the weight exp(-age / MEMORY).
    opacity : float
        From 1 to 0 as the mark fades.
    """

    point: NDArray[np.float64]
    axis: NDArray[np.float64]
    impulse: float
    opacity: float = 1.0


@dataclasses.dataclass(eq=False)
class _Contact:
    geom: str
    other: str
    place: NDArray[np.float64]  # on the undeformed surface, in the geom's frame [m]
    texel: tuple[int, int, int]
    impulse: float = 0.0
    largest: float = 0.0


class ContactMarks:
    """Gathers the impulses of a running simulation.

    Parameters
    ----------
    simulation : Simulation
    dt : float
        Time between frames [s].
    """

    def __init__(self, simulation: Simulation, dt: float) -> None:
        self._simulation = simulation
        self._fade = math.exp(-dt / MEMORY)
        self._contacts: list[_Contact] = []
        ripples = simulation.ripples
        self._near = {name: _SAME_PLACE * float(np.ptp(ripples[name].atlas.mesh.V, axis=0).max()) for name in ripples}

    def follow(self) -> list[Mark]:
        """Take in the simulation's present frame; return the marks to draw, the weakest first."""
        for contact in self._contacts:
            contact.impulse *= self._fade
        for impulse in self._simulation.impulses:
            self._add(impulse)
        self._contacts = [contact for contact in self._contacts if contact.impulse > _FADED * contact.largest]
        touched = {contact.geom for contact in self._contacts}
        heights = {name: self._simulation.ripples[name].height for name in sorted(touched)}
        weakest_first = sorted(self._contacts, key=lambda contact: contact.impulse)
        return [self._mark(contact, float(heights[contact.geom][contact.texel])) for contact in weakest_first]

    def _add(self, hit: Impulse) -> None:
        if hit.impulse <= 0:
            return
        position, rotation = self._pose(hit.geom)
        atlas = self._simulation.ripples[hit.geom].atlas
        place = atlas.project((hit.point - position) @ rotation)[0][0]  # a fast target has moved since the contact
        for contact in self._contacts:
            same = (contact.geom, contact.other) == (hit.geom, hit.other)
            if same and np.linalg.norm(contact.place - place) < self._near[hit.geom]:
                break
        else:
            contact = _Contact(hit.geom, hit.other, place, hit.texel)
            self._contacts.append(contact)
        contact.place, contact.texel = place, hit.texel
        contact.impulse += hit.impulse
        contact.largest = max(contact.largest, contact.impulse)

    def _mark(self, contact: _Contact, height: float) -> Mark:
        position, rotation = self._pose(contact.geom)
        waves = self._simulation.ripples[contact.geom]
        normal = waves.atlas.normals[contact.texel]
        place = contact.place if waves.vertices is None else waves.atlas.positions[contact.texel]
        opacity = (contact.impulse / contact.largest - _FADED) / (_FADING - _FADED)
        return Mark(
            point=position + rotation @ (place + height * normal),
            axis=rotation @ normal,
            impulse=contact.impulse,
            opacity=min(opacity, 1.0),
        )

    def _pose(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return target_pose(self._simulation.data, self._simulation.ripples.geom_ids[name])
