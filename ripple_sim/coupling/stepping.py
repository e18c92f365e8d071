"""The steps of a simulation that another program runs.

`StepClock` follows the time and the resets of the simulation. The warnings say what is wrong with
its steps, and `physics_errors` turns MuJoCo's errors into ours.
"""

from __future__ import annotations

import contextlib
import weakref
from collections.abc import Iterator
from typing import NamedTuple

import mujoco

from ripple_sim.errors import SimulationError

from .hooks import can_be_marked, make_mark, read_mark

# Times are compared up to this share of a time step.
_ROUND_OFF = 1e-6

# MuJoCo's flag that disables its automatic reset.
NO_RESET = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)

# MuJoCo's flags that let no contact have a force, by their names in <flag>.
_NO_CONTACTS = {
    "contact": mujoco.mjtDisableBit.mjDSBL_CONTACT,
    "constraint": mujoco.mjtDisableBit.mjDSBL_CONSTRAINT,
}

# MuJoCo's warnings of a state that is not finite, or huge.
_DIVERGED = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)

IN_TURN_WARNING = (
    "`Ripples.step` was given two MjData in turn, as of two simulations: its waves belong to one, "
    "and begin anew each time the other one comes; make one Ripples for each MjData, "
    "Ripples(model, materials)"
)


class Passed(NamedTuple):
    """The events since the last look.

    Attributes
    ----------
    elapsed : float
        Time by which the waves advance [s]; 0 if there was no step.
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
    the first look, only the latest step counts: earlier steps belong to no wave. At time 0 there
    was no step yet.

    Time alone does not show every reset. After a reset and one more step it may be the same as
    before; unseen steps after a reset may bring it to where it was, or beyond; a keyframe may set
    it to any value. So the data gets a mark, a negative number in `data.solver_fwdinv[0]`. A step
    leaves it alone, and `copy` keeps it; `mj_resetData`, a keyframe and the automatic reset of a
    simulation that diverges wipe it out. MuJoCo's own values there are not negative, and are
    written only if the flag `fwdinv` is enabled. Then no mark is made, and of the resets that time
    does not show only those at a divergence are seen, by MuJoCo's warning.

    A clock follows one simulation, in whichever data it is copied to. Two simulations were stepped
    in turn if the data was looked at before, but not at the last look; carries a mark, so that
    nobody has reset it; and does not go on from the time of the last look.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Start anew with the next mark."""
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
        """The events since the last look."""
        time = float(data.time)
        timestep = float(model.opt.timestep)
        time_before = self._time
        timestep_before = self._timestep
        has_mark = can_be_marked(model) and read_mark(data) is not None
        reset = self._sees_reset(model, data, time_before)
        goes_on = time_before is not None and not reset and time > time_before
        in_turn = self._is_back_at(data) and has_mark and not goes_on
        self._time = time
        self._timestep = timestep
        if time_before is None or reset:
            return Passed(timestep if time else 0.0, reset=reset, in_turn=in_turn)
        if in_turn:
            return Passed(0.0, in_turn=True)
        return self._steps_in(time - time_before, timestep, timestep_before)

    def _sees_reset(
        self, model: mujoco.MjModel, data: mujoco.MjData, time_before: float | None
    ) -> bool:
        """Whether the simulation began anew since the last look, at `time_before` [s]."""
        has_gone_back = time_before is not None and float(data.time) < time_before
        if can_be_marked(model):
            # data without a mark gets one; a mark that another clock made is taken over
            mark = read_mark(data)
            if mark is None:
                mark = make_mark(data)
            has_new_mark = self._mark not in (None, mark)
            self._mark = mark
            return has_gone_back or has_new_mark
        # the automatic reset leaves MuJoCo's warning behind, and any other reset wipes it out
        diverged = divergence(data) is not None
        has_other_warning = time_before is not None and diverged != self._diverged
        self._diverged = diverged
        return has_gone_back or has_other_warning

    @staticmethod
    def _steps_in(elapsed: float, timestep: float, timestep_before: float) -> Passed:
        """The steps in an elapsed time [s], of the present time step or of the one before [s]."""
        # a step that equals the last one to the last bit saves the solver new coefficients
        if abs(elapsed - timestep) < _ROUND_OFF * timestep:
            return Passed(timestep)
        whole_steps = round(elapsed / timestep) * timestep
        if abs(elapsed - whole_steps) < _ROUND_OFF * timestep:
            elapsed = whole_steps
        longest = max(timestep, timestep_before)
        return Passed(elapsed, max(round(elapsed / longest) - 1, 0))

    def _is_back_at(self, data: mujoco.MjData) -> bool:
        """Whether this data was looked at, but not at the last look."""
        is_latest = self._latest is not None and self._latest() is data
        is_back = data in self._looked_at and not is_latest
        self._looked_at.add(data)
        self._latest = weakref.ref(data)
        return is_back


def disabled_warning(model: mujoco.MjModel) -> str | None:
    """Warning of a model whose flags let no contact have a force; None for other models."""
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
    """Warning of steps that were missed; None if none was missed."""
    if not missed:
        return None
    return (
        f"{missed + 1} physics steps were taken between two calls of `Ripples.step`, of which only "
        "the latest gives its impulses: MuJoCo no longer has the contact forces of the other "
        f"{missed}; call `ripples.mj_step(data, nstep={missed + 1})` in place of `mujoco.mj_step`, "
        "or, around code that steps by itself, `with ripples.following(data):`"
    )


def divergence(data: mujoco.MjData) -> str | None:
    """Name of MuJoCo's warning that the simulation has diverged, or None if it has not.

    A position, velocity or acceleration was then not finite, or huge. Where its automatic reset is
    not disabled, MuJoCo has gone back to the initial state, and keeps the warning.
    """
    for warning in _DIVERGED:
        if data.warning[warning].number:
            return str(warning.name)
    return None


def divergence_warning(model: mujoco.MjModel, data: mujoco.MjData) -> str | None:
    """Warning of a simulation that has diverged; None if it has not."""
    broken = divergence(data)
    if broken is None:
        return None
    if model.opt.disableflags & NO_RESET:
        then = "its automatic reset is disabled, and the ripples stay flat until you reset it"
    else:
        then = "MuJoCo reset it to its initial state, and the ripples with it"
    advice = "use a shorter time step in the MJCF's <option>, or softer contacts"
    return f"the simulation diverged ({broken}): {then}; {advice}"


@contextlib.contextmanager
def physics_errors() -> Iterator[None]:
    """Turn MuJoCo's errors into a `SimulationError`.

    Above all these are errors of too little memory for the contacts of many bodies.
    """
    try:
        yield
    except mujoco.FatalError as error:
        reason = " ".join(str(error).split())
        advice = ""
        if "memory" in reason or "stack" in reason:
            advice = '; enlarge <size memory="..."/> in the MJCF'
        raise SimulationError(f"MuJoCo cannot go on: {reason}{advice}") from error
