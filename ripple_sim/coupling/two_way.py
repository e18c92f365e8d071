"""Two-way coupling: contact forces that follow from the motion of bodies and surfaces together.

MuJoCo's contact problem knows rigid surfaces alone. `TwoWay` solves it again with surfaces that
give way: a contact's gap counts from the displaced surface, and a unit of the contact's force moves
the surface as the wave solver says. The new forces replace the forces of the step, and correct the
motion of the bodies in the step.

For MuJoCo a body over a risen surface does not touch it. `within_reach` finds such bodies by their
support points. They get the force after which body and surface move alike.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Atlas, Load, WaveSolver
from ripple_sim.solver.kernel import Floats32
from ripple_sim.solver.waves.footprint import footprint, footprint_at

from .collision_geoms import ENDLESS
from .contacts import collider_ids, pair_rows, places_facing, points_outside
from .energy import ContactProblem, Key, Pair, Purse, VelocityChange, Work, affordable_share
from .geoms import TARGET_TYPES
from .ids import GeomId, TargetId, geom_id, is_geom
from .model import CoupledModel
from .patches import MAX_CORNERS, SAME_PLACE
from .sleep import SLEEP, at_rest, sleeping_dofs, wake

_GEOM = mujoco.mjtGeom

# A side or an edge whose slope against the plane is less than this is flat: its middle is the
# support point.
_MAX_FLAT_SLOPE = 0.02

# Rounds of the search for the points of surface and geom that are nearest to each other.
_NEAREST_POINT_ROUNDS = 3


def support_point(
    model: mujoco.MjModel, geom: GeomId, direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Point [m], [3], of a geom that lies farthest in a direction.

    Where a whole side or edge lies farthest, it is the middle of the side or edge.

    Parameters
    ----------
    model : mujoco.MjModel
    geom : GeomId
        A sphere, ellipsoid, capsule, cylinder or box; of a mesh or sdf geom the convex hull counts.
    direction : float64 [3]
        Unit vector in the frame of the geom, as is the result.
    """
    size = model.geom_size[geom]
    match model.geom_type[geom]:
        case _GEOM.mjGEOM_SPHERE:
            return size[0] * direction
        case _GEOM.mjGEOM_ELLIPSOID:
            return size**2 * direction / np.linalg.norm(size * direction)
        case _GEOM.mjGEOM_CAPSULE:
            return size[0] * direction + [0.0, 0.0, size[1] * _side(direction[2])]
        case _GEOM.mjGEOM_CYLINDER:
            across = float(np.hypot(direction[0], direction[1]))
            rim = size[0] * direction[:2] / across if across > _MAX_FLAT_SLOPE else np.zeros(2)
            return np.append(rim, size[1] * _side(direction[2]))
        case _GEOM.mjGEOM_BOX:
            return size * [_side(along) for along in direction]
    mesh = int(model.geom_dataid[geom])
    begin = int(model.mesh_vertadr[mesh])
    count = int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[begin : begin + count]
    heights = vertices @ direction
    farthest = heights > heights.max() - _MAX_FLAT_SLOPE * model.geom_rbound[geom]
    return vertices[farthest].mean(axis=0).astype(np.float64)


def _side(along: float) -> float:
    """Sign of a direction's component along an axis; 0 where the side along the axis is flat."""
    return 0.0 if abs(along) < _MAX_FLAT_SLOPE else float(np.sign(along))


def within_reach(
    coupled: CoupledModel,
    data: mujoco.MjData,
    pair: tuple[GeomId, GeomId],
    waves: WaveSolver,
    height: Floats32,
    highest: float,
) -> tuple[Load, NDArray[np.float64], NDArray[np.float64]] | None:
    """Where the risen surface of a target reaches a geom above it; None where it does not.

    A geom is within reach where its lowest point is less above the undeformed surface than the
    surface has risen there. That point is found by turns: the surface point nearest to the geom's
    point, and the geom's point deepest along the normal there.

    Parameters
    ----------
    coupled : CoupledModel
    data : mujoco.MjData
    pair : (GeomId, GeomId)
        Target and other.
    waves : WaveSolver
        Of the target.
    height : float32 [C n n]
        Of the waves [m].
    highest : float
        The greatest height [m].

    Returns
    -------
    load : Load
        A unit force on the footprint.
    point, normal : float64 [3]
        Of the surface, in the world [m].
    """
    model = coupled.model
    (target, other) = pair
    atlas = waves.atlas
    rotation = data.geom_xmat[target].reshape(3, 3)
    to_target = rotation.T @ data.geom_xmat[other].reshape(3, 3)
    centre = (data.geom_xpos[other] - data.geom_xpos[target]) @ rotation
    reach = float(model.geom_rbound[other]) + highest
    box_centre = model.geom_aabb[target, :3]
    box_size = model.geom_aabb[target, 3:]
    if np.linalg.norm(np.maximum(np.abs(centre - box_centre) - box_size, 0.0)) > reach:
        return None
    point = centre
    for _ in range(_NEAREST_POINT_ROUNDS):
        (place,), (texel,) = atlas.nearest(point)
        if np.linalg.norm(point - place) > reach:
            return None
        normal = atlas.normals.reshape(-1, 3)[texel]
        point = centre + to_target @ support_point(model, other, -normal @ to_target)
    if (point - place) @ normal >= height[texel]:
        return None
    under = footprint(atlas, place, float(coupled.footprint_radii[[target, other]].min()))
    areas = atlas.areas.reshape(-1)[under.texels]
    movable_areas = areas * waves.operator.movable.reshape(-1)[under.texels]
    load = Load(under.texels, under.weights * movable_areas)
    return load, data.geom_xpos[target] + rotation @ place, rotation @ normal


class _Contact(NamedTuple):
    """One of MuJoCo's contacts on a target.

    Attributes
    ----------
    number : int
        Among MuJoCo's contacts.
    point : float64 [3]
        Just outside the surface, in the target's frame [m].
    normal : float64 [3]
        Unit vector from the target to the other geom, in the target's frame.
    """

    number: int
    point: NDArray[np.float64]
    normal: NDArray[np.float64]


class _Reached(NamedTuple):
    """A pair whose risen surface reaches the body, though MuJoCo has no contact there.

    Attributes
    ----------
    key : (TargetId, ColliderId)
        Target and other.
    point, normal : float64 [3]
        Of the surface, in the world [m].
    """

    key: Key
    point: NDArray[np.float64]
    normal: NDArray[np.float64]


class _Place(NamedTuple):
    """Where a pair touches.

    Attributes
    ----------
    atlas : Atlas
        Of the target, where it is now.
    points : float64 [k, 3]
        In the target's frame [m].
    tolerance : float
        How far the points may move before it is another place [m].
    load : Load
        A unit force on the texels, each once.
    moving : float64 [t]
        The part of the load that moves the texels.
    """

    atlas: Atlas
    points: NDArray[np.float64]
    tolerance: float
    load: Load
    moving: NDArray[np.float64]

    def mean(self, field: NDArray) -> float:
        """Mean of a field [C, n, n]; force times mean velocity is the power on the surface."""
        return float(self.moving @ field.reshape(-1)[self.load.texels].astype(np.float64))

    def serves(self, atlas: Atlas, points: NDArray[np.float64]) -> bool:
        """Whether contact points [k, 3] on an atlas [m] are still at this place."""
        if self.atlas is not atlas or self.points.shape != points.shape:
            return False
        return bool(np.abs(self.points - points).max() < self.tolerance)


class _Trials(NamedTuple):
    """Copies of a target's waves to try steps on.

    Attributes
    ----------
    waves : WaveSolver
        The solver that was copied.
    pushed : WaveSolver
        Takes the coming step under the forces of the last one.
    resting : WaveSolver
        Takes a step from rest under unit forces.
    """

    waves: WaveSolver
    pushed: WaveSolver
    resting: WaveSolver

    def suit(self, waves: WaveSolver) -> bool:
        """Whether these are copies of waves as they are now.

        Waves on a surface that has moved have another operator.
        """
        if self.waves is not waves or self.pushed.operator is not waves.operator:
            return False
        return self.pushed.conserve_volume == waves.conserve_volume


class _SurfaceStep(NamedTuple):
    """How a target's surface moves in the coming step under the forces of the last one.

    Attributes
    ----------
    height_before, height_now, height_after : float32 [C, n, n]
        At the beginning of the last step, now, and at the end of the coming step [m].
    velocity_now, velocity_after : float32 [C, n, n]
        [m/s].
    """

    height_before: NDArray[np.float32]
    height_now: NDArray[np.float32]
    height_after: NDArray[np.float32]
    velocity_now: NDArray[np.float32]
    velocity_after: NDArray[np.float32]


class _Mobility(NamedTuple):
    """Velocity inwards that unit forces give the surface under a place, divided by the time step.

    Attributes
    ----------
    at_end : float
        From the velocity at the end of the step [1/kg].
    mean : float
        From the mean velocity over the step [1/kg]; not negative.
    """

    at_end: float
    mean: float


class _KnownMobilities(NamedTuple):
    """Mobilities of a target's pairs, which hold while the places are the same objects."""

    places: tuple[_Place, ...]
    by_pair: dict[Key, _Mobility]

    def hold(self, places: Mapping[Key, _Place]) -> bool:
        """Whether they were measured at these places."""
        if len(self.places) != len(places):
            return False
        pairs = zip(self.places, places.values(), strict=True)
        return all(known is place for known, place in pairs)


def require_suited_options(model: mujoco.MjModel) -> None:
    """Raise `SceneError` for a model's options that two-way coupling does not support."""
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        raise SceneError(
            'two_way cannot work with the integrator "RK4", which takes four contact forces in '
            "each step, of which MuJoCo keeps the last alone; take "
            'integrator="implicitfast" (or "Euler", "implicit"), or two_way=False'
        )


class TwoWay:
    """Contacts with surfaces that give way.

    It also counts the energy that pairs pay in and get back; see `ContactProblem`.

    Parameters
    ----------
    coupled : CoupledModel
    waves : mapping
        Waves of each target; all targets are geoms.
    """

    def __init__(self, coupled: CoupledModel, waves: Mapping[TargetId, WaveSolver]) -> None:
        self._coupled = coupled
        self._waves = waves
        model = coupled.model
        # geoms that may come within reach of each target
        self._reachable: dict[GeomId, list[GeomId]] = {}
        # the targets that each geom collides for
        self._targets_of: dict[GeomId, list[GeomId]] = {}
        solid = np.isin(model.geom_type, list(TARGET_TYPES)) & ~np.isin(model.geom_type, ENDLESS)
        moving = (model.body_weldid[model.geom_bodyid] > 0) & solid
        for target in waves:
            if not is_geom(target, model):
                continue  # refused by `Ripples`
            others = np.flatnonzero(moving & coupled.can_collide(target)).tolist()
            self._reachable[target] = [geom_id(other) for other in others]
            for geom in coupled.collision_geoms(target):
                self._targets_of.setdefault(geom, []).append(target)
        self._is_read = np.zeros(len(coupled.owners), dtype=np.bool_)
        self._is_read[list(self._targets_of)] = True
        self._trials: dict[TargetId, _Trials] = {}
        self.clear()

    def clear(self) -> None:
        """Forget all contacts."""
        self._velocity_change = VelocityChange(self._coupled.model)
        self._places: dict[Key, _Place] = {}
        self._known_mobilities: dict[TargetId, _KnownMobilities] = {}
        # force of each pair in the last step [N]
        self._forces: dict[Key, float] = {}
        # energy that each pair has paid in [J], by `Pair.purse`
        self._paid: dict[Purse, float] = {}
        # heights at the beginning of the last step [m], by target
        self._heights_before: dict[TargetId, NDArray[np.float32]] = {}
        self._just_begun = True
        # works of the latest step's forces, which `settle` accounts for
        self._works: list[Work] = []

    def solve(
        self, data: mujoco.MjData, solved: mujoco.MjData, elapsed: float, *, pending: bool
    ) -> dict[TargetId, Load]:
        """Solve the contact problem again, correct the bodies' motion; return the targets' loads.

        Parameters
        ----------
        data : mujoco.MjData
            Velocities, and positions unless they are those of the step's beginning, are corrected.
        solved : mujoco.MjData
            The contact problem of the step: `data`, or a copy, see `SolvedForces`. Gets the new
            forces.
        elapsed : float
            Time that the waves are about to step [s].
        pending : bool
            Whether `data` has yet to take the step.
        """
        require_suited_options(self._coupled.model)
        dt = self._coupled.model.opt.timestep
        contacts = self._touching(solved)
        asleep = self._follow_places(contacts, solved)
        reached = self._reached(solved)
        self._wake(data)
        self._heights = {target: self._waves[target].height for target, _ in self._places}
        pairs = self._pairs(dt)
        forces = {key: self._forces[key] for key in asleep}
        self._works = []
        if contacts:
            forces |= self._solve_contacts(data, solved, contacts, pairs, dt, pending=pending)
        for meeting in reached:
            if self._coupled.are_still(solved, meeting.key):
                continue
            pair = pairs[meeting.key]
            forces[meeting.key] = self._push(data, solved, pair, meeting, dt, pending=pending)
        self._forces = forces
        self._velocity_change.latest = data.qvel.copy()
        self._heights_before = self._heights
        return self._loads(forces, dt, elapsed)

    def settle(self) -> None:
        """Note the energy that pairs have paid in, now that the waves have stepped."""
        paid = {work.pair.purse: self._paid.get(work.pair.purse, 0.0) for work in self._works}
        for pair, on_bodies, force in self._works:
            height = self._places[pair.key].mean(self._waves[pair.key[0]].height)
            moved = height - pair.height
            paid[pair.purse] -= on_bodies - force * moved
        self._paid = paid

    def _solve_contacts(
        self,
        data: mujoco.MjData,
        solved: mujoco.MjData,
        contacts: Mapping[Key, Sequence[_Contact]],
        pairs: Mapping[Key, Pair],
        dt: float,
        *,
        pending: bool,
    ) -> dict[Key, float]:
        """Force of each pair that touches [N], after which `data` moves as these forces ask."""
        pairs_at: dict[int, list[Pair]] = {}
        for key, touching in contacts.items():
            for contact in touching:
                pairs_at.setdefault(contact.number, []).append(pairs[key])
        problem = ContactProblem(self._coupled.model, solved, pairs_at)
        old_acceleration = solved.qacc.copy()
        old_force = solved.qfrc_constraint.copy()
        forces = problem.solve(self._paid)
        change = self._velocity_change(solved, old_acceleration, old_force, pending=pending)
        self._move(data, change, dt, pending=pending)
        self._works = problem.works()
        return forces

    def _loads(
        self, forces: Mapping[Key, float], dt: float, elapsed: float
    ) -> dict[TargetId, Load]:
        """Load on each target over a time [s], from forces [N] that act for dt [s]."""
        loads: dict[TargetId, list[Load]] = {}
        for key, force in forces.items():
            unit = self._places[key].load
            load = Load(unit.texels, force * dt / elapsed * unit.forces)
            loads.setdefault(key[0], []).append(load)
        return {target: Load.together(of_target) for target, of_target in loads.items()}

    # Where bodies touch

    def _touching(self, data: mujoco.MjData) -> dict[Key, list[_Contact]]:
        """MuJoCo's contacts of each pair."""
        touching: dict[Key, list[_Contact]] = {}
        if not data.ncon:
            return touching
        bears = data.contact.efc_address >= 0
        rows = pair_rows(collider_ids(self._coupled, data), bears, self._is_read)
        contacts, _, geoms, others = rows
        points, normals = points_outside(data, *rows, self._coupled.extents)
        ids = zip(contacts.tolist(), geoms.tolist(), others.tolist(), strict=True)
        for (number, geom, other), point, normal in zip(ids, points, normals, strict=True):
            target, contact = self._on_nearest_target(data, number, geom, point, normal)
            touching.setdefault((target, other), []).append(contact)
        return touching

    def _on_nearest_target(
        self,
        data: mujoco.MjData,
        number: int,
        geom: GeomId,
        point: NDArray[np.float64],
        normal: NDArray[np.float64],
    ) -> tuple[GeomId, _Contact]:
        """The nearest target that a geom collides for, and a contact, given in the world, on it."""
        choices = []
        for target in self._targets_of[geom]:
            rotation = data.geom_xmat[target].reshape(3, 3)
            place = (point - data.geom_xpos[target]) @ rotation
            outward = normal @ rotation
            distance = 0.0
            if target != geom:
                atlas = self._waves[target].atlas
                (on_surface,) = places_facing(atlas, place[None], outward[None])
                distance = float(np.linalg.norm(on_surface - place))
                place = on_surface
            choices.append((distance, target, _Contact(number, place, outward)))
        _, target, contact = min(choices, key=lambda choice: choice[0])
        return target, contact

    def _follow_places(
        self, contacts: Mapping[Key, Sequence[_Contact]], solved: mujoco.MjData
    ) -> list[Key]:
        """Find the places of all contacts; return the pairs that sleep, whose places stay."""
        known = self._places
        self._places = {}
        for key, touching in contacts.items():
            self._places[key] = self._place(key, touching, known.get(key))
        asleep = [key for key in known if key not in self._places and key in self._forces]
        asleep = [key for key in asleep if self._coupled.are_still(solved, key)]
        self._places |= {key: known[key] for key in asleep}
        return asleep

    def _reached(self, data: mujoco.MjData) -> list[_Reached]:
        """Pairs within reach that do not touch, see `within_reach`. They get a place."""
        reached = []
        for target, others in self._reachable.items():
            waves = self._waves[target]
            height = waves.height.reshape(-1)
            highest = float(height.max())
            if not highest > 0:
                continue
            for other in others:
                key = (target, other)
                if key in self._places:
                    continue
                meeting = within_reach(self._coupled, data, key, waves, height, highest)
                if meeting is None:
                    continue
                load, point, normal = meeting
                load = load.merged(len(height))
                moving = self._moving(target, load)
                self._places[key] = _Place(waves.atlas, np.zeros((0, 3)), 0.0, load, moving)
                reached.append(_Reached(key, point, normal))
        return reached

    def _place(self, key: Key, touching: Sequence[_Contact], known: _Place | None) -> _Place:
        """The place of a pair's contacts: the known one while they stay there, else a new one."""
        (target, other) = key
        atlas = self._waves[target].atlas
        points = np.array([contact.point for contact in touching])
        if self._coupled.convex[other] and 1 < len(points) <= MAX_CORNERS:
            # a convex geom also touches between two contacts
            first, second = np.triu_indices(len(points), 1)
            points = np.concatenate([points, (points[first] + points[second]) / 2])
        if known is not None and known.serves(atlas, points):
            return known
        (nearest, texels) = atlas.nearest(points)
        radius = float(self._coupled.footprint_radii[[target, other]].min())
        load = _unit_load(atlas, nearest, texels, radius)
        # a body that touches an open surface from inside pushes it outwards
        outward = atlas.normals.reshape(-1, 3)[texels[0]]
        if not atlas.mesh.closed and touching[0].normal @ outward < 0:
            load = Load(load.texels, -load.forces)
        tolerance = SAME_PLACE * float(np.sqrt(atlas.areas.reshape(-1)[texels[0]]))
        return _Place(atlas, points, tolerance, load, self._moving(target, load))

    def _moving(self, target: TargetId, load: Load) -> NDArray[np.float64]:
        """The part of a load's forces [N] that moves the texels, [t]."""
        return load.forces * self._waves[target].operator.source_share.reshape(-1)[load.texels]

    # What wakes

    def _wake(self, data: mujoco.MjData) -> None:
        """Wake sleeping bodies where the surface moves faster than MuJoCo lets bodies sleep.

        At the beginning all bodies that sleep on a target are woken: their forces are not known.
        """
        model = self._coupled.model
        if not model.opt.enableflags & SLEEP:
            return
        tolerance = float(model.opt.sleep_tolerance)
        moving = [key for key in self._places if self._speed_under(key) > tolerance]
        if self._just_begun:
            resting = at_rest(model, data)
            if resting is not None:
                moving += list(self._touching(resting))
            self._just_begun = False
        colliders = list(itertools.chain.from_iterable(moving))
        wake(model, data, self._coupled.bodies[colliders].tolist())

    def _speed_under(self, key: Key) -> float:
        """Speed of the surface under a pair's place [m/s]."""
        return abs(self._places[key].mean(self._waves[key[0]].velocity))

    # How the surfaces move

    def _pairs(self, dt: float) -> dict[Key, Pair]:
        """The motion of the surface under each place, for the contact problem."""
        pairs = {}
        for target in dict.fromkeys(target for target, _ in self._places):
            places = {key: place for key, place in self._places.items() if key[0] == target}
            trials = self._trial_waves(target)
            surface = self._step_trial(target, trials.pushed, places, dt)
            mobilities = self._mobilities(target, trials.resting, places, dt)
            for key, place in places.items():
                pairs[key] = self._pair(key, place, surface, mobilities[key], dt)
        return pairs

    def _trial_waves(self, target: TargetId) -> _Trials:
        """Copies of a target's waves, the same ones as long as the waves allow."""
        waves = self._waves[target]
        trials = self._trials.get(target)
        if trials is None or not trials.suit(waves):
            trials = _Trials(waves, copy.copy(waves), copy.copy(waves))
            self._trials[target] = trials
            self._known_mobilities = {}
        return trials

    def _step_trial(
        self, target: TargetId, trial: WaveSolver, places: Mapping[Key, _Place], dt: float
    ) -> _SurfaceStep:
        """Step trial waves by dt [s] from where the target's waves are, under the last forces."""
        waves = self._waves[target]
        trial.state = waves.state
        loads = []
        for key, place in places.items():
            force = self._forces.get(key, 0.0)
            loads.append(Load(place.load.texels, force * place.load.forces))
        trial.step(dt, load=Load.together(loads))
        height_now = self._heights[target]
        return _SurfaceStep(
            height_before=self._heights_before.get(target, height_now),
            height_now=height_now,
            height_after=trial.height,
            velocity_now=waves.velocity,
            velocity_after=trial.velocity,
        )

    def _mobilities(
        self, target: TargetId, trial: WaveSolver, places: Mapping[Key, _Place], dt: float
    ) -> dict[Key, _Mobility]:
        """Mobility of the surface under each place, when unit forces act on all places at once.

        They are measured by a step of trial waves from rest, and stay while the places do.
        """
        known = self._known_mobilities.get(target)
        if known is not None and known.hold(places):
            return known.by_pair
        trial.reset()
        trial.step(dt, load=Load.together([place.load for place in places.values()]))
        height = trial.height
        velocity = trial.velocity
        mobilities = {}
        for key, place in places.items():
            at_end = -place.mean(velocity) / dt
            mean = max(-place.mean(height) / dt**2, 0.0)
            mobilities[key] = _Mobility(at_end, mean)
        self._known_mobilities[target] = _KnownMobilities(tuple(places.values()), mobilities)
        return mobilities

    def _pair(
        self, key: Key, place: _Place, surface: _SurfaceStep, mobility: _Mobility, dt: float
    ) -> Pair:
        """Heights and velocities of a surface in a step of dt [s], as means under a place."""
        mean_velocity = place.mean(surface.height_after - surface.height_now) / dt
        velocity_at_start = place.mean(surface.velocity_now)
        velocity_at_end = place.mean(surface.velocity_after)
        mobility_at_end = mobility.at_end
        if mobility.at_end < mobility.mean:
            # the surface swings back within the step, and its velocity at the end says little
            velocity_at_start = place.mean(surface.height_now - surface.height_before) / dt
            velocity_at_end = mean_velocity
            mobility_at_end = mobility.mean
        return Pair(
            key=key,
            height=place.mean(surface.height_now),
            held_force=self._forces.get(key, 0.0),
            start_velocity=velocity_at_start,
            end_velocity=velocity_at_end,
            mobility=mobility_at_end,
            mean_velocity=mean_velocity,
            mean_mobility=mobility.mean,
        )

    # What happens to the bodies

    def _move(
        self, data: mujoco.MjData, change: NDArray[np.float64], dt: float, *, pending: bool
    ) -> None:
        """Change velocities, and positions as the step would have; sleeping bodies stay.

        Parameters
        ----------
        data : mujoco.MjData
        change : float64 [nv]
            Of the velocities.
        dt : float
            Time step [s].
        pending : bool
            Whether `data` has yet to take the step: then its positions stay.
        """
        change = np.where(sleeping_dofs(self._coupled.model, data), 0.0, change)
        data.qvel += change
        if not pending:
            mujoco.mj_integratePos(self._coupled.model, data.qpos, change, dt)
            data.qacc_warmstart[:] = data.qacc

    def _push(
        self,
        data: mujoco.MjData,
        solved: mujoco.MjData,
        pair: Pair,
        meeting: _Reached,
        dt: float,
        *,
        pending: bool,
    ) -> float:
        """Push a body that the risen surface has reached; return the force [N].

        After the push, body and surface part no slower than they met.
        """
        along = self._relative_jacobian(solved, meeting)
        response = np.zeros((1, self._coupled.model.nv))
        mujoco.mj_solveM(self._coupled.model, solved, response, along[None])
        body_mobility = float(along @ response[0])  # [1/kg]
        # velocities along the normal at the end of the step, without the push [m/s]
        body_velocity = float(along @ data.qvel)
        if pending:
            body_velocity += dt * float(along @ solved.qacc)
        approach = pair.end_velocity + pair.mobility * dt * pair.held_force - body_velocity
        mobility = body_mobility + pair.mobility
        if mobility <= 0 or approach <= 0:
            return 0.0
        force = approach / mobility / dt
        velocity_at_start = body_velocity - dt * float(along @ solved.qacc)
        mean_body_velocity = (velocity_at_start + body_velocity) / 2
        # the work of a share of the force is linear * share + square * share^2 [J]
        linear = (
            force
            * dt
            * (mean_body_velocity - pair.mean_velocity - pair.mean_mobility * dt * pair.held_force)
        )
        square = (force * dt) ** 2 * (body_mobility / 2 + pair.mean_mobility)
        force *= affordable_share(linear, square, self._paid.get(pair.purse, 0.0))
        self._move(data, force * dt * response[0], dt, pending=pending)
        on_bodies = force * dt * (mean_body_velocity + force * dt * body_mobility / 2)
        self._works.append(Work(pair, on_bodies, force))
        return force

    def _relative_jacobian(self, solved: mujoco.MjData, meeting: _Reached) -> NDArray[np.float64]:
        """Velocity of the other body against the target's along the normal, per `qvel`, [nv]."""
        model = self._coupled.model
        along = np.zeros(model.nv)
        for sign, geom in zip((-1, 1), meeting.key, strict=True):
            jacobian = np.zeros((3, model.nv))
            body = int(self._coupled.bodies[geom])
            mujoco.mj_jac(model, solved, jacobian, None, meeting.point, body)
            along += sign * meeting.normal @ jacobian
        return along


def _unit_load(
    atlas: Atlas, places: NDArray[np.float64], texels: NDArray[np.int64], radius: float
) -> Load:
    """A unit force in equal parts on places of an atlas, with a footprint of a radius [m] each.

    Parameters
    ----------
    atlas : Atlas
    places : float64 [k, 3]
        On the surface [m].
    texels : int64 [k]
        The texels nearest to the places.
    radius : float
        [m].
    """
    areas = atlas.areas.reshape(-1)
    loads = []
    for place, texel in zip(places, texels.tolist(), strict=True):
        under = footprint_at(atlas, place, texel, radius)
        loads.append(Load(under.texels, under.weights * areas[under.texels] / len(places)))
    return Load.together(loads).merged(areas.size)
