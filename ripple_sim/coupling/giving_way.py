"""Contacts with a surface that gives way: the force between a body and the waves is found with the motion of both."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Load, WaveSolver
from ripple_sim.solver.waves.footprint import footprint_at

from .contact_reader import ColliderIds
from .contacts import PYRAMIDAL
from .model import CoupledModel

# MuJoCo keeps impedances this far from 0 and 1, and takes narrower ranges for none.
_LEAST_IMPEDANCE, _TINY = 1e-4, 1e-15
# A footprint is reused while its points move by less than this share of a texel.
_SAME_PLACE = 0.3
# Up to so many contacts of a pair, what is convex presses between them too.
_MOST_CORNERS = 8
# Rounds in which contacts that share a footprint find their forces, and the share of the force that may be left.
_ROUNDS, _LEFT = 8, 1e-4
# Rounds in which pairs that cannot afford their forces get less; in the last one, this share or nearly nothing.
_ATTEMPTS, _LEAST_SHARE = 4, 1e-9
# Rows whose contact is open get this acceleration to reach: any is greater.
_OPEN = -1e10


def impedance(solimp: NDArray[np.float64], gap: float) -> float:
    """MuJoCo's impedance d of a contact, from its `solimp` [5] and gap [m]."""
    low, high = _LEAST_IMPEDANCE, 1 - _LEAST_IMPEDANCE
    begin, end, middle = (min(max(float(each), low), high) for each in solimp[[0, 1, 3]])
    width, power = float(solimp[2]), max(float(solimp[4]), 1.0)
    if begin == end or width <= _TINY:
        return (begin + end) / 2
    along = min(abs(gap) / width, 1.0)
    if along <= middle:
        rise = along**power / middle ** (power - 1)
    else:
        rise = 1 - (1 - along) ** power / (1 - middle) ** (power - 1)
    return begin + rise * (end - begin)


class _Footprint(NamedTuple):
    """Where a pair touches: points [k, 3] in the target's frame [m], and a unit force on the texels, each once."""

    points: NDArray[np.float64]
    spacing: float
    load: Load
    moved: NDArray[np.float64]  # the part of the load that moves texels


class _Pair(NamedTuple):
    """A target and what touches it: what the contact problem knows of the surface there.

    Attributes
    ----------
    key : tuple of int
        Target and other.
    footprint : _Footprint
    height : float
        Under the footprint [m].
    before, free : float
        Velocity at the beginning of the step, and at its end under the force of the last step [m/s].
    held : float
        That force [N].
    mobility : float
        Velocity at the end of a step that a unit force held over it gives, over the step [1/kg].
    moves, yields : float
        The same two for the mean velocity, which the work of a force counts.
    """

    key: tuple[int, int]
    footprint: _Footprint
    height: float
    before: float
    free: float
    held: float
    mobility: float
    moves: float
    yields: float


class _Contact(NamedTuple):
    """A contact on one target, or two: which of MuJoCo's it is, its rows that carry the normal force, its pairs."""

    index: int
    rows: slice
    pairs: tuple[int, ...]


class GivingWay:
    def __init__(self, coupled: CoupledModel, waves: Mapping[int, WaveSolver]) -> None:
        self._coupled, self._waves = coupled, waves
        self._colliders = ColliderIds(coupled)
        self._shadows: dict[int, tuple[WaveSolver, WaveSolver]] = {}
        self.clear()

    def clear(self) -> None:
        self._footprints: dict[tuple[int, int], _Footprint] = {}
        self._mobilities: dict[tuple[int, int], tuple[_Footprint, float]] = {}
        self._forces: dict[tuple[int, int], float] = {}
        self._paid: dict[tuple[int, int], float] = {}
        self._heights: dict[int, NDArray[np.float32]] = {}
        self._pairs: list[_Pair] = []
        self._work: list = []
        self.residual = 0.0

    # ------------------------------------------------------------------
    def solve(self, data: mujoco.MjData, dt: float) -> dict[int, Load]:
        model = self._coupled.model
        self._dt = dt
        contacts, footprints = self._find(data)
        self._footprints = footprints
        self._now = {t: w.height for t, w in self._waves.items()}
        self._pairs = self._surfaces(dt)
        if not contacts:
            self._forces, self._pairs, self._work = {}, [], []
            return {}
        old = data.qacc.copy()
        normal = self._solve(data, contacts, dt)
        change = dt * (data.qacc - old)
        data.qvel += change
        mujoco.mj_integratePos(model, data.qpos, change, dt)
        data.qacc_warmstart[:] = data.qacc
        self._work_of(data, contacts, normal)
        loads: dict[int, list[Load]] = {}
        self._forces = {}
        for pair, force in zip(self._pairs, self._sum(contacts, normal), strict=True):
            self._forces[pair.key] = float(force)
            if force:
                load = pair.footprint.load
                loads.setdefault(pair.key[0], []).append(Load(load.texels, force * load.forces))
        return {target: Load.together(each) for target, each in loads.items()}

    def settle(self) -> None:
        """Account for the work, when the waves have stepped."""
        for pair, (body, force) in zip(self._pairs, self._work, strict=True):
            target = pair.key[0]
            moved = self._under(pair.footprint, self._waves[target].height) - self._under(
                pair.footprint, self._now[target]
            )
            key = tuple(sorted(pair.key))
            self._paid[key] = self._paid.get(key, 0.0) - (body - force * moved)
        live = {tuple(sorted(pair.key)) for pair in self._pairs}
        self._paid = {key: paid for key, paid in self._paid.items() if key in live}
        self._heights = self._now

    # ------------------------------------------------------------------
    def _find(self, data):
        model, coupled = self._coupled.model, self._coupled
        con = data.contact
        pyramidal = model.opt.cone == PYRAMIDAL
        found, points = [], {}
        if not data.ncon:
            return [], {}
        colliders = self._colliders(data)
        for i in range(data.ncon):
            address = int(con.efc_address[i])
            if address < 0 or colliders[i].min() < 0:
                continue
            keys = []
            for side in range(2):
                target, other = int(colliders[i, side]), int(colliders[i, 1 - side])
                if target not in self._waves:
                    continue
                normal = con.frame[i, :3] * (-1 if side else 1)
                depth = min(abs(con.dist[i]), coupled.extents[target], coupled.extents[other])
                rotation = data.geom_xmat[target].reshape(3, 3)
                at = con.pos[i] + 1.5 * depth * normal - data.geom_xpos[target]
                points.setdefault((target, other), []).append((at @ rotation, normal @ rotation))
                keys.append((target, other))
            if keys:
                count = 2 * (con.dim[i] - 1) if pyramidal and con.dim[i] > 1 else 1
                found.append((i, slice(address, address + int(count)), keys))
        footprints = {key: self._footprint(key, each) for key, each in points.items()}
        order = {key: n for n, key in enumerate(footprints)}
        return [_Contact(i, rows, tuple(order[k] for k in keys)) for i, rows, keys in found], footprints

    def _footprint(self, key, touched) -> _Footprint:
        target, other = key
        atlas = self._waves[target].atlas
        points = np.array([p for p, _ in touched])
        if self._coupled.convex[other] and 1 < len(points) <= _MOST_CORNERS:
            one, two = np.triu_indices(len(points), 1)
            points = np.concatenate([points, (points[one] + points[two]) / 2])
        known = self._footprints.get(key)
        if known is not None and known.points.shape == points.shape:
            if np.abs(known.points - points).max() < _SAME_PLACE * known.spacing:
                return known
        places, texels = atlas.nearest(points)
        radius = min(self._coupled.footprint_radii[[target, other]])
        areas = atlas.areas.reshape(-1)
        parts = []
        for place, texel in zip(places, texels.tolist(), strict=True):
            each = footprint_at(atlas, place, texel, float(radius))
            parts.append(Load(each.texels, each.weights * areas[each.texels] / len(places)))
        load = Load.together(parts).merged(areas.size)
        if not atlas.mesh.closed:
            normal = touched[0][1]
            if atlas.normals.reshape(-1, 3)[texels[0]] @ normal < 0:
                load = Load(load.texels, -load.forces)
        share = self._waves[target].operator.source_share.reshape(-1)[load.texels]
        return _Footprint(points, float(np.sqrt(areas[texels[0]])), load, load.forces * share)

    def _under(self, footprint, field) -> float:
        return float(footprint.moved @ field.reshape(-1)[footprint.load.texels].astype(np.float64))

    def _surfaces(self, dt) -> list[_Pair]:
        pairs = []
        for target in dict.fromkeys(key[0] for key in self._footprints):
            keys = [key for key in self._footprints if key[0] == target]
            waves = self._waves[target]
            state = waves.state
            held = {key: self._forces.get(key, 0.0) for key in keys}
            pressed = Load.together(
                [
                    Load(self._footprints[key].load.texels, self._footprints[key].load.forces * force)
                    for key, force in held.items()
                    if force
                ]
            )
            trial, unit = self._shadow(target)
            trial.state = state
            trial.step(dt, load=pressed)
            velocity, after, final = waves.velocity, trial.height, trial.velocity
            now, before = self._now[target], self._heights.get(target)
            mobility = self._mobility(target, keys, unit, dt)
            for key in keys:
                each = self._footprints[key]
                height = self._under(each, now)
                moves = (self._under(each, after) - height) / dt
                at_end, on_mean = mobility[key]
                if at_end >= on_mean:
                    start, free = self._under(each, velocity), self._under(each, final)
                else:
                    # the surface swings back within a step: what its velocity is at the end tells nothing
                    start = 0.0 if before is None else (height - self._under(each, before)) / dt
                    free, at_end = moves, on_mean
                pairs.append(_Pair(key, each, height, start, free, held[key], at_end, moves, on_mean))
        return pairs

    def _mobility(self, target, keys, unit, dt) -> dict:
        known = [self._mobilities.get(key) for key in keys]
        if all(
            k is not None and k[0] is self._footprints[key] and k[2] == len(keys)
            for k, key in zip(known, keys, strict=True)
        ):
            return {key: k[1] for key, k in zip(keys, known, strict=True)}
        unit.reset()
        unit.step(dt, load=Load.together([self._footprints[key].load for key in keys]))
        sunk, sinks = unit.height, unit.velocity
        found = {}
        for key in keys:
            each = self._footprints[key]
            found[key] = -self._under(each, sinks) / dt, max(-self._under(each, sunk) / dt**2, 0.0)
            self._mobilities[key] = (each, found[key], len(keys))
        return found

    def _shadow(self, target):
        waves = self._waves[target]
        found = self._shadows.get(target)
        if found is None or found[0] is not waves:
            self._shadows[target] = found = (waves, copy.copy(waves), copy.copy(waves))
        found[1].conserve_volume = found[2].conserve_volume = waves.conserve_volume
        return found[1], found[2]

    # ------------------------------------------------------------------
    def _solve(self, data, contacts, dt):
        model, pairs, con = self._coupled.model, self._pairs, data.contact
        count = np.zeros(len(pairs))
        for contact in contacts:
            for p in contact.pairs:
                count[p] += contact.rows.stop - contact.rows.start
        mobility = np.array([p.mobility for p in pairs])
        n = len(contacts)
        aref0 = data.efc_aref.copy()
        stiff = np.zeros(data.nefc)
        r0 = data.efc_R.copy()
        wish = np.zeros(n)  # separation velocity that the contact law aims at
        gap_rate = np.zeros(n)
        shift = np.zeros(n)
        edge = data.efc_vel.copy()
        is_open = np.zeros(n, bool)
        for c, contact in enumerate(contacts):
            i, rows, mine = contact.index, contact.rows, [pairs[p] for p in contact.pairs]
            first = rows.start
            gap = data.efc_pos[first] - data.efc_margin[first] - sum(p.height for p in mine)
            normal_velocity = float(data.efc_vel[rows].mean())
            before, free = sum(p.before for p in mine), sum(p.free for p in mine)
            K, B = data.efc_KBIP[first, :2]
            I = impedance(con.solimp[i], gap)
            ratio = data.efc_diagA[first] * (1 - I) / I / r0[first]
            whole = slice(first, first + (rows.stop - first if rows.stop - first > 1 else con.dim[i]))
            r0[whole] *= ratio
            gap_rate[c] = normal_velocity - before
            wish[c] = (1 - B * dt) * gap_rate[c] - K * I * dt * gap
            edge[rows] = -B * (data.efc_vel[rows] - normal_velocity)
            shift[c] = (free - before) / dt + sum(p.mobility * p.held for p in mine)
            stiff[rows] = sum(p.mobility * count[k] for k, p in zip(contact.pairs, mine, strict=True))
            is_open[c] = gap >= 0
        smooth = np.zeros(data.nefc)
        mujoco.mj_mulJacVec(model, data, smooth, data.qacc_smooth)
        aim, force, soft = wish, np.zeros(data.nefc), np.zeros(data.nefc)
        for attempt in range(_ATTEMPTS):
            data.efc_R[:] = r0 + stiff + soft
            data.efc_D[:] = 1 / data.efc_R
            if data.nisland:
                # unlike the target acceleration, the solver does not gather these anew
                data.iefc_R[:], data.iefc_D[:] = data.efc_R[data.map_iefc2efc], data.efc_D[data.map_iefc2efc]
            for contact in contacts:
                first, i = contact.rows.start, contact.index
                if contact.rows.stop - first == 1 and con.dim[i] > 1:
                    con.mu[i] = con.friction[i, 0] * np.sqrt(data.efc_R[first + 1] / data.efc_R[first])
            base = aref0.copy()
            for c, contact in enumerate(contacts):
                base[contact.rows] = edge[contact.rows] + (aim[c] - gap_rate[c]) / dt + shift[c]
            for round_ in range(_ROUNDS):
                total = self._sum(contacts, self._normal(contacts, force))
                aref = base + stiff * force
                for c, contact in enumerate(contacts):
                    aref[contact.rows] -= sum(mobility[p] * total[p] for p in contact.pairs)
                    if is_open[c]:
                        aref[contact.rows] = _OPEN
                data.efc_aref[:] = aref
                mujoco.mj_fwdConstraint(model, data)
                self.solves = getattr(self, "solves", 0) + 1
                old, force = force, data.efc_force.copy()
                change = max(
                    (abs(force[c.rows] - old[c.rows]).max() if round_ or attempt else self._uneven(force, c, contacts))
                    for c in contacts
                )
                scale = max(abs(force[c.rows]).max() for c in contacts)
                if change <= _LEFT * scale:
                    break
            normal = self._normal(contacts, force)
            shares = self._affordable(data, contacts, normal, smooth, dt)
            if not shares:
                break
            self.limited = getattr(self, "limited", 0) + 1
            pulled = np.zeros(data.nefc)
            mujoco.mj_mulJacVec(model, data, pulled, data.qacc)
            pulled -= smooth
            total = self._sum(contacts, normal)
            for contact in contacts:
                share = shares.get(tuple(sorted(pairs[contact.pairs[0]].key)))
                if share is not None:
                    share = max(share, _LEAST_SHARE) if attempt < _ATTEMPTS - 2 else _LEAST_SHARE
                    rows = np.arange(contact.rows.start, contact.rows.stop)
                    yields = sum(mobility[p] * total[p] for p in contact.pairs)
                    lost = np.maximum(pulled[rows] + yields, 0) / np.maximum(force[rows], force[rows].max() * _LEAST_SHARE)
                    lost[force[rows] <= 0] = 0.0
                    soft[rows] = ((r0[rows] + soft[rows]) + (1 - share) * lost) / share - r0[rows]
        return normal

    def _affordable(self, data, contacts, normal, smooth, dt) -> dict:
        """Parts of their forces that pairs can afford, of those that cannot afford all of them."""
        accelerations = np.zeros(data.nefc)
        mujoco.mj_mulJacVec(self._coupled.model, data, accelerations, data.qacc)
        total = self._sum(contacts, normal)
        made: dict = {}
        for pair, force in zip(self._pairs, total, strict=True):
            work = made.setdefault(tuple(sorted(pair.key)), [0.0, 0.0])
            none = pair.moves + pair.yields * dt * pair.held
            work[0] -= force * dt * none
            work[1] -= force * dt * (none - pair.yields * dt * force)
        for contact, force in zip(contacts, normal, strict=True):
            work, rows = made[tuple(sorted(self._pairs[contact.pairs[0]].key))], contact.rows
            work[0] += force * dt * float((data.efc_vel[rows] + dt / 2 * smooth[rows]).mean())
            work[1] += force * dt * float((data.efc_vel[rows] + dt / 2 * accelerations[rows]).mean())
        shares = {}
        for key, (linear, whole) in made.items():
            paid = max(self._paid.get(key, 0.0), 0.0)
            square = whole - linear
            if whole > paid + 1e-6 * abs(linear) and square > 0:
                shares[key] = (np.sqrt(linear**2 + 4 * square * paid) - linear) / (2 * square)
        return shares

    def _uneven(self, force, contact, contacts):
        # the first round is exact where all rows of the pair bear alike
        mine = [force[c.rows] for c in contacts if set(c.pairs) & set(contact.pairs)]
        all_ = np.concatenate(mine)
        return abs(all_ - all_.mean()).max()

    def _work_of(self, data, contacts, normal):
        now = np.zeros(data.nefc)
        mujoco.mj_mulJacVec(self._coupled.model, data, now, data.qvel)
        total = self._sum(contacts, normal)
        work = [[0.0, float(force)] for force in total]
        for contact, force in zip(contacts, normal, strict=True):
            work[contact.pairs[0]][0] += (
                force * self._dt * float((data.efc_vel[contact.rows] + now[contact.rows]).mean()) / 2
            )
        self._work = work

    def _normal(self, contacts, force):
        return np.array([force[c.rows].sum() for c in contacts])

    def _sum(self, contacts, normal):
        total = np.zeros(len(self._pairs))
        for contact, force in zip(contacts, normal, strict=True):
            for p in contact.pairs:
                total[p] += force
        return total
