"""Two-way coupling: the contact force is found with the motion of both, body and surface, and both get it.

MuJoCo's contact problem knows rigid surfaces alone. Here it is solved again with a surface that
gives way: a contact's gap counts from the displaced surface, and a unit of its force moves that
surface as the waves say. What is found replaces the forces of the step, and the bodies' motion in
it.

MuJoCo sees a body over a risen surface apart from it. `within_reach` finds such bodies by their
support points, and they are given the force after which both move alike.
"""

from __future__ import annotations

import copy
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
from .energy import ContactProblem, Key, Pair, VelocityChange, affordable_share
from .geoms import TARGET_TYPES
from .model import CoupledModel
from .patches import MAX_CORNERS, SAME_PLACE
from .sleep import SLEEP, at_rest, sleeping_dofs, wake

_GEOM = mujoco.mjtGeom

# A side or an edge whose slope against the plane is less than this counts as flat: its middle is
# the point.
_FLAT = 0.02

_ROUNDS = 3  # of the search for the points of surface and geom that are nearest to each other


def support_point(
    model: mujoco.MjModel, geom: int, direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Point [m], shape [3], of a geom that lies farthest in a direction: the middle of a side where a whole side does.

    Parameters
    ----------
    model : mujoco.MjModel
    geom : int
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
            rim = size[0] * direction[:2] / across if across > _FLAT else np.zeros(2)
            return np.append(rim, size[1] * _side(direction[2]))
        case _GEOM.mjGEOM_BOX:
            return size * [_side(along) for along in direction]
    mesh = int(model.geom_dataid[geom])
    begin = int(model.mesh_vertadr[mesh])
    count = int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[begin : begin + count]
    heights = vertices @ direction
    return (
        vertices[heights > heights.max() - _FLAT * model.geom_rbound[geom]]
        .mean(axis=0)
        .astype(np.float64)
    )


def _side(along: float) -> float:
    return 0.0 if abs(along) < _FLAT else float(np.sign(along))


def within_reach(
    coupled: CoupledModel,
    data: mujoco.MjData,
    pair: Key,
    waves: WaveSolver,
    height: Floats32,
    highest: float,
) -> tuple[Load, NDArray[np.float64], NDArray[np.float64]] | None:
    """Where a geom is above a target, lower than its waves of a height, [C n n], are at their highest [m], if it is.

    A geom is within reach where its lowest point is less above the undeformed surface than the
    surface has risen there. That point is found by turns: the surface point nearest to the geom's
    point, and the geom's point deepest along the normal there.

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
    for _ in range(_ROUNDS):
        (place,), (texel,) = atlas.nearest(point)
        if np.linalg.norm(point - place) > reach:
            return None
        normal = atlas.normals.reshape(-1, 3)[texel]
        point = centre + to_target @ support_point(model, other, -normal @ to_target)
    if (point - place) @ normal >= height[texel]:
        return None
    where = footprint(atlas, place, float(coupled.footprint_radii[[target, other]].min()))
    movable_area = (
        atlas.areas.reshape(-1)[where.texels] * waves.operator.movable.reshape(-1)[where.texels]
    )
    load = Load(where.texels, where.weights * movable_area)
    return load, data.geom_xpos[target] + rotation @ place, rotation @ normal


class _Place(NamedTuple):
    """Where a pair touches.

    Attributes
    ----------
    atlas : Atlas
        Of the target, where it is now.
    points : float64 [k, 3]
        In the target's frame [m].
    tolerance : float
        How far they may move before it is another place [m].
    load : Load
        A unit force on the texels, each once.
    moving : float64 [t]
        The part of it that moves them.
    """

    atlas: Atlas
    points: NDArray[np.float64]
    tolerance: float
    load: Load
    moving: NDArray[np.float64]

    def mean(self, field: NDArray) -> float:
        """Mean of a field [C, n, n]: force times mean velocity is the power that the surface gets."""
        return float(self.moving @ field.reshape(-1)[self.load.texels].astype(np.float64))


def require_suited_options(model: mujoco.MjModel) -> None:
    """Raise `SceneError` for options of a model with which contact forces cannot be found anew."""
    if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        raise SceneError(
            'two_way cannot work with the integrator "RK4", which takes four contact forces in '
            "each step, of which "
            'MuJoCo keeps the last alone; take integrator="implicitfast" (or "Euler", "implicit"), '
            "or two_way=False"
        )


class TwoWay:
    """Contacts with surfaces that give way.

    What pairs pay in and get back, see `ContactProblem`, is counted here.

    Parameters
    ----------
    coupled : CoupledModel
    waves : mapping
        Waves of each target, by geom id.
    """

    def __init__(self, coupled: CoupledModel, waves: Mapping[int, WaveSolver]) -> None:
        self._coupled = coupled
        self._waves = waves
        model = coupled.model
        # geoms that may come within reach of each target, and the targets that each geom collides
        # for
        self._reachable: dict[int, list[int]] = {}
        self._targets_of: dict[int, list[int]] = {}
        solid = np.isin(model.geom_type, list(TARGET_TYPES)) & ~np.isin(model.geom_type, ENDLESS)
        moving = (model.body_weldid[model.geom_bodyid] > 0) & solid
        for target in waves:
            self._reachable[target] = np.flatnonzero(moving & coupled.can_collide(target)).tolist()
            for geom in coupled.collision_geoms(target):
                self._targets_of.setdefault(geom, []).append(target)
        self._is_read = np.zeros(len(coupled.owners), dtype=np.bool_)
        self._is_read[list(self._targets_of)] = True
        # the waves of each target, and two solvers to try things on
        self._trials: dict[int, tuple[WaveSolver, ...]] = {}
        self.clear()

    def clear(self) -> None:
        """Forget all contacts."""
        self._velocity_change = VelocityChange(self._coupled.model)
        self._places: dict[Key, _Place] = {}
        self._mobilities: dict[int, tuple[tuple[_Place, ...], dict[Key, tuple[float, float]]]] = {}
        self._forces: dict[Key, float] = {}
        self._paid: dict[Key, float] = {}
        self._before: dict[int, NDArray[np.float32]] = {}
        self._just_begun = True
        self._work: list[tuple[Pair, float, float]] = []

    def solve(
        self, data: mujoco.MjData, solved: mujoco.MjData, elapsed: float, *, pending: bool
    ) -> dict[int, Load]:
        """Find the forces of the latest physics step anew, correct the bodies' motion, and return the targets' loads.

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
        known = self._places
        self._places = {}
        for key, touched in contacts.items():
            self._places[key] = self._place(key, touched, known.get(key))
        asleep = [key for key in known if key not in self._places and key in self._forces]
        asleep = [key for key in asleep if self._coupled.are_still(solved, key)]
        self._places |= {key: known[key] for key in asleep}
        reached = self._reached(solved)
        self._wake(data)
        self._heights = {target: self._waves[target].height for target, _ in self._places}
        pairs = self._surfaces(dt)
        forces = {key: self._forces[key] for key in asleep}
        self._work = []
        if contacts:
            pairs_at: dict[int, list[Pair]] = {}
            for key, each in contacts.items():
                for i, _, _ in each:
                    pairs_at.setdefault(i, []).append(pairs[key])
            problem = ContactProblem(self._coupled.model, solved, pairs_at)
            old = solved.qacc.copy(), solved.qfrc_constraint.copy()
            forces |= problem.solve(self._paid)
            self._move(
                data, self._velocity_change(solved, *old, pending=pending), dt, pending=pending
            )
            self._work = problem.works()
        for key, point, normal in reached:
            if self._coupled.are_still(solved, key):
                continue
            forces[key] = self._push(data, solved, pairs[key], point, normal, dt, pending=pending)
        self._forces = forces
        self._velocity_change.latest = data.qvel.copy()
        self._before = self._heights
        loads: dict[int, list[Load]] = {}
        for key, force in forces.items():
            load = self._places[key].load
            loads.setdefault(key[0], []).append(
                Load(load.texels, force * dt / elapsed * load.forces)
            )
        return {target: Load.together(each) for target, each in loads.items()}

    def settle(self) -> None:
        """Note what was paid, now that the waves have stepped."""
        paid = {pair.purse: self._paid.get(pair.purse, 0.0) for pair, _, _ in self._work}
        for pair, body, force in self._work:
            moved = self._places[pair.key].mean(self._waves[pair.key[0]].height) - pair.height
            paid[pair.purse] -= body - force * moved
        self._paid = paid

    # Where bodies touch

    def _touching(self, data: mujoco.MjData) -> dict[Key, list[tuple[int, NDArray, NDArray]]]:
        """MuJoCo's contacts of each pair: which, and their points and normals in the target's frame."""
        found: dict[Key, list[tuple[int, NDArray, NDArray]]] = {}
        if not data.ncon:
            return found
        bears = data.contact.efc_address >= 0
        rows = contacts, _, geoms, others = pair_rows(
            collider_ids(self._coupled, data), bears, self._is_read
        )
        points, normals = points_outside(data, *rows, self._coupled.extents)
        ids = zip(contacts.tolist(), geoms.tolist(), others.tolist(), strict=True)
        for (i, geom, other), at, normal in zip(ids, points, normals, strict=True):
            choices = []
            for target in self._targets_of[geom]:
                rotation = data.geom_xmat[target].reshape(3, 3)
                point = (at - data.geom_xpos[target]) @ rotation
                outward = normal @ rotation
                off = 0.0
                if target != geom:
                    (place,) = places_facing(self._waves[target].atlas, point[None], outward[None])
                    point, off = place, float(np.linalg.norm(place - point))
                choices.append((off, target, point, outward))
            _, target, point, outward = min(choices, key=lambda choice: choice[0])
            found.setdefault((target, other), []).append((i, point, outward))
        return found

    def _reached(
        self, data: mujoco.MjData
    ) -> list[tuple[Key, NDArray[np.float64], NDArray[np.float64]]]:
        """Pairs within reach that do not touch, and where; see `within_reach`. They get a place."""
        reached = []
        for target, others in self._reachable.items():
            waves = self._waves[target]
            height = self._waves[target].height.reshape(-1)
            highest = float(height.max())
            for key in ((target, other) for other in others if highest > 0):
                found = (
                    None
                    if key in self._places
                    else within_reach(self._coupled, data, key, waves, height, highest)
                )
                if found is not None:
                    load = found[0].merged(len(height))
                    moving = self._moving(target, load)
                    self._places[key] = _Place(waves.atlas, np.zeros((0, 3)), 0.0, load, moving)
                    reached.append((key, *found[1:]))
        return reached

    def _place(
        self, key: Key, touched: Sequence[tuple[int, NDArray, NDArray]], known: _Place | None
    ) -> _Place:
        (target, other) = key
        atlas = self._waves[key[0]].atlas
        points = np.array([point for _, point, _ in touched])
        if self._coupled.convex[other] and 1 < len(points) <= MAX_CORNERS:
            one, two = np.triu_indices(len(points), 1)
            points = np.concatenate([points, (points[one] + points[two]) / 2])
        if (
            known is not None
            and known.atlas is atlas
            and known.points.shape == points.shape
            and np.abs(known.points - points).max() < known.tolerance
        ):
            return known
        (nearest, texels) = atlas.nearest(points)
        areas = atlas.areas.reshape(-1)
        radius = float(self._coupled.footprint_radii[[target, other]].min())
        parts = [
            footprint_at(atlas, *each, radius)
            for each in zip(nearest, texels.tolist(), strict=True)
        ]
        loads = [
            Load(each.texels, each.weights * areas[each.texels] / len(parts)) for each in parts
        ]
        # what touches an open surface from inside pushes it outwards
        inside = (
            not atlas.mesh.closed and touched[0][2] @ atlas.normals.reshape(-1, 3)[texels[0]] < 0
        )
        load = Load.together(loads).merged(areas.size)
        load = Load(load.texels, -load.forces) if inside else load
        return _Place(
            atlas,
            points,
            SAME_PLACE * float(np.sqrt(areas[texels[0]])),
            load,
            self._moving(target, load),
        )

    def _moving(self, target: int, load: Load) -> NDArray[np.float64]:
        return load.forces * self._waves[target].operator.source_share.reshape(-1)[load.texels]

    # What wakes

    def _wake(self, data: mujoco.MjData) -> None:
        """Wake bodies that sleep where the surface moves faster than what MuJoCo lets sleep.

        At the beginning all that sleep on a target are woken: what they press it with is not known.
        """
        model = self._coupled.model
        if not model.opt.enableflags & SLEEP:
            return
        tolerance = float(model.opt.sleep_tolerance)
        keys = [
            key for key, place in self._places.items() if self._speed_under(key, place) > tolerance
        ]
        if self._just_begun:
            resting = at_rest(model, data)
            keys += [] if resting is None else list(self._touching(resting))
            self._just_begun = False
        wake(model, data, (int(self._coupled.bodies[geom]) for key in keys for geom in key))

    def _speed_under(self, key: Key, place: _Place) -> float:
        """Of the surface at a place [m/s]."""
        return abs(place.mean(self._waves[key[0]].velocity))

    # How the surfaces move

    def _surfaces(self, dt: float) -> dict[Key, Pair]:
        pairs = {}
        for target in dict.fromkeys(target for target, _ in self._places):
            places = {key: place for key, place in self._places.items() if key[0] == target}
            held = {key: self._forces.get(key, 0.0) for key in places}
            waves = self._waves[target]
            of, *trials = self._trials.get(target, (None,))
            # what moves gets another operator
            changed = of is not waves or trials[0].operator is not waves.operator
            if changed or trials[0].conserve_volume != waves.conserve_volume:
                trials = [copy.copy(waves), copy.copy(waves)]
                self._trials[target] = (waves, *trials)
                self._mobilities = {}
            trial, rest = trials
            trial.state = waves.state
            loads = [
                Load(place.load.texels, held[key] * place.load.forces)
                for key, place in places.items()
            ]
            trial.step(dt, load=Load.together(loads))
            # velocity under each place, at the end of a step and its mean, over the step, that unit
            # forces give
            these, mobilities = self._mobilities.get(target, ((), {}))
            if len(these) != len(places) or any(
                a is not b for a, b in zip(these, places.values(), strict=True)
            ):
                rest.reset()
                rest.step(dt, load=Load.together([place.load for place in places.values()]))
                height = rest.height
                velocity = rest.velocity
                mobilities = {
                    key: (-place.mean(velocity) / dt, max(-place.mean(height) / dt**2, 0.0))
                    for key, place in places.items()
                }
                self._mobilities[target] = tuple(places.values()), mobilities
            now = self._heights[target]
            before = self._before.get(target, self._heights[target])
            after = trial.height
            velocity = waves.velocity
            end = trial.velocity
            for key, place in places.items():
                (mobility, mean_mobility) = mobilities[key]
                mean = place.mean(after - now) / dt
                start = place.mean(velocity)
                free = place.mean(end)
                if mobility < mean_mobility:
                    # the surface swings back within the step, and its velocity at the end says
                    # little
                    start = place.mean(now - before) / dt
                    free = mean
                    mobility = mean_mobility
                pairs[key] = Pair(
                    key, place.mean(now), held[key], start, free, mobility, mean, mean_mobility
                )
        return pairs

    # What happens to the bodies

    def _move(
        self, data: mujoco.MjData, change: NDArray[np.float64], dt: float, *, pending: bool
    ) -> None:
        """Change velocities [m/s] as the step would have, and positions with them; what sleeps stays."""
        change = np.where(sleeping_dofs(self._coupled.model, data), 0.0, change)
        data.qvel += change
        if not pending:
            mujoco.mj_integratePos(self._coupled.model, data.qpos, change, dt)
            data.qacc_warmstart[:] = data.qacc

    def _push(
        self, data: mujoco.MjData, solved: mujoco.MjData, pair: Pair, point: NDArray[np.float64],
        normal: NDArray[np.float64], dt: float, *, pending: bool,
    ) -> float:  # fmt: skip
        """Push a body that the risen surface has reached, so that they part no slower than they meet; the force [N]."""
        model = self._coupled.model
        bodies = self._coupled.bodies
        along = np.zeros(model.nv)
        for sign, geom in zip((-1, 1), pair.key, strict=True):
            jacobian = np.zeros((3, model.nv))
            mujoco.mj_jac(model, solved, jacobian, None, point, int(bodies[geom]))
            along += sign * normal @ jacobian
        response = np.zeros((1, model.nv))
        mujoco.mj_solveM(model, solved, response, along[None])
        light = float(along @ response[0])
        end = float(along @ data.qvel) + (dt * float(along @ solved.qacc) if pending else 0.0)
        meets = pair.free + pair.mobility * dt * pair.held - end
        if light + pair.mobility <= 0 or meets <= 0:
            return 0.0
        force = meets / (light + pair.mobility) / dt
        start = end - dt * float(along @ solved.qacc)
        linear = force * dt * ((start + end) / 2 - pair.mean - pair.mean_mobility * dt * pair.held)
        square = (force * dt) ** 2 * (light / 2 + pair.mean_mobility)
        force *= affordable_share(linear, square, self._paid.get(pair.purse, 0.0))
        self._move(data, force * dt * response[0], dt, pending=pending)
        self._work.append((pair, force * dt * ((start + end) / 2 + force * dt * light / 2), force))
        return force
