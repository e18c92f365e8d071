"""Two-way coupling: the contact force is found with the motion of both, body and surface, and both get it.

MuJoCo's contact problem knows rigid surfaces alone. Here it is solved again with a surface that gives way: a contact's
gap counts from the displaced surface, and a unit of its force moves that surface as the waves say. What is found
replaces the forces of the step, and the bodies' motion in it.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Load, WaveSolver
from ripple_sim.solver.waves.footprint import footprint_at

from .contact_reader import Adhesion, ColliderIds
from .contacts import PYRAMIDAL
from .load import Touch
from .model import CoupledModel
from .placing import places
from .reach import Reach

# MuJoCo keeps impedances this far from 0 and 1, and takes narrower ranges for none.
_LEAST_IMPEDANCE, _NARROW = 1e-4, 1e-15
# A footprint is reused while its points move by less than this share of a texel.
_SAME_PLACE = 0.3
# Up to so many contacts of a pair, what is convex presses between them too.
_MOST_CORNERS = 8
# Rounds in which contacts that share a footprint find their forces, and the share of a force that may be left.
_ROUNDS, _LEFT = 8, 1e-4
# Rounds in which pairs that cannot afford their forces get a share of them, after the first a little less than they can
# afford, and in the last one the least.
_ATTEMPTS, _LESS, _LEAST_SHARE = 6, 0.95, 1e-9
# A difference of work that round-off makes, as a share of it.
_ROUND_OFF = 1e-6
# Acceleration that the rows of an open contact aim at: any is greater, so that they do not push.
_OPEN = -1e10

_Key = tuple[int, int]


class _Place(NamedTuple):
    """Where a pair touches.

    Attributes
    ----------
    points : float64 [k, 3]
        In the target's frame [m].
    tolerance : float
        How far they may move before it is another place [m].
    load : Load
        A unit force on the texels, each once.
    moving : float64 [t]
        The part of it that moves them.
    """

    points: NDArray[np.float64]
    tolerance: float
    load: Load
    moving: NDArray[np.float64]

    def mean(self, field: NDArray) -> float:
        """Mean of a field [C, n, n]: force times mean velocity is the power that the surface gets."""
        return float(self.moving @ field.reshape(-1)[self.load.texels].astype(np.float64))


class _Pair(NamedTuple):
    """A target and what touches it: what the contact problem has to know of the surface there.

    Attributes
    ----------
    key : tuple of int
        Target and other.
    place : _Place
    height : float
        Of the surface [m].
    held : float
        Force of the last step [N].
    start, free, mobility : float
        Velocity of the surface at the beginning of the step, and at its end under the force of the last step [m/s]; and
        what a unit force adds to it, over the step [1/kg].
    mean, mean_mobility : float
        The last two for the mean velocity over the step.
    """

    key: _Key
    place: _Place
    height: float
    held: float
    start: float
    free: float
    mobility: float
    mean: float
    mean_mobility: float

    @property
    def purse(self) -> _Key:
        """Who pays: the same for the two pairs of two targets that touch each other."""
        return min(self.key), max(self.key)


class _Contact(NamedTuple):
    """A contact: which of MuJoCo's, its rows that carry the normal force, all its rows, and its pairs, one a target."""

    which: int
    rows: slice
    whole: slice
    pairs: list[_Pair]


class _Problem(NamedTuple):
    """The contact problem of a step, row by row of the constraint solver; more as in MuJoCo's `data`.

    Attributes
    ----------
    contacts : list of _Contact
    R, aref : float64 [nefc]
        As they are without mobility.
    mobility : float64 [nefc]
        What each row would add if all rows of its pairs bore alike [1/kg].
    smooth : float64 [nefc]
        Acceleration without contacts [m/s^2].
    pulls : float64 [ncon]
        Of adhesion [N].
    """

    contacts: list[_Contact]
    R: NDArray[np.float64]
    aref: NDArray[np.float64]
    mobility: NDArray[np.float64]
    smooth: NDArray[np.float64]
    pulls: NDArray[np.float64]

    def normal(self, force: NDArray[np.float64]) -> list[float]:
        """Normal force of each contact on its bodies, without what adhesion takes of it [N]."""
        return [float(force[each.rows].sum() - self.pulls[each.which]) for each in self.contacts]

    def total(self, force: NDArray[np.float64]) -> dict[_Key, float]:
        """Force on each target in a pair [N]."""
        total: dict[_Key, float] = {}
        for contact, normal in zip(self.contacts, self.normal(force), strict=True):
            for pair in contact.pairs:
                total[pair.key] = total.get(pair.key, 0.0) + normal
        return total


class TwoWay:
    """Contacts with surfaces that give way.

    A pair pays in what its contacts take from the motion of body and surface, and gets back no more than that: energy
    does not rise. Forces that would take more are lessened (a passivity observer and controller: Hannaford and Ryu,
    2002).

    Parameters
    ----------
    coupled : CoupledModel
    waves : mapping
        Waves of each target, by geom id.
    """

    def __init__(self, coupled: CoupledModel, waves: Mapping[int, WaveSolver]) -> None:
        self._coupled, self._waves = coupled, waves
        self._colliders, self._adhesion = ColliderIds(coupled), Adhesion(coupled.model)
        self._reach = Reach(coupled, waves)
        self._targets_of: dict[int, list[int]] = {}
        for target in waves:
            for geom in coupled.collision_geoms(target):
                self._targets_of.setdefault(geom, []).append(target)
        self._trials: dict[int, tuple[WaveSolver, WaveSolver, WaveSolver]] = {}
        self.clear()

    def clear(self) -> None:
        """Forget all contacts."""
        self._places: dict[_Key, _Place] = {}
        self._mobilities: dict[_Key, tuple[tuple[_Place, ...], tuple[float, float]]] = {}
        self._forces: dict[_Key, float] = {}
        self._paid: dict[_Key, float] = {}
        self._before: dict[int, NDArray[np.float32]] = {}
        self._work: list[tuple[_Pair, float, float]] = []

    def solve(self, data: mujoco.MjData, solved: mujoco.MjData, elapsed: float, *, pending: bool) -> dict[int, Load]:
        """Find the forces of the latest physics step anew, correct the bodies' motion, and return the targets' loads.

        Parameters
        ----------
        data : mujoco.MjData
            Velocities, and positions unless they are those of the step's beginning, are corrected.
        solved : mujoco.MjData
            The contact problem of the step: `data`, or a copy, see `SolvedForces`. Gets the new forces.
        elapsed : float
            Time that the waves are about to step [s].
        pending : bool
            Whether `data` has yet to take the step.
        """
        dt = self._coupled.model.opt.timestep
        contacts = self._touching(solved)
        known, self._places = self._places, {}
        for key, touched in contacts.items():
            self._places[key] = self._place(key, touched, known.get(key))
        reached = list(self._reach.reached(solved, self._waves, self._places.keys()))
        for touch in reached:
            self._places[touch.target, touch.other] = self._reached_place(touch)
        asleep = [key for key in known if key not in self._places and self._force_stays(solved, key)]
        self._places |= {key: known[key] for key in asleep}
        self._heights = {target: self._waves[target].height for target, _ in self._places}
        pairs = self._surfaces(dt)
        forces, self._work = {key: self._forces[key] for key in asleep}, []
        if contacts:
            problem = self._problem(solved, pairs, dt)
            old = solved.qacc.copy()
            forces |= problem.total(self._solved(solved, problem, dt))
            self._move(data, dt * (solved.qacc - old), dt, pending=pending)
            self._note_work(solved, problem, dt)
        for touch in reached:
            key = touch.target, touch.other
            forces[key] = self._push(data, solved, touch, pairs[key], dt, pending=pending)
        self._forces = forces
        self._before = self._heights
        loads: dict[int, list[Load]] = {}
        for key, force in forces.items():
            load = self._places[key].load
            loads.setdefault(key[0], []).append(Load(load.texels, force * dt / elapsed * load.forces))
        return {target: Load.together(each) for target, each in loads.items()}

    def settle(self) -> None:
        """Note what was paid, now that the waves have stepped."""
        paid = {pair.purse: self._paid.get(pair.purse, 0.0) for pair, _, _ in self._work}
        for pair, body, force in self._work:
            moved = pair.place.mean(self._waves[pair.key[0]].height) - pair.height
            paid[pair.purse] -= body - force * moved
        self._paid = paid

    # Where bodies touch

    def _touching(self, data: mujoco.MjData) -> dict[_Key, list[tuple[int, NDArray, NDArray]]]:
        """MuJoCo's contacts of each pair: which, and their points and normals in the target's frame."""
        found: dict[_Key, list[tuple[int, NDArray, NDArray]]] = {}
        contact, extents = data.contact, self._coupled.extents
        if not data.ncon:
            return found
        colliders = self._colliders(data)
        for i in np.flatnonzero((contact.efc_address >= 0) & (colliders >= 0).all(axis=1)).tolist():
            for side in range(2):
                geom, other = (int(colliders[i, each]) for each in (side, 1 - side))
                targets = self._targets_of.get(geom, [])
                if not targets:
                    continue
                normal = contact.frame[i, :3] * (-1 if side else 1)
                # a little outside the surface the nearest point of it is on this side, even of a thin part
                depth = min(abs(contact.dist[i]), extents[geom], extents[other])
                at, choices = contact.pos[i] + 1.5 * depth * normal, []
                for target in targets:
                    rotation = data.geom_xmat[target].reshape(3, 3)
                    point, outward = (at - data.geom_xpos[target]) @ rotation, normal @ rotation
                    if target != geom:
                        (point,), off = places(self._waves[target].atlas, point[None], outward[None]), point
                    choices.append(
                        (0.0 if target == geom else float(np.linalg.norm(point - off)), target, point, outward)
                    )
                _, target, point, outward = min(choices, key=lambda choice: choice[0])
                found.setdefault((target, other), []).append((i, point, outward))
        return found

    def _place(self, key: _Key, touched: Sequence[tuple[int, NDArray, NDArray]], known: _Place | None) -> _Place:
        (target, other), atlas = key, self._waves[key[0]].atlas
        points = np.array([point for _, point, _ in touched])
        if self._coupled.convex[other] and 1 < len(points) <= _MOST_CORNERS:
            one, two = np.triu_indices(len(points), 1)
            points = np.concatenate([points, (points[one] + points[two]) / 2])
        if (
            known is not None
            and known.points.shape == points.shape
            and np.abs(known.points - points).max() < known.tolerance
        ):
            return known
        (nearest, texels), areas = atlas.nearest(points), atlas.areas.reshape(-1)
        radius = float(self._coupled.footprint_radii[[target, other]].min())
        parts = [footprint_at(atlas, *each, radius) for each in zip(nearest, texels.tolist(), strict=True)]
        loads = [Load(each.texels, each.weights * areas[each.texels] / len(parts)) for each in parts]
        # what touches an open surface from inside pushes it outwards
        inside = not atlas.mesh.closed and touched[0][2] @ atlas.normals.reshape(-1, 3)[texels[0]] < 0
        load = Load.together(loads).merged(areas.size)
        load = Load(load.texels, -load.forces) if inside else load
        return _Place(points, _SAME_PLACE * float(np.sqrt(areas[texels[0]])), load, self._moving(target, load))

    def _reached_place(self, touch: Touch) -> _Place:
        load = touch.load.merged(self._waves[touch.target].atlas.areas.size)
        return _Place(np.zeros((0, 3)), 0.0, load, self._moving(touch.target, load))

    def _moving(self, target: int, load: Load) -> NDArray[np.float64]:
        return load.forces * self._waves[target].operator.source_share.reshape(-1)[load.texels]

    def _force_stays(self, data: mujoco.MjData, key: _Key) -> bool:
        """Whether both of a pair sleep or are static, so that they press as before."""
        bodies = self._coupled.bodies[list(key)]
        return key in self._forces and bool((bodies >= 0).all() and (data.body_awake[bodies] <= 0).all())

    # How the surfaces move

    def _surfaces(self, dt: float) -> dict[_Key, _Pair]:
        pairs = {}
        for target in dict.fromkeys(target for target, _ in self._places):
            places = {key: place for key, place in self._places.items() if key[0] == target}
            held = {key: self._forces.get(key, 0.0) for key in places}
            waves, trial, rest = self._with_trials(target)
            trial.state = waves.state
            trial.step(dt, load=Load.together([_times(place.load, held[key]) for key, place in places.items()]))
            mobilities = self._mobilities_of(places, rest, dt)
            now, before, after = self._heights[target], self._before.get(target, self._heights[target]), trial.height
            velocity, end = waves.velocity, trial.velocity
            for key, place in places.items():
                mobility, mean_mobility = mobilities[key]
                height, mean = place.mean(now), place.mean(after - now) / dt
                start, free = place.mean(velocity), place.mean(end)
                if mobility < mean_mobility:
                    # the surface swings back within the step, and its velocity at the end says little
                    start, free, mobility = place.mean(now - before) / dt, mean, mean_mobility
                pairs[key] = _Pair(key, place, height, held[key], start, free, mobility, mean, mean_mobility)
        return pairs

    def _mobilities_of(
        self, places: Mapping[_Key, _Place], rest: WaveSolver, dt: float
    ) -> dict[_Key, tuple[float, float]]:
        """Velocity under each place, at the end of a step and its mean, over the step, that unit forces give."""
        these = tuple(places.values())
        known = [self._mobilities.get(key, ((), None))[0] for key in places]
        if not all(len(each) == len(these) and all(map(lambda a, b: a is b, each, these)) for each in known):
            rest.reset()
            rest.step(dt, load=Load.together([place.load for place in these]))
            height, velocity = rest.height, rest.velocity
            for key, place in places.items():
                found = -place.mean(velocity) / dt, max(-place.mean(height) / dt**2, 0.0)
                self._mobilities[key] = these, found
        return {key: self._mobilities[key][1] for key in places}

    def _with_trials(self, target: int) -> tuple[WaveSolver, WaveSolver, WaveSolver]:
        """A target's waves, and two solvers to try things on."""
        waves = self._waves[target]
        if target not in self._trials or self._trials[target][0] is not waves:
            self._trials[target] = waves, copy.copy(waves), copy.copy(waves)
            self._mobilities = {}
        for trial in self._trials[target][1:]:
            trial.conserve_volume = waves.conserve_volume
        return self._trials[target]

    # The contact problem

    def _problem(self, data: mujoco.MjData, pairs: Mapping[_Key, _Pair], dt: float) -> _Problem:
        """MuJoCo's rows with gaps and velocities counted from the surface, that moves as under the last force."""
        model, contact = self._coupled.model, data.contact
        pulls = self._adhesion(data)
        contacts, rows_of = [], dict.fromkeys(pairs, 0)
        touched: dict[int, list[_Pair]] = {}
        for key, each in self._touching(data).items():
            for i, _, _ in each:
                touched.setdefault(i, []).append(pairs[key])
        for i, mine in touched.items():
            first, dim = int(contact.efc_address[i]), int(contact.dim[i])
            count = 2 * (dim - 1) if model.opt.cone == PYRAMIDAL and dim > 1 else 1
            rows = slice(first, first + count)
            contacts.append(_Contact(i, rows, rows if count > 1 else slice(first, first + dim), mine))
            for pair in mine:
                rows_of[pair.key] += count
        R, aref, mobility, smooth = data.efc_R.copy(), data.efc_aref.copy(), np.zeros(data.nefc), np.zeros(data.nefc)
        mujoco.mj_mulJacVec(model, data, smooth, data.qacc_smooth)
        for i, rows, whole, mine in contacts:
            first = rows.start
            gap = data.efc_pos[first] - data.efc_margin[first] - sum(pair.height for pair in mine)
            stiffness, damping = data.efc_KBIP[first, :2]
            part = impedance(contact.solimp[i], gap)
            R[whole] *= data.efc_diagA[first] * (1 - part) / part / R[first]
            mobility[rows] = sum(pair.mobility * rows_of[pair.key] for pair in mine)
            if gap >= 0:
                aref[rows] = _OPEN
                continue
            free = sum((pair.free - pair.start) / dt + pair.mobility * pair.held for pair in mine)
            slip = data.efc_vel[rows] - sum(pair.start for pair in mine)
            aref[rows] = free - damping * slip - stiffness * part * gap
        return _Problem(contacts, R, aref, mobility, smooth, np.zeros(data.ncon) if pulls is None else pulls)

    def _solved(self, data: mujoco.MjData, problem: _Problem, dt: float) -> NDArray[np.float64]:
        """Forces of all rows, such as every pair can afford."""
        soft, force = np.zeros(data.nefc), np.zeros(data.nefc)
        for attempt in range(_ATTEMPTS):
            self._set_compliance(data, problem, problem.R + problem.mobility + soft)
            force = self._shared(data, problem, force)
            shares = self._affordable(data, problem, force, dt)
            if not shares:
                break
            gained, total = self._along(data, data.qacc) - problem.smooth, problem.total(force)
            for contact in problem.contacts:
                share = shares.get(contact.pairs[0].purse)
                if share is None:
                    continue
                # with this much added to R, and all else as it is, a row bears that share of its force
                share = max(share * (_LESS if attempt else 1), _LEAST_SHARE)
                share = share if attempt < _ATTEMPTS - 2 else _LEAST_SHARE
                rows = contact.rows
                less = (1 - share) / share
                yields = sum(pair.mobility * total[pair.key] for pair in contact.pairs)
                lost = np.maximum(gained[rows] + yields, 0) / np.where(force[rows] > 0, force[rows], np.inf)
                soft[rows] += less * (problem.R[rows] + soft[rows] + lost)
        return force

    def _set_compliance(self, data: mujoco.MjData, problem: _Problem, R: NDArray[np.float64]) -> None:
        data.efc_R[:], data.efc_D[:] = R, 1 / R
        if data.nisland:
            # the solver takes `aref` from all rows, but these from the rows of islands
            data.iefc_R[:], data.iefc_D[:] = data.efc_R[data.map_iefc2efc], data.efc_D[data.map_iefc2efc]
        contact = data.contact
        for i, rows, whole, _ in problem.contacts:
            if rows != whole:
                # an elliptic cone: friction stays what it is
                contact.mu[i] = contact.friction[i, 0] * np.sqrt(R[rows.start + 1] / R[rows.start])

    def _shared(self, data: mujoco.MjData, problem: _Problem, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """Forces of all rows, found from a guess by turns.

        The rows of a pair move the surface together: each by the sum of their forces F, while MuJoCo's R is one number
        a row. With n rows R has n times the mobility m, and the difference, m F - n m f, is that of the last round.
        """
        for _ in range(_ROUNDS):
            total, aref = problem.total(force), problem.aref + problem.mobility * force
            for contact in problem.contacts:
                aref[contact.rows] -= sum(pair.mobility * total[pair.key] for pair in contact.pairs)
            data.efc_aref[:] = aref
            mujoco.mj_fwdConstraint(self._coupled.model, data)
            last, force = force, data.efc_force.copy()
            found, least = problem.total(force), 0.0
            left = 0.0
            for contact in problem.contacts:
                for pair in contact.pairs:
                    change = found[pair.key] - total[pair.key]
                    rows = problem.mobility[contact.rows] * (force[contact.rows] - last[contact.rows])
                    left = max(left, float(np.abs(rows - pair.mobility * change).max()))
                    least = max(least, pair.mobility * abs(found[pair.key]))
            if left <= _LEFT * least:
                break
        return force

    def _affordable(
        self, data: mujoco.MjData, problem: _Problem, force: NDArray[np.float64], dt: float
    ) -> dict[_Key, float]:
        """Shares of their forces that pairs can afford, of those that cannot afford all.

        The work of a share s of a force is linear s + square s^2: at first against what moves apart without it, and
        then against what it has set in motion itself.
        """
        total, linear, square = problem.total(force), dict[_Key, float](), dict[_Key, float]()
        for pair in {pair.key: pair for contact in problem.contacts for pair in contact.pairs}.values():
            given, added = total[pair.key], pair.mean_mobility * dt
            _add(linear, pair.purse, -given * dt * (pair.mean + added * pair.held))
            _add(square, pair.purse, given * dt * added * given)
        gained = self._along(data, data.qacc) - problem.smooth
        for contact, normal in zip(problem.contacts, problem.normal(force), strict=True):
            rows, whole, purse = contact.rows, contact.whole, contact.pairs[0].purse
            at_first, later = data.efc_vel + dt / 2 * problem.smooth, dt / 2 * gained
            works = [normal * dt * float(each[rows].mean()) for each in (at_first, later)]
            aside = [
                dt * float(force[whole] @ each[whole]) - work
                for each, work in zip((at_first, later), works, strict=True)
            ]
            if sum(aside) > 0:
                # friction that drives must be paid for too
                works = [work + more for work, more in zip(works, aside, strict=True)]
            _add(linear, purse, works[0])
            _add(square, purse, works[1])
        return {
            purse: share
            for purse in linear
            if (share := _share(linear[purse], square[purse], self._paid.get(purse, 0.0))) < 1
        }

    def _along(self, data: mujoco.MjData, vector: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rows of the constraint Jacobian times a vector over the degrees of freedom."""
        product = np.zeros(data.nefc)
        mujoco.mj_mulJacVec(self._coupled.model, data, product, vector)
        return product

    def _note_work(self, data: mujoco.MjData, problem: _Problem, dt: float) -> None:
        """Note the work that contacts do on bodies, and the forces on surfaces."""
        means = data.efc_vel + dt / 2 * self._along(data, data.qacc)
        total, work = problem.total(data.efc_force), dict[_Key, float]()
        for contact, normal in zip(problem.contacts, problem.normal(data.efc_force), strict=True):
            along, whole = normal * dt * float(means[contact.rows].mean()), contact.whole
            aside = dt * float(data.efc_force[whole] @ means[whole]) - along
            _add(work, contact.pairs[0].key, along + max(aside, 0.0))
        for pair in {pair.key: pair for contact in problem.contacts for pair in contact.pairs}.values():
            self._work.append((pair, work.get(pair.key, 0.0), total[pair.key]))

    # What happens to the bodies

    def _move(self, data: mujoco.MjData, change: NDArray[np.float64], dt: float, *, pending: bool) -> None:
        """Change velocities [m/s] as the step would have, and positions with them."""
        data.qvel += change
        if not pending:
            mujoco.mj_integratePos(self._coupled.model, data.qpos, change, dt)
            data.qacc_warmstart[:] = data.qacc

    def _push(
        self, data: mujoco.MjData, solved: mujoco.MjData, touch: Touch, pair: _Pair, dt: float, *, pending: bool
    ) -> float:
        """Push a body that the risen surface has reached, so that they part no slower than they meet; the force [N]."""
        model, bodies = self._coupled.model, self._coupled.bodies
        along = np.zeros(model.nv)
        for sign, geom in ((1, touch.other), (-1, touch.target)):
            jacobian = np.zeros((3, model.nv))
            mujoco.mj_jac(model, solved, jacobian, None, touch.point, int(bodies[geom]))
            along += sign * touch.normal @ jacobian
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
        force *= _share(linear, square, self._paid.get(pair.purse, 0.0))
        self._move(data, force * dt * response[0], dt, pending=pending)
        self._work.append((pair, force * dt * ((start + end) / 2 + force * dt * light / 2), force))
        return force


def _share(linear: float, square: float, paid: float) -> float:
    """The greatest share s up to 1 whose work, linear s + square s^2, is paid for [J]."""
    if square <= 0 or linear + square <= paid + _ROUND_OFF * abs(linear):
        return 1.0
    return max(float(np.sqrt(max(linear**2 + 4 * square * paid, 0.0)) - linear) / (2 * square), 0.0)


def _add(sums: dict[_Key, float], key: _Key, value: float) -> None:
    sums[key] = sums.get(key, 0.0) + value


def _times(load: Load, factor: float) -> Load:
    return Load(load.texels, factor * load.forces)


def impedance(solimp: Iterable[float], gap: float) -> float:
    """MuJoCo's impedance d of a contact, from its `solimp` [5] and gap [m]; see "solver parameters" in its manual."""
    begin, end, width, middle, power = (float(each) for each in solimp)
    begin, end, middle = (min(max(each, _LEAST_IMPEDANCE), 1 - _LEAST_IMPEDANCE) for each in (begin, end, middle))
    if begin == end or width <= _NARROW:
        return (begin + end) / 2
    along, power = min(abs(gap) / width, 1.0), max(power, 1.0)
    if along <= middle:
        rise = along**power / middle ** (power - 1)
    else:
        rise = 1 - (1 - along) ** power / (1 - middle) ** (power - 1)
    return begin + rise * (end - begin)
