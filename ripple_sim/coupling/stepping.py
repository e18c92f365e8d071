"""A simulation as it is stepped by whoever owns its loop.

`StepClock` follows its time and its resets, `followed` the steps that other code takes, and
`SolvedForces` finds data whose contact forces are solved. MuJoCo's own warnings and errors become
ours: divergence, `adopt_warnings` and `physics_errors`.
"""

from __future__ import annotations

import contextlib
import copy
import random
import re
import threading
import weakref
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import RippleWarning, SimulationError
from ripple_sim.solver.errors import warn_caller

_FWDINV = int(mujoco.mjtEnableBit.mjENBL_FWDINV)
# nothing that is computed depends on the marks, so they may differ from run to run
_random = random.SystemRandom()
_ROUND_OFF = 1e-6  # of times, in time steps

IN_TURN_WARNING = (
    "`Ripples.step` was given two MjData in turn, as of two simulations: its waves belong to one, "
    "and begin anew each time the other one comes; make one Ripples for each MjData, "
    "Ripples(model, materials)"
)
_NO_CONTACTS = {
    "contact": mujoco.mjtDisableBit.mjDSBL_CONTACT,
    "constraint": mujoco.mjtDisableBit.mjDSBL_CONSTRAINT,
}
_BROKEN = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)
NO_RESET = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
_FINISH_A_STEP = ("mj_step", "mj_step2")

# MuJoCo's mark of a contact that the constraint solver takes.
_HAS_ROWS = 0

# Forces found from accelerations are those of the step if their sums on the bodies are, up to this
# share.
_RESTORED = 1e-3

# The order of a loop's calls shows as soon as something moves: so many steps are looked at then,
# later one in so many.
_FIRST = 5
_EVERY = 20

# Movement within a step, in radians or metres, that shows in the poses whatever their scale.
_MOVES = 1e-8
UNSOLVED_WARNING = (
    "`Ripples.step` was called between `mj_step1` and `mj_step2`, before MuJoCo had solved for the "
    "contact forces: they are solved for with the controls as they are, and may differ from those "
    "of the coming `mj_step2`; call `step` between `mj_step2` and `mj_step1`, or take steps within "
    "`with ripples.following(data):`"
)
LOST_WARNING = (
    "the contact forces of the latest physics step were gone when `Ripples.step` was called: "
    "`mj_collision`, called after `mj_step`, throws them away; those of the coming step are taken "
    "in their place, so that hits begin too late; call `step` right after `mj_step`, or take steps "
    "with `ripples.mj_step(data)`"
)


class Passed(NamedTuple):
    """What happened since the last look.

    Attributes
    ----------
    elapsed : float
        Over how much time the waves go on [s]; 0 if there was no step.
    missed : int
        Physics steps before the latest one, whose contact forces are gone.
    reset : bool
        Whether the simulation began anew.
    in_turn : bool
        Whether this is another simulation than at the last look, which was looked at before that.
    """

    elapsed: float
    missed: int = 0
    reset: bool = False
    in_turn: bool = False


class StepClock:
    """Follows the simulation's time from look to look.

    The simulation began anew if its time went back, or if MuJoCo's data lost a mark. Then, as at
    the first look, only the latest step counts: what came before belongs to no wave. At time 0
    there was no step yet.

    Time alone does not tell: a reset after one step, and one more step, and it is the same time
    again; or steps that nobody saw after a reset bring the time to where it was, or beyond; or a
    keyframe sets it to any value. The mark is a negative number in `data.solver_fwdinv[0]`: a step
    leaves it alone, `copy` keeps it, and `mj_resetData`, a keyframe and the automatic reset of a
    simulation that diverges all wipe it out. MuJoCo's own values there are not negative, and
    written only where the flag `fwdinv` is enabled: then no mark is made, and of resets that time
    does not tell only those round a divergence are seen, by MuJoCo's warning of it.

    A clock follows one simulation, in whichever data that is copied to. Data of two simulations in
    turn shows as data that was looked at before the last look's, carries a mark, so that nobody has
    reset it, and does not go on from where the last one was.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Start anew, with whatever mark comes next."""
        self._mark: float | None = None
        self._time: float | None = None
        self._timestep = 0.0
        self._looked_at = weakref.WeakSet[mujoco.MjData]()
        self._latest: weakref.ref[mujoco.MjData] | None = None
        self._diverged = False

    def __getstate__(self) -> dict[str, object]:
        # MuJoCo's data loses the mark when it is pickled; that is no reset
        return {"_time": self._time, "_timestep": self._timestep, "_diverged": self._diverged}

    def __setstate__(self, state: dict[str, object]) -> None:
        self.restart()
        vars(self).update(state)

    def look(self, model: mujoco.MjModel, data: mujoco.MjData) -> Passed:
        """What happened since the last look."""
        time = float(data.time)
        timestep = float(model.opt.timestep)
        before = self._time
        longest = max(timestep, self._timestep)
        reset = before is not None and time < before
        was_reset_by_user = True
        if not model.opt.enableflags & _FWDINV:
            found = float(data.solver_fwdinv[0])
            was_reset_by_user = not found < 0
            # a mark is made where there is none, and one that others made is taken over
            if not found < 0:
                found = data.solver_fwdinv[0] = -1.0 - _random.random()
            reset = reset or self._mark not in (None, found)
            self._mark = found
        else:
            # the automatic reset leaves its warning behind, and any other one wipes it out
            diverged = divergence(data) is not None
            reset = reset or (before is not None and diverged != self._diverged)
            self._diverged = diverged
        goes_on = before is not None and not reset and time > before
        in_turn = self._is_back_at(data) and not was_reset_by_user and not goes_on
        self._time = time
        self._timestep = timestep
        if before is None or reset:
            return Passed(timestep if time else 0.0, reset=reset, in_turn=in_turn)
        if in_turn:
            return Passed(0.0, in_turn=True)
        elapsed = time - before
        # a step that equals the last one to the last bit saves the solver new coefficients
        if abs(elapsed - timestep) < _ROUND_OFF * timestep:
            return Passed(timestep)
        steps = round(elapsed / timestep)
        elapsed = (
            steps * timestep if abs(elapsed - steps * timestep) < _ROUND_OFF * timestep else elapsed
        )
        return Passed(elapsed, max(round(elapsed / longest) - 1, 0))

    def _is_back_at(self, data: mujoco.MjData) -> bool:
        """Whether this data was looked at, but not at the last look."""
        is_latest = self._latest is not None and self._latest() is data
        is_back = data in self._looked_at and not is_latest
        self._looked_at.add(data)
        self._latest = weakref.ref(data)
        return is_back


def disabled_warning(model: mujoco.MjModel) -> str | None:
    """What to warn of where the model's flags let no contact have a force, else None."""
    disabled = [name for name, flag in _NO_CONTACTS.items() if model.opt.disableflags & flag]
    if not disabled:
        return None
    flags = " ".join(f'{name}="disable"' for name in disabled)
    constants = " | ".join(f"mujoco.mjtDisableBit.{_NO_CONTACTS[name].name}" for name in disabled)
    return (
        f"nothing will ripple by contacts: the model has <flag {flags}/>, with which MuJoCo finds "
        "no contact forces; remove it from the MJCF's <option>, or call model.opt.disableflags &= "
        f"~int({constants})"
    )


def missed_warning(missed: int) -> str | None:
    """What to warn of where steps were missed, else None."""
    if not missed:
        return None
    return (
        f"{missed + 1} physics steps were taken between two calls of `Ripples.step`, of which only "
        "the latest gives its impulses: MuJoCo no longer has the contact forces of the other "
        f"{missed}; call `ripples.mj_step(data, nstep={missed + 1})` in place of `mujoco.mj_step`, "
        "or, around code that steps by itself, `with ripples.following(data):`"
    )


def divergence(data: mujoco.MjData) -> str | None:
    """Name of MuJoCo's warning of a position, velocity or acceleration that is not finite or huge, else None.

    Where its automatic reset is not disabled, MuJoCo has then gone back to the initial state, and
    keeps the warning.
    """
    return next((warning.name for warning in _BROKEN if data.warning[warning].number), None)


def divergence_warning(model: mujoco.MjModel, data: mujoco.MjData) -> str | None:
    """What to warn of where the simulation has diverged, else None."""
    broken = divergence(data)
    if broken is None:
        return None
    then = (
        "its automatic reset is disabled, and the ripples stay flat until you reset it"
        if model.opt.disableflags & NO_RESET
        else "MuJoCo reset it to its initial state, and the ripples with it"
    )
    advice = "use a shorter time step in the MJCF's <option>, or softer contacts"
    return f"the simulation diverged ({broken}): {then}; {advice}"


_lock = threading.Lock()
# By the id of the data; who follows keeps the data alive.
_followers: dict[int, list[Callable[[], None]]] = {}
_mujoco_functions: dict[str, Callable[..., None]] = {}


@contextlib.contextmanager
def followed(data: mujoco.MjData, after_step: Callable[[], None]) -> Iterator[None]:
    """Call a function after each physics step that anybody takes on this data within the context.

    While somebody follows, `mujoco.mj_step` and `mujoco.mj_step2` are replaced by functions that do
    the same and then call the followers of their data. MuJoCo has no callback after a step; this is
    the one place that all code passes, whatever framework it belongs to, but for code that bound
    the functions to names of its own (`from mujoco import mj_step`).
    """
    with _lock:
        if not _followers:
            for name in _FINISH_A_STEP:
                _mujoco_functions[name] = getattr(mujoco, name)
                setattr(mujoco, name, _following(_mujoco_functions[name]))
        _followers.setdefault(id(data), []).append(after_step)
    try:
        yield
    finally:
        with _lock:
            _followers[id(data)].remove(after_step)
            if not _followers[id(data)]:
                del _followers[id(data)]
            if not _followers:
                for name, function in _mujoco_functions.items():
                    setattr(mujoco, name, function)


def _following(function: Callable[..., None]) -> Callable[..., None]:
    """The same function, which calls the followers after each step."""

    def step(m: mujoco.MjModel, d: mujoco.MjData, *args: Any, **kwargs: Any) -> None:
        followers = _followers.get(id(d))
        if not followers:
            function(m, d, *args, **kwargs)
            return
        for _ in range(_count(*args, **kwargs)):
            function(m, d)
            for follow in tuple(followers):
                follow()

    return step


def _count(nstep: int = 1) -> int:
    """How many steps a call asks for."""
    return nstep


def adopt_warnings() -> None:
    """Have MuJoCo's warnings given as `RippleWarning`, from now on, each once.

    Of itself it writes them to standard error and to MUJOCO_LOG.TXT in the current folder. A
    handler that the user has given to `mujoco.set_mju_user_warning` stays.
    """
    if mujoco.get_mju_user_warning() in (None, _tell):
        _said.clear()
        mujoco.set_mju_user_warning(_tell)


_said: set[str] = set()


def _tell(message: str) -> None:
    """What MuJoCo calls with its warnings."""
    text = re.sub(r" *Time = [0-9.]+", "", " ".join(message.split()))
    kind = re.sub(r"[0-9]+", "", text)
    # an unstable simulation ends in an error, or begins anew with a warning
    if kind in _said or "simulation is unstable" in text:
        return
    _said.add(kind)
    with contextlib.suppress(RippleWarning):  # no exception can pass through MuJoCo
        warn_caller(f"MuJoCo: {text}")


@contextlib.contextmanager
def physics_errors() -> Iterator[None]:
    """Turn MuJoCo's errors into a `SimulationError`: above all, too little memory for the contacts of many bodies."""
    try:
        yield
    except mujoco.FatalError as error:
        reason = " ".join(str(error).split())
        advice = (
            '; enlarge <size memory="..."/> in the MJCF'
            if "memory" in reason or "stack" in reason
            else ""
        )
        raise SimulationError(f"MuJoCo cannot go on: {reason}{advice}") from error


class SolvedForces:
    """Finds data whose contact forces belong to its contacts.

    After `mj_step`, or `mj_step1` and `mj_step2`, poses, contacts and their forces are those at the
    beginning of the step. But a loop that ends with `mj_step1` has moved on to the poses and
    contacts of the next step, and the forces beside them mean nothing until `mj_step2`. After
    `mj_collision` there are contacts, but no forces.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._poses = mujoco.MjData(model)
        self._steps = 0
        self._completed: mujoco.MjData | None = None
        self._has_moved_on = False

    def of(self, data: mujoco.MjData) -> tuple[mujoco.MjData, str | None]:
        """Data with solved forces, and what to warn of where they are those of the coming step.

        That is `data` itself, or, from the first time on that `data` has moved on to the next step,
        a copy of it, completed as `mj_step2` will do with the controls as they are. Forces that are
        solved already, as after `mj_forward`, come out the same. Where forces are lost, the copy
        has them as they were, if they can be found.
        """
        model = self._model
        # no row of the constraint solver, but contacts that should have rows
        lost = bool(not data.nefc and data.ncon and (data.contact.exclude == _HAS_ROWS).any())
        self._has_moved_on = self._has_moved_on or self._moved_on(data)
        if not lost and not (self._has_moved_on and data.nefc):
            return data, None
        if self._completed is None:
            self._completed = copy.copy(data)
        mujoco.mj_copyData(self._completed, model, data)
        if lost:
            if _restore_forces(model, self._completed):
                return self._completed, None
            mujoco.mj_copyData(self._completed, model, data)
            mujoco.mj_fwdPosition(model, self._completed)
            mujoco.mj_fwdVelocity(model, self._completed)
        mujoco.mj_fwdActuation(model, self._completed)
        mujoco.mj_fwdAcceleration(model, self._completed)
        mujoco.mj_fwdConstraint(model, self._completed)
        if lost:
            return self._completed, LOST_WARNING
        # whether the forces f give on the Jacobian J what MuJoCo solved for, J^T f; the sums may be
        # in another order
        force = np.zeros(model.nv)
        mujoco.mj_mulJacTVec(model, data, force, data.efc_force)
        return self._completed, None if _agree(
            force, data.qfrc_constraint, 1e-9
        ) else UNSOLVED_WARNING

    def _moved_on(self, data: mujoco.MjData) -> bool:
        """Whether the poses are already those that follow from the positions."""
        if self._steps >= _FIRST:
            self._steps += 1
            if self._steps % _EVERY:
                return False
        if not (self._model.nv and np.abs(data.qvel).max() * self._model.opt.timestep > _MOVES):
            return False
        self._steps += self._steps < _FIRST
        poses = self._poses
        poses.qpos = data.qpos
        poses.mocap_pos = data.mocap_pos
        poses.mocap_quat = data.mocap_quat
        mujoco.mj_kinematics(self._model, poses)
        return np.array_equal(poses.xpos, data.xpos) and np.array_equal(poses.xquat, data.xquat)


def _restore_forces(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Find the forces of the latest step from its acceleration, if contacts were found anew at the poses of that step.

    Whether they are those of that step: their sums on the bodies are.
    """
    expected = data.qfrc_constraint.copy()
    data.qvel -= model.opt.timestep * data.qacc
    mujoco.mj_makeConstraint(model, data)
    mujoco.mj_island(model, data)
    mujoco.mj_projectConstraint(model, data)
    mujoco.mj_referenceConstraint(model, data)
    excess = np.zeros(data.nefc)
    mujoco.mj_mulJacVec(model, data, excess, data.qacc)
    mujoco.mj_constraintUpdate(model, data, excess - data.efc_aref, None, 0)
    return _agree(data.qfrc_constraint, expected, _RESTORED)


def _agree(force: NDArray[np.float64], expected: NDArray[np.float64], tolerance: float) -> bool:
    return float(np.abs(force - expected).max()) <= tolerance * (
        1.0 + float(np.abs(expected).max())
    )
