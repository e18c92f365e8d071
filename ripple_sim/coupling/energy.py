"""The energy of bodies and waves together, and the contact problem, solved again so that this energy does not rise.

Surfaces give way in the problem: each row of MuJoCo's constraint solver gets the gap, the velocity
and the mobility of the surfaces that it presses on. A pair pays in what its contacts take from the
motion of body and surface, and gets back no more than that. Forces that would take more are
lessened (a passivity observer and controller: Hannaford and Ryu, 2002). What new forces change in
velocities is told as MuJoCo's own scheme has it.
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

_INTEGRATORS = mujoco.mjtIntegrator

# Rounds in which the velocity at the beginning of a step is found from that at its end.
_START_ROUNDS = 3

# MuJoCo keeps impedances this far from 0 and 1, and takes narrower ranges for none.
_LEAST_IMPEDANCE = 1e-4
_NARROW = 1e-15

# Rounds in which contacts that share a footprint find their forces, and the share of a force that
# may be left.
_ROUNDS = 8
_LEFT = 1e-4

# Rounds in which pairs that cannot afford their forces get a share of them, after the first a
# little less than they can afford, and in the last one the least.
_ATTEMPTS = 6
_LESS = 0.95
_LEAST_SHARE = 1e-9

# A difference of work that round-off makes, as a share of it.
_ROUND_OFF = 1e-6

# Acceleration that the rows of an open contact aim at: any is greater, so that they do not push.
_OPEN = -1e10


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
    """Kinetic and potential energy of MuJoCo's bodies [J], at one time; `scratch` is data of the same model.

    MuJoCo's semi-implicit steps leave velocities half a step behind positions. The potential is
    taken half a step back: under uniform gravity the sum is then constant to round-off, while that
    of `mujoco.mj_energyPos` and `mj_energyVel` differs on the way up from that on the way down.
    With the integrator RK4 both are of the same time already.
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
    """What other contact forces would have changed in the velocities after a step.

    MuJoCo's integrators are implicit in joint damping, and some in the gyroscopic terms of what
    spins: velocities then change by another mass matrix than accelerations tell, and forces that
    are taken back would leave a rest behind.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._scratch: mujoco.MjData | None = None
        # the velocities with which the next step begins, unless somebody changes them
        self.latest: Floats | None = None

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
            mujoco.mj_copyData(scratch, self._model, data)
            scratch.qvel[:] = start
            scratch.qacc[:] = acceleration
            scratch.qfrc_constraint[:] = forces
            integrate(self._model, scratch)
            return scratch.qvel.copy()

        start = (
            data.qvel
            if pending
            else self.latest
            if self.latest is not None
            else data.qvel - dt * qacc
        )
        old = end(start, qacc, force)
        for _ in range(0 if pending else _START_ROUNDS):
            if np.array_equal(old, data.qvel):
                break
            start = start + data.qvel - old
            old = end(start, qacc, force)
        return end(start, data.qacc, data.qfrc_constraint) - old


# Of a target, and of what touches it.
Key = tuple[int, int]


class Pair(NamedTuple):
    """A target and what touches it: what the contact problem has to know of the surface there.

    Attributes
    ----------
    key : tuple of int
        Target and other.
    height : float
        Of the surface [m].
    held : float
        Force of the last step [N].
    start, free, mobility : float
        Velocity of the surface at the beginning of the step, and at its end under the force of the
        last step [m/s]; and what a unit force adds to it, over the step [1/kg].
    mean, mean_mobility : float
        The last two for the mean velocity over the step.
    """

    key: Key
    height: float
    held: float
    start: float
    free: float
    mobility: float
    mean: float
    mean_mobility: float

    @property
    def purse(self) -> Key:
        """Who pays: the same for the two pairs of two targets that touch each other."""
        return min(self.key), max(self.key)


class Work(NamedTuple):
    """What the force of a pair does in a step.

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


class DualDiagonal:
    """The diagonal of A + R, the matrix of MuJoCo's dual problem, with A the inverse mass that each row feels.

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
    """MuJoCo's rows with gaps and velocities counted from surfaces that move as under the last force.

    Parameters
    ----------
    model : mujoco.MjModel
    data : mujoco.MjData
        With the contacts of the step; gets the forces that are found.
    pairs_at : mapping
        MuJoCo's index of each contact to the pairs that it belongs to.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, pairs_at: Mapping[int, Sequence[Pair]]
    ) -> None:
        self._model = model
        self._data = data
        self._dt = model.opt.timestep
        contact = data.contact
        pulls = adhesion(model, data)
        self._pulls = np.zeros(data.ncon) if pulls is None else pulls
        self._pairs = {pair.key: pair for mine in pairs_at.values() for pair in mine}
        rows_of = dict.fromkeys(self._pairs, 0)
        # of each contact: which of MuJoCo's, its rows that carry the normal force, all its rows, a
        # pair for each target
        self._contacts: list[tuple[int, slice, slice, Sequence[Pair]]] = []
        for i, mine in pairs_at.items():
            first = int(contact.efc_address[i])
            dim = int(contact.dim[i])
            count = 2 * (dim - 1) if is_pyramidal(model) and dim > 1 else 1
            rows = slice(first, first + count)
            self._contacts.append((i, rows, rows if count > 1 else slice(first, first + dim), mine))
            for pair in mine:
                rows_of[pair.key] += count
        # as they are without mobility, and what each row would add if all rows of its pairs bore
        # alike [1/kg]
        self._R = data.efc_R.copy()
        self._aref = data.efc_aref.copy()
        self._mobility = np.zeros(data.nefc)
        self._dual = DualDiagonal(model, data)
        # acceleration without contacts [m/s^2]
        self._smooth = self._along(data.qacc_smooth)
        for i, rows, whole, mine in self._contacts:
            first = rows.start
            gap = data.efc_pos[first] - data.efc_margin[first] - sum(pair.height for pair in mine)
            stiffness, damping = data.efc_KBIP[first, :2]
            part = impedance(contact.solimp[i], gap)
            self._R[whole] *= data.efc_diagA[first] * (1 - part) / part / self._R[first]
            self._mobility[rows] = sum(pair.mobility * rows_of[pair.key] for pair in mine)
            if gap >= 0:
                self._aref[rows] = _OPEN
                continue
            free = sum(
                (pair.free - pair.start) / self._dt + pair.mobility * pair.held for pair in mine
            )
            slip = data.efc_vel[rows] - sum(pair.start for pair in mine)
            self._aref[rows] = free - damping * slip - stiffness * part * gap

    def solve(self, paid: Mapping[Key, float]) -> dict[Key, float]:
        """Force on each target in a pair [N], such as every pair can afford with what it has paid in [J]."""
        data = self._data
        soft = np.zeros(data.nefc)
        force = np.zeros(data.nefc)
        for attempt in range(_ATTEMPTS):
            self._set_compliance(self._R + self._mobility + soft)
            force = self._shared(force)
            shares = self._affordable(force, paid)
            if not shares:
                break
            gained = self._along(data.qacc) - self._smooth
            total = self._total(force)
            for _, rows, _, mine in self._contacts:
                share = shares.get(mine[0].purse)
                if share is None:
                    continue
                # with this much added to R, and all else as it is, a row bears that share of its
                # force
                share = max(share * (_LESS if attempt else 1), _LEAST_SHARE)
                share = share if attempt < _ATTEMPTS - 2 else _LEAST_SHARE
                less = (1 - share) / share
                yields = sum(pair.mobility * total[pair.key] for pair in mine)
                lost = np.maximum(gained[rows] + yields, 0) / np.where(
                    force[rows] > 0, force[rows], np.inf
                )
                soft[rows] += less * (self._R[rows] + soft[rows] + lost)
        return self._total(force)

    def works(self) -> list[Work]:
        """What the force of each pair does, with the forces that were found."""
        force = self._data.efc_force
        work = defaultdict[Key, float](float)
        means = self._data.efc_vel + self._dt / 2 * self._along(self._data.qacc)
        for (_, rows, whole, mine), normal in zip(self._contacts, self._normal(force), strict=True):
            along = normal * self._dt * float(means[rows].mean())
            aside = self._dt * float(force[whole] @ means[whole]) - along
            work[mine[0].key] += along + max(aside, 0.0)
        total = self._total(force)
        return [Work(pair, work[key], total[key]) for key, pair in self._pairs.items()]

    def _normal(self, force: Floats) -> list[float]:
        """Normal force of each contact on its bodies, without what adhesion takes of it [N]."""
        return [float(force[rows].sum() - self._pulls[i]) for i, rows, _, _ in self._contacts]

    def _total(self, force: Floats) -> dict[Key, float]:
        """Force on each target in a pair [N]."""
        total = defaultdict[Key, float](float)
        for (*_, mine), normal in zip(self._contacts, self._normal(force), strict=True):
            for pair in mine:
                total[pair.key] += normal
        return total

    def _along(self, vector: Floats) -> Floats:
        """Rows of the constraint Jacobian times a vector over the degrees of freedom."""
        product = np.zeros(self._data.nefc)
        mujoco.mj_mulJacVec(self._model, self._data, product, vector)
        return product

    def _set_compliance(self, R: Floats) -> None:
        data = self._data
        contact = self._data.contact
        data.efc_R[:] = R
        data.efc_D[:] = 1 / R
        if data.nisland:
            # the solver takes `aref` from all rows, but these from the rows of islands
            data.iefc_R[:], data.iefc_D[:] = (
                data.efc_R[data.map_iefc2efc],
                data.efc_D[data.map_iefc2efc],
            )
        self._dual.set_compliance(data, R)
        for i, rows, whole, _ in self._contacts:
            if rows != whole:
                # an elliptic cone: friction stays what it is
                contact.mu[i] = contact.friction[i, 0] * np.sqrt(R[rows.start + 1] / R[rows.start])

    def _shared(self, force: Floats) -> Floats:
        """Forces of all rows, found from a guess by turns.

        The rows of a pair move the surface together: each by the sum of their forces F, while
        MuJoCo's R is one number a row. With n rows R has n times the mobility m, and the
        difference, m F - n m f, is that of the last round.
        """
        data = self._data
        for _ in range(_ROUNDS):
            total = self._total(force)
            aref = self._aref + self._mobility * force
            for _, rows, _, mine in self._contacts:
                aref[rows] -= sum(pair.mobility * total[pair.key] for pair in mine)
            data.efc_aref[:] = aref
            mujoco.mj_fwdConstraint(self._model, data)
            last = force
            force = data.efc_force.copy()
            found = self._total(force)
            least = 0.0
            left = 0.0
            for _, rows, _, mine in self._contacts:
                moved = self._mobility[rows] * (force[rows] - last[rows])
                for pair in mine:
                    change = found[pair.key] - total[pair.key]
                    left = max(left, float(np.abs(moved - pair.mobility * change).max()))
                    least = max(least, pair.mobility * abs(found[pair.key]))
            if left <= _LEFT * least:
                break
        return force

    def _affordable(self, force: Floats, paid: Mapping[Key, float]) -> dict[Key, float]:
        """Shares of their forces that pairs can afford, of those that cannot afford all.

        The work of a share s of a force is linear s + square s^2: at first against what moves apart
        without it, and then against what it has set in motion itself.
        """
        data = self._data
        dt = self._dt
        total = self._total(force)
        linear = defaultdict[Key, float](float)
        square = defaultdict[Key, float](float)
        for pair in self._pairs.values():
            given = total[pair.key]
            added = pair.mean_mobility * dt
            linear[pair.purse] += -given * dt * (pair.mean + added * pair.held)
            square[pair.purse] += given * dt * added * given
        motions = (
            data.efc_vel + dt / 2 * self._smooth,
            dt / 2 * (self._along(data.qacc) - self._smooth),
        )
        for (_, rows, whole, mine), normal in zip(self._contacts, self._normal(force), strict=True):
            works = np.array([normal * dt * float(motion[rows].mean()) for motion in motions])
            aside = (
                np.array([dt * float(force[whole] @ motion[whole]) for motion in motions]) - works
            )
            if aside.sum() > 0:
                works += aside  # friction that drives must be paid for too
            linear[mine[0].purse] += float(works[0])
            square[mine[0].purse] += float(works[1])
        shares = {
            each: affordable_share(linear[each], square[each], paid.get(each, 0.0))
            for each in linear
        }
        return {purse: share for purse, share in shares.items() if share < 1}


def affordable_share(linear: float, square: float, paid: float) -> float:
    """The greatest share s up to 1 whose work, linear s + square s^2, is paid for [J]."""
    if square <= 0 or linear + square <= paid + _ROUND_OFF * abs(linear):
        return 1.0
    return max(float(np.sqrt(max(linear**2 + 4 * square * paid, 0.0)) - linear) / (2 * square), 0.0)


def impedance(solimp: Iterable[float], gap: float) -> float:
    """MuJoCo's impedance d of a contact, from its `solimp` [5] and gap [m]; see "solver parameters" in its manual."""
    begin, end, width, middle, power = (float(each) for each in solimp)
    begin, end, middle = (
        min(max(each, _LEAST_IMPEDANCE), 1 - _LEAST_IMPEDANCE) for each in (begin, end, middle)
    )
    if begin == end or width <= _NARROW:
        return (begin + end) / 2
    along = min(abs(gap) / width, 1.0)
    power = max(power, 1.0)
    if along <= middle:
        rise = along**power / middle ** (power - 1)
    else:
        rise = 1 - (1 - along) ** power / (1 - middle) ** (power - 1)
    return begin + rise * (end - begin)
