"""From the contacts on one target to the load on its texels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.contacts.target_contacts import TargetContacts
from ripple_sim.coupling.patches.contact_patches import LoadPoints, Patches, find_load_points, find_patches
from ripple_sim.coupling.patches.pose import Pose
from ripple_sim.solver import Load, WaveSolver
from ripple_sim.solver.kernel import Floats, Ints, kernel
from ripple_sim.solver.texels.distance import distance_scratch
from ripple_sim.solver.texels.texel_mesh import TexelGrid
from ripple_sim.solver.waves.load import slot_scratch

from .contact_record import ContactRecord
from .contact_state import CONTACT_STATE
from .footprint_cache import EMPTY_CACHE, FootprintCache, rebuild, reusable
from .rest_filter import rest_filter
from .texel_forces import NO_FORCES, NO_SHARES, MeanShares, texel_forces


class _State(NamedTuple):
    """What a step leaves to the next one; `over` where all geoms have left, and there is no deficit."""

    cache: FootprintCache
    geoms: np.ndarray
    mean: MeanShares
    over: bool


class _Texels(NamedTuple):
    """A target's texels: grid, area that loads move [m^2], [C n n], and scratch buffers for distances and slots."""

    grid: TexelGrid
    movable_area: Floats
    distance_scratch: Floats
    slot_scratch: Ints


class TargetLoad:
    """The load of all geoms on one target, step by step.

    Parameters
    ----------
    waves : WaveSolver
        Of the target.
    radii : float64 [ngeom]
        Footprint radius of each geom [m]: of a pair the smaller one counts.
    convex : bool [ngeom]
        Whether a geom that touches at two points touches between them too.
    """

    def __init__(self, waves: WaveSolver, radii: NDArray[np.float64], convex: NDArray[np.bool_]) -> None:
        self._atlas, self._grid, self._radii, self._convex = waves.atlas, waves.atlas.texels.grid, radii, convex
        self._state = _State(EMPTY_CACHE, np.zeros(len(radii), CONTACT_STATE), NO_SHARES, True)
        self._open = not waves.atlas.mesh.closed
        self.set_waves(waves)

    def set_waves(self, waves: WaveSolver) -> None:
        """Go on with new waves on the same atlas; deficits stay."""
        self._movable_area = (waves.atlas.areas * waves.operator.movable).reshape(-1)
        self._state = self._state._replace(cache=EMPTY_CACHE)
        # texels that carry no load any more are forgotten at the next touch
        self._state.geoms["memory"] = 0.0

    def touched(
        self, contacts: TargetContacts, pose: Pose, timestep: float, elapsed: float
    ) -> tuple[Load, ContactRecord]:
        """Load over a time in which geoms touch, and the record of their contacts.

        Parameters
        ----------
        contacts : TargetContacts
        pose : Pose
            Of the target.
        timestep, elapsed : float
            How long the contacts' forces were held, and over which time their impulse is given [s].
        """
        patches = find_patches(contacts, pose, self._radii, self._convex)
        surface, texels = self._atlas.nearest(patches.points)
        points, rows, lost = _load_points(self._state, patches, surface, texels, timestep / elapsed)
        if len(lost):
            points.places[lost], points.texels[lost] = self._atlas.nearest(points.points[lost])
        if self._open:
            points.forces[:] *= np.repeat(
                _sides(contacts, pose, patches, self._grid.normals[texels]), np.diff(points.begins)
            )
        size = len(self._movable_area)
        mine = _Texels(self._grid, self._movable_area, distance_scratch(size), slot_scratch(size))
        self._state, given = _load(self._state, patches, points, rows, mine, elapsed)
        record = ContactRecord(contacts, pose, patches, surface, texels, points, self._state.cache)
        return Load(self._state.mean.texels, given), record

    def untouched(self, elapsed: float) -> Load:
        """Load over a time [s] in which no geom touches."""
        if self._state.over:
            return Load.none()
        state, scratch = self._state, slot_scratch(len(self._movable_area))
        mean, given, over = rest_filter(state.geoms, state.mean, NO_FORCES, elapsed, scratch)
        self._state = state._replace(mean=mean, over=over)
        return Load(mean.texels, given)


def _sides(contacts: TargetContacts, pose: Pose, patches: Patches, normals: Floats) -> Floats:
    """Side from which each geom touches, [p]: 1 outside, -1 inside; the surface's normals are those at its patches."""
    towards = np.add.reduceat(np.abs(contacts.forces)[:, None] * contacts.normals, contacts.begins[:-1]) @ pose.rotation
    return np.where((towards * normals[patches.begins[:-1]]).sum(axis=1) < 0, -1.0, 1.0)


@kernel
def _load_points(
    state: _State, patches: Patches, surface: Floats, texels: Ints, share: float
) -> tuple[LoadPoints, Ints, Ints]:
    """Load points, the footprints that serve them again, and load points whose places are still to be found."""
    points = find_load_points(patches, surface, texels, share)
    rows, lost = reusable(state.cache, points, state.geoms)
    return points, rows, lost


@kernel
def _load(
    state: _State, patches: Patches, points: LoadPoints, rows: Ints, texels: _Texels, dt: float
) -> tuple[_State, Floats]:
    """State after a step, and forces given to its texels [N]."""
    cache = rebuild(state.cache, points, rows, texels.grid, texels.movable_area, texels.distance_scratch)
    forces = texel_forces(patches, points, cache)
    mean, given, over = rest_filter(state.geoms, state.mean, forces, dt, texels.slot_scratch)
    return _State(cache, state.geoms, mean, over), given
