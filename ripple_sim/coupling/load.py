"""From the contacts on one target to the load on its texels.

What the contacts of a step did, kept for those who ask: impulses for the user, touches for two-way coupling.

From the contacts of a physics step to loads on the texels of all targets.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas, Load, WaveSolver
from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel
from ripple_sim.solver.texels.chart_map import nearest_place, nearest_places
from ripple_sim.solver.texels.distance import distance_scratch
from ripple_sim.solver.texels.texel_mesh import TexelGrid
from ripple_sim.solver.waves.load import slot_scratch

from .contact_reader import ContactReader
from .contacts import TargetContacts
from .footprints import EMPTY_CACHE, NO_FORCES, NO_SHARES, FootprintCache, MeanShares, rebuild, reusable, texel_forces
from .model import CoupledModel, SleepingContacts, at_rest
from .patches import LoadPoints, Patches, Pose, find_load_points, find_patches, in_frame, in_world
from .rest_filter import CONTACT_STATE, rest_filter
from .soft import target_pose


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


class ContactLoads:
    """The loads of all contacts, target by target and step by step.

    Parameters
    ----------
    coupled : CoupledModel
    waves : mapping
        Geom id of every target to its waves. Looked at again by `waves_changed` and `clear`.
    """

    def __init__(self, coupled: CoupledModel, waves: Mapping[int, WaveSolver]) -> None:
        self._coupled, self._waves = coupled, waves
        self._contacts = ContactReader(coupled, {geom: each.atlas for geom, each in waves.items()})
        self.clear()

    def clear(self) -> None:
        """Forget all contacts."""
        self._sleeping, self._begins = SleepingContacts(self._coupled), True
        self._targets = {
            geom: TargetLoad(waves, self._coupled.footprint_radii, self._convex(geom))
            for geom, waves in self._waves.items()
        }
        self.skip()

    def skip(self) -> None:
        """Forget the latest steps: nothing was given since."""
        self._records: list[ContactRecord] = []
        self._touching: list[ContactRecord] = []
        self._impulses: list[Impulse] | None = None

    def waves_changed(self, geom: int) -> None:
        """Go on with the new waves of a target."""
        self._targets[geom].set_waves(self._waves[geom])

    def loads(self, data: mujoco.MjData, elapsed: float) -> dict[int, Load]:
        """Load on each target over a time [s], from the contact forces that MuJoCo held over its latest time step.

        Bodies that sleep press as before.
        """
        loads = {}
        self._impulses, self._touching = None, []
        self._timestep = self._coupled.model.opt.timestep
        if self._begins:
            # bodies that sleep already never touched before our eyes
            self._begins, resting = False, at_rest(self._coupled.model, data)
            if resting is not None:
                self._sleeping.add(data, self._contacts.read(resting))
        contacts = self._sleeping.add(data, self._contacts.read(data))
        for geom, target in self._targets.items():
            if geom in contacts:
                target.follow(self._waves[geom].atlas)
                pose = Pose(*target_pose(data, geom))
                loads[geom], record = target.touched(contacts[geom], pose, self._timestep, elapsed)
                self._records.append(record)
                self._touching.append(record)
            else:
                loads[geom] = target.untouched(elapsed)
        return loads

    def _convex(self, target: int) -> NDArray[np.bool_]:
        """Colliders that touch between the points where they touch: a flex has a contact at each of its vertices."""
        convex = self._coupled.convex
        return np.zeros_like(convex) if target in self._coupled.soft else convex

    @property
    def impulses(self) -> list[Impulse]:
        """The impulses given since `skip`, one record for each pair and step."""
        if self._impulses is None:
            self._impulses = [
                impulse
                for record in self._records
                for impulse in record.impulses(
                    self._coupled.names,
                    self._coupled.owners,
                    self._waves[record.contacts.target].atlas,
                    self._timestep,
                )
            ]
        return self._impulses

    @property
    def touches(self) -> list[Touch]:
        """The pairs that touched in the latest step."""
        return [touch for record in self._touching for touch in record.touches()]
