"""The energy of bodies and waves, and a contact problem whose forces do not let it rise.

Surfaces give way in the contact problem: each row of MuJoCo's constraint solver gets the gap, the
velocity and the mobility of the surfaces that it presses on. A pair pays in the energy that its
contacts take from the motion of body and surface, and gets back no more than it has paid in. Forces
that would take more are reduced (a passivity observer and controller: Hannaford and Ryu, 2002).
`VelocityChange` computes how new forces change the velocities, by MuJoCo's own integrators.
"""

from __future__ import annotations

import copy
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from ripple_sim.solver.kernel import Floats

from .contacts import adhesion, is_pyramidal
from .ids import ColliderId, TargetId

_INTEGRATORS = mujoco.mjtIntegrator

# Rounds that find the velocity at the beginning of a step from the velocity at its end.
_START_ROUNDS = 3

# MuJoCo keeps impedances this far from 0 and 1: `mjMINIMP`.
_MIN_IMPEDANCE = 1e-4
# MuJoCo's impedance is constant if the width of a `solimp` is below this [m]: `mjMINVAL`.
_MIN_WIDTH = 1e-15

# Rounds in which contacts that share a footprint find their forces.
_SHARING_ROUNDS = 8
# The rounds end if the accelerations that the forces give differ by less than this share.
_SHARING_TOLERANCE = 1e-4

# Attempts to reduce the forces of pairs that cannot afford them.
_AFFORDING_ATTEMPTS = 6
# From the second attempt on a pair gets this part of the share that it can afford.
_CAUTION = 0.95
# The least share of a force. In the last two attempts all pairs that cannot afford their forces get
# this share.
_MIN_SHARE = 1e-9

# A difference of two works below this share of the work is round-off.
_WORK_ROUND_OFF = 1e-6

# Acceleration that the rows of an open contact aim at [m/s^2]: any real one is greater, so that the
# rows do not push.
_OPEN_ACCELERATION = -1e10

# A pair: a target, and the collider that touches it.
Key = tuple[TargetId, ColliderId]
# The energy account of a pair: its two ids in ascending order, since the two pairs of two targets
# that touch each other share one account.
Purse = tuple[ColliderId, ColliderId]


class Energy(NamedTuple):
    """Energy of a simulation [J].

    Attributes
    ----------
    bodies : float
        Kinetic and potential energy, of gravity and of springs; see `body_energy`.
    waves : float
        Of all targets, see `WaveSolver.energy`.
    """

    bodies: float
    waves: float

    @property
    def total(self) -> float:
        """Energy of bodies and waves [J]."""
        return self.bodies + self.waves


def body_energy(data: mujoco.MjData, scratch: mujoco.MjData) -> float:
    """Kinetic and potential energy of MuJoCo's bodies at one time [J].

    MuJoCo's semi-implicit steps leave velocities half a step behind positions. The potential is
    taken half a step back: under uniform gravity the sum is then constant to round-off, while that
    of `mujoco.mj_energyPos` and `mj_energyVel` differs on the way up from that on the way down.
    With the integrator RK4 both are of the same time already.

    Parameters
    ----------
    data : mujoco.MjData
    scratch : mujoco.MjData
        Of the same model; overwritten.
    """
    model = scratch.model

    def update() -> None:
        for compute in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_flex, mujoco.mj_tendon):
            compute(model, scratch)

    for name in ("qpos", "qvel", "mocap_pos", "mocap_quat"):
        getattr(scratch, name)[:] = getattr(data, name)
    update()
    mujoco.mj_makeM(model, scratch)
    mujoco.mj_energyVel(model, scratch)
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        mujoco.mj_integratePos(model, scratch.qpos, scratch.qvel, -model.opt.timestep / 2)
        update()
    mujoco.mj_energyPos(model, scratch)
    return float(scratch.energy.sum())


class VelocityChange:
    """The change of the velocities after a step if other contact forces had acted.

    MuJoCo's integrators are implicit in joint damping, and some also in the gyroscopic terms of
    spinning bodies: velocities then change by another mass matrix than accelerations, and forces
    of the rigid solution, taken back, would leave a difference behind.

    Attributes
    ----------
    latest : float64 [nv], optional
        The velocities with which the next step begins, unless the user changes them.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.latest: Floats | None = None
        self._model = model
        self._scratch: mujoco.MjData | None = None

    def __call__(
        self, data: mujoco.MjData, qacc: Floats, force: Floats, *, pending: bool
    ) -> Floats:
        """Change of velocities [nv].

        Parameters
        ----------
        data : mujoco.MjData
            With the new accelerations and constraint forces.
        qacc, force : float64 [nv]
            The old ones.
        pending : bool
            Whether the velocities are those before the step.
        """
        dt = self._model.opt.timestep
        integrator = self._model.opt.integrator
        if integrator in (_INTEGRATORS.mjINT_IMPLICIT, _INTEGRATORS.mjINT_IMPLICITFAST):
            integrate = mujoco.mj_implicit
        elif integrator == _INTEGRATORS.mjINT_EULER and self._model.dof_damping.any():
            integrate = mujoco.mj_Euler
        else:
            return np.asarray(dt * (data.qacc - qacc))
        if self._scratch is None:
            self._scratch = copy.copy(data)
        scratch = self._scratch

        def end(start: Floats, acceleration: Floats, forces: Floats) -> Floats:
            """Velocities at the end of a step from those at its start."""
            mujoco.mj_copyData(scratch, self._model, data)
            scratch.qvel[:] = start
            scratch.qacc[:] = acceleration
            scratch.qfrc_constraint[:] = forces
            integrate(self._model, scratch)
            return scratch.qvel.copy()

        if pending:
            start = data.qvel
        elif self.latest is not None:
            start = self.latest
        else:
            start = data.qvel - dt * qacc
        old_end = end(start, qacc, force)
        for _ in range(0 if pending else _START_ROUNDS):
            if np.array_equal(old_end, data.qvel):
                break
            start = start + data.qvel - old_end
            old_end = end(start, qacc, force)
        return end(start, data.qacc, data.qfrc_constraint) - old_end


class Pair(NamedTuple):
    """How a target's surface moves under a collider that touches it, for the contact problem.

    Attributes
    ----------
    key : tuple of int
        Target and other.
    height : float
        Of the surface [m].
    held_force : float
        Force of the last step [N].
    start_velocity : float
        Velocity of the surface at the beginning of the step [m/s].
    end_velocity : float
        Velocity at the end of the step under the force of the last step [m/s].
    mobility : float
        Change of the velocity at the end by a unit force, over the step [1/kg].
    mean_velocity : float
        Mean velocity over the step under the force of the last step [m/s].
    mean_mobility : float
        Change of the mean velocity by a unit force, over the step [1/kg].
    """

    key: Key
    height: float
    held_force: float
    start_velocity: float
    end_velocity: float
    mobility: float
    mean_velocity: float
    mean_mobility: float

    @property
    def purse(self) -> Purse:
        """The pair's account; the two pairs of two targets that touch each other share one."""
        return min(self.key), max(self.key)


class Work(NamedTuple):
    """The work of a pair's force in a step.

    Attributes
    ----------
    pair : Pair
    on_bodies : float
        Work of the pair's contacts on the bodies [J].
    force : float
        On the surface [N].
    """

    pair: Pair
    on_bodies: float
    force: float


class _Rows(NamedTuple):
    """The rows of the constraint solver for one of MuJoCo's contacts.

    Attributes
    ----------
    contact : int
        Among MuJoCo's contacts.
    normal : slice
        The rows that carry the normal force.
    all : slice
        Also the rows of friction.
    pairs : sequence of Pair
        One for each target that the contact presses.
    """

    contact: int
    normal: slice
    all: slice
    pairs: Sequence[Pair]


class DualDiagonal:
    """The diagonal of A + R, the matrix of MuJoCo's dual problem; A is the rows' inverse mass.

    The solver PGS and the noslip iterations read R from there and not from `efc_R`. Newton and CG
    make no such matrix.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._rows = np.arange(data.nefc if len(data.efc_AR) else 0)
        if mujoco.mj_isSparse(model) and len(self._rows):
            row_of_entry = np.repeat(self._rows, data.efc_AR_rownnz)
            self._entries = np.flatnonzero(data.efc_AR_colind[: len(row_of_entry)] == row_of_entry)
            self._rows = row_of_entry[self._entries]
        else:
            self._entries = self._rows * (data.nefc + 1)
        self._A = data.efc_AR[self._entries] - data.efc_R[self._rows]

    def set_compliance(self, data: mujoco.MjData, R: Floats) -> None:
        """Take other regularizations R [1/kg], one a row."""
        data.efc_AR[self._entries] = self._A + R[self._rows]


class ContactProblem:
    """MuJoCo's contact problem with gaps and velocities counted from the moving surfaces.

    The surfaces move as under the forces of the last step.

    Parameters
    ----------
    model : mujoco.MjModel
    data : mujoco.MjData
        With the contacts of the step; gets the new forces.
    pairs_at : mapping
        MuJoCo's index of each contact to the pairs that it belongs to.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, pairs_at: Mapping[int, Sequence[Pair]]
    ) -> None:
        self._model = model
        self._data = data
        self._dt = model.opt.timestep
        pulls = adhesion(model, data)
        self._pulls = np.zeros(data.ncon) if pulls is None else pulls
        self._pairs: dict[Key, Pair] = {}
        for pairs in pairs_at.values():
            self._pairs |= {pair.key: pair for pair in pairs}
        self._contacts = [self._rows(i, pairs) for i, pairs in pairs_at.items()]
        # the rows' regularization [1/kg] and reference acceleration [m/s^2], on surfaces without
        # mobility
        self._R = data.efc_R.copy()
        self._aref = data.efc_aref.copy()
        # mobility of each row [1/kg] if all rows of its pairs bear the same force
        self._mobility = np.zeros(data.nefc)
        self._dual = DualDiagonal(model, data)
        # acceleration of the rows without contacts [m/s^2]
        self._smooth = self._in_rows(data.qacc_smooth)
        row_count = dict.fromkeys(self._pairs, 0)
        for rows in self._contacts:
            for pair in rows.pairs:
                row_count[pair.key] += rows.normal.stop - rows.normal.start
        for rows in self._contacts:
            mobility = sum(pair.mobility * row_count[pair.key] for pair in rows.pairs)
            self._mobility[rows.normal] = mobility
            self._count_from_surface(rows)

    def _rows(self, i: int, pairs: Sequence[Pair]) -> _Rows:
        """The rows of one of MuJoCo's contacts, which presses the targets of some pairs."""
        first = int(self._data.contact.efc_address[i])
        dim = int(self._data.contact.dim[i])
        if is_pyramidal(self._model) and dim > 1:
            edges = slice(first, first + 2 * (dim - 1))
            return _Rows(i, edges, edges, pairs)
        return _Rows(i, slice(first, first + 1), slice(first, first + dim), pairs)

    def _count_from_surface(self, rows: _Rows) -> None:
        """Set R and the reference acceleration of a contact, with gap and velocity of the surface.

        MuJoCo's spring and damper act on the gap above the displaced surface, and on the velocity
        against it.
        """
        data = self._data
        pairs = rows.pairs
        first = rows.normal.start
        gap = data.efc_pos[first] - data.efc_margin[first] - sum(pair.height for pair in pairs)
        stiffness, damping = data.efc_KBIP[first, :2]
        d = impedance(data.contact.solimp[rows.contact], gap)
        self._R[rows.all] *= data.efc_diagA[first] * (1 - d) / d / self._R[first]
        if gap >= 0:
            self._aref[rows.normal] = _OPEN_ACCELERATION
            return
        # acceleration of the surface without a force [m/s^2]
        free = sum(
            (pair.end_velocity - pair.start_velocity) / self._dt + pair.mobility * pair.held_force
            for pair in pairs
        )
        slip = data.efc_vel[rows.normal] - sum(pair.start_velocity for pair in pairs)
        self._aref[rows.normal] = free - damping * slip - stiffness * d * gap

    def solve(self, paid: Mapping[Purse, float]) -> dict[Key, float]:
        """Force on each target in a pair [N], which every pair can afford.

        Parameters
        ----------
        paid : mapping
            Energy that pairs have paid in [J], by `Pair.purse`.
        """
        data = self._data
        # added to R so that rows carry less force [1/kg]
        softness = np.zeros(data.nefc)
        force = np.zeros(data.nefc)
        for attempt in range(_AFFORDING_ATTEMPTS):
            self._set_compliance(self._R + self._mobility + softness)
            force = self._forces_of_pairs(force)
            shares = self._affordable(force, paid)
            if not shares:
                break
            for purse, share in shares.items():
                if attempt >= _AFFORDING_ATTEMPTS - 2:
                    share = 0.0
                elif attempt:
                    share = share * _CAUTION
                shares[purse] = max(share, _MIN_SHARE)
            self._soften(softness, force, shares)
        return self._total(force)

    def _soften(self, softness: Floats, force: Floats, shares: Mapping[Purse, float]) -> None:
        """Add to the softness of rows so that they carry shares of their forces.

        Parameters
        ----------
        softness : float64 [nefc]
            Updated [1/kg].
        force : float64 [nefc]
            Forces of all rows with the present softness [N].
        shares : mapping
            Share of its forces that an account gets; the forces of the others stay.
        """
        by_forces = self._in_rows(self._data.qacc) - self._smooth  # [m/s^2]
        total = self._total(force)
        for rows in self._contacts:
            share = shares.get(rows.pairs[0].purse)
            if share is None:
                continue
            normal = rows.normal
            by_surfaces = sum(pair.mobility * total[pair.key] for pair in rows.pairs)
            divisor = np.where(force[normal] > 0, force[normal], np.inf)
            mobility = np.maximum(by_forces[normal] + by_surfaces, 0) / divisor
            # with this added to R, and other rows unchanged, a row carries its share
            factor = (1 - share) / share
            softness[normal] += factor * (self._R[normal] + softness[normal] + mobility)

    def works(self) -> list[Work]:
        """The work of each pair, with the forces that were found."""
        force = self._data.efc_force
        work = defaultdict[Key, float](float)
        mean_velocity = self._data.efc_vel + self._dt / 2 * self._in_rows(self._data.qacc)
        for rows, normal in zip(self._contacts, self._normal(force), strict=True):
            normal_work = normal * self._dt * float(mean_velocity[rows.normal].mean())
            total_work = self._dt * float(force[rows.all] @ mean_velocity[rows.all])
            friction_work = total_work - normal_work
            work[rows.pairs[0].key] += normal_work + max(friction_work, 0.0)
        total = self._total(force)
        return [Work(pair, work[key], total[key]) for key, pair in self._pairs.items()]

    def _normal(self, force: Floats) -> list[float]:
        """Normal force of each contact on its bodies, less the pull of adhesion [N]."""
        return [
            float(force[rows.normal].sum() - self._pulls[rows.contact]) for rows in self._contacts
        ]

    def _total(self, force: Floats) -> dict[Key, float]:
        """Force on each target in a pair [N]."""
        total = defaultdict[Key, float](float)
        for rows, normal in zip(self._contacts, self._normal(force), strict=True):
            for pair in rows.pairs:
                total[pair.key] += normal
        return total

    def _in_rows(self, vector: Floats) -> Floats:
        """The motion of all rows, [nefc], from that of the degrees of freedom, [nv]."""
        product = np.zeros(self._data.nefc)
        mujoco.mj_mulJacVec(self._model, self._data, product, vector)
        return product

    def _set_compliance(self, R: Floats) -> None:
        """Give the solver other regularizations R of all rows [1/kg]."""
        data = self._data
        contact = self._data.contact
        data.efc_R[:] = R
        data.efc_D[:] = 1 / R
        if data.nisland:
            # the solver takes `aref` from all rows, but R and D from the rows of islands
            data.iefc_R[:] = data.efc_R[data.map_iefc2efc]
            data.iefc_D[:] = data.efc_D[data.map_iefc2efc]
        self._dual.set_compliance(data, R)
        for i, normal, all_rows, _ in self._contacts:
            if normal != all_rows:
                # an elliptic cone: keep the friction
                ratio = R[normal.start + 1] / R[normal.start]
                contact.mu[i] = contact.friction[i, 0] * np.sqrt(ratio)

    def _forces_of_pairs(self, force: Floats) -> Floats:
        """Forces of all rows [N], found from a guess in rounds.

        The surface under a pair moves by the sum F of the forces f of all its n rows, but MuJoCo's
        R acts on the force of one row. So R gets n times the mobility m, and the reference
        acceleration gets the difference m F - n m f, with the forces of the last round.
        """
        data = self._data
        for _ in range(_SHARING_ROUNDS):
            total = self._total(force)
            aref = self._aref + self._mobility * force
            for rows in self._contacts:
                aref[rows.normal] -= sum(pair.mobility * total[pair.key] for pair in rows.pairs)
            data.efc_aref[:] = aref
            mujoco.mj_fwdConstraint(self._model, data)
            force_before = force
            force = data.efc_force.copy()
            if self._agree(force, force_before, total):
                break
        return force

    def _agree(
        self, force: Floats, force_before: Floats, total_before: Mapping[Key, float]
    ) -> bool:
        """Whether rows move the surfaces as the sums of their forces do, after a round.

        Parameters
        ----------
        force, force_before : float64 [nefc]
            Forces of all rows after the round, and before it [N].
        total_before : mapping
            Force on each target in a pair before the round [N].
        """
        total = self._total(force)
        # accelerations [m/s^2]
        greatest = 0.0
        greatest_difference = 0.0
        for rows in self._contacts:
            normal = rows.normal
            by_rows = self._mobility[normal] * (force[normal] - force_before[normal])
            for pair in rows.pairs:
                by_pair = pair.mobility * (total[pair.key] - total_before[pair.key])
                difference = float(np.abs(by_rows - by_pair).max())
                greatest_difference = max(greatest_difference, difference)
                greatest = max(greatest, pair.mobility * abs(total[pair.key]))
        return greatest_difference <= _SHARING_TOLERANCE * greatest

    def _affordable(self, force: Floats, paid: Mapping[Purse, float]) -> dict[Purse, float]:
        """Share of its forces that each account can afford, where it cannot afford all.

        The work of a share s of a force is linear s + square s^2: the first part against the
        motion without the force, the second against the motion that the force itself makes.
        """
        data = self._data
        dt = self._dt
        total = self._total(force)
        linear = defaultdict[Purse, float](float)
        square = defaultdict[Purse, float](float)
        for pair in self._pairs.values():
            pair_force = total[pair.key]
            velocity_per_force = pair.mean_mobility * dt  # [m/s/N]
            mean_velocity = pair.mean_velocity + velocity_per_force * pair.held_force
            linear[pair.purse] += -pair_force * dt * mean_velocity
            square[pair.purse] += pair_force * dt * velocity_per_force * pair_force
        # mean velocity of the bodies without the forces, and by the forces [m/s]
        motions = (
            data.efc_vel + dt / 2 * self._smooth,
            dt / 2 * (self._in_rows(data.qacc) - self._smooth),
        )
        for rows, normal in zip(self._contacts, self._normal(force), strict=True):
            row_forces = force[rows.all]
            # works of the normal force and of all rows, in both motions [J]
            normal_works = np.zeros(2)
            all_works = np.zeros(2)
            for i, velocity in enumerate(motions):
                normal_works[i] = normal * dt * float(velocity[rows.normal].mean())
                all_works[i] = dt * float(row_forces @ velocity[rows.all])
            friction_works = all_works - normal_works
            works = normal_works
            if friction_works.sum() > 0:
                works = normal_works + friction_works  # friction that drives must be paid for too
            purse = rows.pairs[0].purse
            linear[purse] += float(works[0])
            square[purse] += float(works[1])
        shares = {}
        for purse in linear:
            share = affordable_share(linear[purse], square[purse], paid.get(purse, 0.0))
            if share < 1:
                shares[purse] = share
        return shares


def affordable_share(linear: float, square: float, paid: float) -> float:
    """The greatest share s up to 1 whose work, linear s + square s^2, is paid for [J]."""
    if square <= 0 or linear + square <= paid + _WORK_ROUND_OFF * abs(linear):
        return 1.0
    root = np.sqrt(max(linear**2 + 4 * square * paid, 0.0))
    return max(float(root - linear) / (2 * square), 0.0)


def _as_impedance(value: float) -> float:
    """A value as near as MuJoCo lets an impedance come to 0 and 1."""
    return min(max(value, _MIN_IMPEDANCE), 1 - _MIN_IMPEDANCE)


def impedance(solimp: Iterable[float], gap: float) -> float:
    """MuJoCo's impedance d of a contact, from its `solimp` [5] and its gap [m].

    See "Solver parameters" in MuJoCo's manual.
    """
    begin, end, width, middle, power = (float(value) for value in solimp)
    begin = _as_impedance(begin)
    end = _as_impedance(end)
    middle = _as_impedance(middle)
    if begin == end or width <= _MIN_WIDTH:
        return (begin + end) / 2
    along = min(abs(gap) / width, 1.0)
    power = max(power, 1.0)
    if along <= middle:
        rise = along**power / middle ** (power - 1)
    else:
        rise = 1 - (1 - along) ** power / (1 - middle) ** (power - 1)
    return begin + rise * (end - begin)
