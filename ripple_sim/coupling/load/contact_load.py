"""From the contacts on one target to the load on its texels."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.contacts.geom_contacts import Contacts
from ripple_sim.coupling.patches.contact_patches import Patches, find_patches, find_spots
from ripple_sim.solver import Load, WaveSolver
from ripple_sim.solver.texels.distance import distance_scratch
from ripple_sim.solver.waves.load import slot_scratch

from .footprint_cache import NO_FOOTPRINTS, Footprints, lay, used_before
from .low_pass import BODY, NO_PRESSURE, NOTHING_FELT, Felt, Pressure, follow


@dataclasses.dataclass(frozen=True, eq=False)
class Pressed:
    """How bodies press on a target in a step, before that is smoothed.

    Attributes
    ----------
    contacts : Contacts
    position, rotation : float64 [3], [3, 3]
        From the target's frame to the world, [m].
    patches : Patches
    surface, texels : float64 [m, 3], int64 [m]
        Surface points nearest to those of the patches [m], and flat indices of the texels nearest to them.
    pressure : Pressure
    """

    contacts: Contacts
    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    patches: Patches
    surface: NDArray[np.float64]
    texels: NDArray[np.int64]
    pressure: Pressure

    def in_world(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Surface points nearest to the force-weighted middle of each body's contacts [m], and their texels."""
        return _in_world(self.position, self.rotation, self.patches, self.surface, self.texels)


class _State(NamedTuple):
    """What a step leaves to the next one; `over` where all bodies have left, and nothing is owed."""

    known: Footprints
    bodies: NDArray[np.void]
    felt: Felt
    over: bool


class Press:
    """The pressure of all bodies on one target.

    Parameters
    ----------
    waves : WaveSolver
        Of the target.
    radii : float64 [ngeom]
        Footprint radius of each geom [m]: the smaller one of a pair counts.
    convex : bool [ngeom]
        Whether a geom touches also between its contacts.
    """

    def __init__(self, waves: WaveSolver, radii: NDArray[np.float64], convex: NDArray[np.bool_]) -> None:
        self._atlas, self._grid, self._radii, self._convex = waves.atlas, waves.atlas.texels.grid, radii, convex
        self._state = _State(NO_FOOTPRINTS, np.zeros(len(radii), BODY), NOTHING_FELT, True)
        self.renew(waves)

    def renew(self, waves: WaveSolver) -> None:
        """Go on with the new waves of the target: what is owed stays owed."""
        self._movable_area = (waves.atlas.areas * waves.operator.movable).reshape(-1)
        self._state = self._state._replace(known=NO_FOOTPRINTS)

    def press(
        self,
        contacts: Contacts,
        position: NDArray[np.float64],
        rotation: NDArray[np.float64],
        timestep: float,
        elapsed: float,
    ) -> tuple[Load, Pressed]:
        """Load over a time in which bodies touch, and how they pressed.

        Parameters
        ----------
        contacts : Contacts
        position : float64 [3]
            Of the target in the world [m].
        rotation : float64 [3, 3]
            From the target's frame to the world.
        timestep, elapsed : float
            How long the contacts' forces were held, and over which time their impulse is given [s].
        """
        patches = find_patches(contacts, position, rotation, self._radii, self._convex)
        surface, texels = self._atlas.nearest(patches.points)
        spots, rows, lost = _stand(self._state, contacts.others, patches, surface, texels, timestep / elapsed)
        if len(lost):
            spots.places[lost], spots.texels[lost] = self._atlas.nearest(spots.points[lost])
        size = len(self._movable_area)
        self._state, given, pressure = _press(
            self._state,
            contacts.others,
            patches,
            spots,
            rows,
            self._grid,
            self._movable_area,
            elapsed,
            distance_scratch(size),
            slot_scratch(size),
        )
        pressed = Pressed(contacts, position, rotation, patches, surface, texels, pressure)
        return Load(self._state.felt.texels, given), pressed

    def release(self, elapsed: float) -> Load:
        """Load over a time in which no body touches."""
        if self._state.over:
            return Load.none()
        self._state, given = _release(self._state, elapsed, slot_scratch(len(self._movable_area)))
        return Load(self._state.felt.texels, given)


@numba.njit(cache=True, nogil=True)
def _stand(state, others, patches, surface, texels, share):
    """Spots at which bodies press, the known footprints that serve them, and spots whose places are to be found."""
    spots = find_spots(others, patches, surface, texels, share)
    rows, lost = used_before(state.known, spots, state.bodies)
    return spots, rows, lost


@numba.njit(cache=True, nogil=True)
def _press(state, others, patches, spots, rows, grid, carried, dt, distance_scratch, texel_scratch):
    """State after a step, forces on the texels that are felt then, and the pressure before that is smoothed."""
    known = lay(state.known, spots, rows, grid, carried, distance_scratch)
    pressure = _pressure(others, patches, spots, known)
    felt, given, over = follow(state.bodies, state.felt, pressure, dt, texel_scratch)
    return _State(known, state.bodies, felt, over), given, pressure


@numba.njit(cache=True, nogil=True)
def _release(state, dt, texel_scratch):
    felt, given, over = follow(state.bodies, state.felt, NO_PRESSURE, dt, texel_scratch)
    return _State(state.known, state.bodies, felt, over), given


@numba.njit(cache=True, nogil=True)
def _pressure(others, patches, spots, footprints):
    """Forces on texels; the first footprints are those of the spots."""
    bodies, count = len(others), footprints.begins[len(spots.forces)]
    middles, reaches, begins = np.empty((bodies, 3)), np.empty(bodies), np.zeros(bodies + 1, np.int64)
    forces = np.empty(count)
    for i in range(bodies):
        middles[i] = patches.points[patches.begins[i]]
        reaches[i] = spots.radii[spots.begins[i]] / 2
        begins[i + 1] = footprints.begins[spots.begins[i + 1]]
        for spot in range(spots.begins[i], spots.begins[i + 1]):
            for j in range(footprints.begins[spot], footprints.begins[spot + 1]):
                forces[j] = spots.forces[spot] * footprints.shares[j]
    return Pressure(others, middles, reaches, begins, footprints.texels[:count], forces)


@numba.njit(cache=True, nogil=True)
def _in_world(position, rotation, patches, surface, texels):
    bodies = len(patches.forces)
    points, nearest = np.empty((bodies, 3)), np.empty(bodies, np.int64)
    for i in range(bodies):
        middle = patches.begins[i]
        nearest[i] = texels[middle]
        for k in range(3):
            across = 0.0
            for j in range(3):
                across += rotation[k, j] * surface[middle, j]
            points[i, k] = position[k] + across
    return points, nearest
