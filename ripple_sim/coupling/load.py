"""From the contacts on one target to the load on its texels."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas, Load, WaveSolver
from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel
from ripple_sim.solver.texels.chart_map import nearest_place, nearest_places
from ripple_sim.solver.texels.distance import distance_scratch
from ripple_sim.solver.texels.texel_mesh import TexelGrid
from ripple_sim.solver.waves.load import slot_scratch

from .contact_record import ContactRecord, Touches
from .contact_state import CONTACT_STATE
from .contacts import TargetContacts
from .footprints import EMPTY_CACHE, FootprintCache, rebuild, reusable
from .patches import LoadPoints, Patches, find_load_points, find_patches
from .pose import Pose, in_world
from .rest_filter import rest_filter
from .texel_forces import NO_FORCES, NO_SHARES, MeanShares, texel_forces


class _State(NamedTuple):
    """What a step leaves to the next one; `over` where all geoms have left, and there is no deficit."""

    cache: FootprintCache
    geoms: np.ndarray
    mean: MeanShares
    over: bool


class _Target(NamedTuple):
    """What stays the same from step to step: see `TargetLoad`, and `Atlas.places` for `surface`."""

    surface: Any
    grid: TexelGrid
    movable_area: Floats  # area that loads move [m^2], [C n n]
    radii: Floats
    convex: Bools
    is_open: bool


class _Scratch(NamedTuple):
    """Buffers that are left clean: see `distance_scratch` and `slot_scratch`."""

    distances: Floats
    slots: Ints


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
        atlas, unmoved = waves.atlas, np.zeros(waves.atlas.areas.size)
        self._atlas = atlas
        self._target = _Target(atlas.places, atlas.texels.grid, unmoved, radii, convex, not atlas.mesh.closed)
        self._state = _State(EMPTY_CACHE, np.zeros(len(radii), CONTACT_STATE), NO_SHARES, True)
        self.set_waves(waves)

    def set_waves(self, waves: WaveSolver) -> None:
        """Go on with new waves on the same atlas; deficits stay."""
        self._movable = waves.operator.movable.reshape(-1)
        self._target = self._target._replace(movable_area=waves.atlas.areas.reshape(-1) * self._movable)
        self._state = self._state._replace(cache=EMPTY_CACHE)
        # texels that carry no load any more are forgotten at the next touch
        self._state.geoms["memory"] = 0.0

    def follow(self, atlas: Atlas) -> None:
        """Go on where the surface is now, if it has moved."""
        if atlas is not self._atlas:
            self._atlas = atlas
            old, new = self._target.grid.positions, atlas.texels.grid
            cache, area = self._state.cache, new.areas * self._movable
            self._target = self._target._replace(surface=atlas.places, grid=new, movable_area=area)
            # footprints ride on their texels
            under = cache.texels[cache.begins[:-1]]
            points = cache.points + new.positions[under] - old[under]
            self._state = self._state._replace(cache=cache._replace(points=points))

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
        self._state, given, touches = _touched(
            self._state, contacts, pose, self._target, self._scratch(), timestep, elapsed
        )
        return Load(self._state.mean.texels, given), ContactRecord(contacts, pose, touches)

    def untouched(self, elapsed: float) -> Load:
        """Load over a time [s] in which no geom touches."""
        if self._state.over:
            return Load.none()
        state = self._state
        mean, given, over = rest_filter(state.geoms, state.mean, NO_FORCES, elapsed, self._scratch().slots)
        self._state = state._replace(mean=mean, over=over)
        return Load(mean.texels, given)

    def _scratch(self) -> _Scratch:
        size = len(self._target.movable_area)
        return _Scratch(distance_scratch(size), slot_scratch(size))


@kernel
def _touched(
    state: _State,
    contacts: TargetContacts,
    pose: Pose,
    target: _Target,
    scratch: _Scratch,
    timestep: float,
    elapsed: float,
) -> tuple[_State, Floats, Touches]:
    """State after a step, forces given to its texels [N], and what is told of the touches.

    One kernel from contacts to forces: a call from Python costs as much as all that one of its parts does.
    """
    patches = find_patches(contacts, pose, target.radii, target.convex)
    places, texels = nearest_places(target.surface, patches.points)
    points = find_load_points(patches, places, texels, timestep / elapsed)
    rows, lost = reusable(state.cache, points, state.geoms)
    for k in range(len(lost)):
        i = lost[k]
        x, y, z = points.points[i, 0], points.points[i, 1], points.points[i, 2]
        x, y, z, points.texels[i] = nearest_place(target.surface, x, y, z)
        points.places[i, 0], points.places[i, 1], points.places[i, 2] = x, y, z
    middles, under = _at_middles(patches, places, texels)
    inner = _from_inside(contacts, pose, target, under)
    _turn_outwards(points, inner)
    cache = rebuild(state.cache, points, rows, target.grid, target.movable_area, scratch.distances)
    forces = texel_forces(patches, points, cache)
    mean, given, over = rest_filter(state.geoms, state.mean, forces, elapsed, scratch.slots)
    touches = Touches(
        in_world(middles, pose), patches.forces, under, inner, forces.begins, forces.texels, forces.forces
    )
    return _State(cache, state.geoms, mean, over), given, touches


@kernel
def _at_middles(patches: Patches, places: Floats, texels: Ints) -> tuple[Floats, Ints]:
    """Surface points [m], [p, 3], nearest to the middles of the patches, and the texels there, [p]."""
    count = len(patches.geoms)
    middles, under = np.empty((count, 3)), np.empty(count, np.int64)
    for i in range(count):
        under[i] = texels[patches.begins[i]]
        for k in range(3):
            middles[i, k] = places[patches.begins[i], k]
    return middles, under


@kernel
def _from_inside(contacts: TargetContacts, pose: Pose, target: _Target, under: Ints) -> Bools:
    """Whether each geom touches an open surface from inside, [p]; `under` are the texels at their middles."""
    inside = np.zeros(len(contacts.others), np.bool_)
    if not target.is_open:
        return inside
    for i in range(len(inside)):
        along = 0.0
        for row in range(contacts.begins[i], contacts.begins[i + 1]):
            for k in range(3):
                normal = 0.0
                for j in range(3):
                    normal += contacts.normals[row, j] * pose.rotation[j, k]
                along += abs(contacts.forces[row]) * normal * target.grid.normals[under[i], k]
        inside[i] = along < 0
    return inside


@kernel
def _turn_outwards(points: LoadPoints, inner: Bools) -> None:
    """Let what touches from inside push outwards."""
    for i in range(len(inner)):
        if inner[i]:
            for j in range(points.begins[i], points.begins[i + 1]):
                points.forces[j] *= -1.0
