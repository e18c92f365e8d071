"""Time as the waves follow it: how much has passed, how many steps nobody saw, and whether the simulation was reset."""

from __future__ import annotations

from typing import NamedTuple

import mujoco

from .reset_mark import ResetMark

_ROUND_OFF = 1e-6  # of times, in time steps


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
    """

    elapsed: float
    missed: int = 0
    reset: bool = False


class StepClock:
    """Follows the simulation's time from look to look.

    The simulation began anew if MuJoCo's data lost its mark (see `ResetMark`) or its time went back. Then, as at the
    first look, only the latest step counts: what came before belongs to no wave. At time 0 there was no step yet.
    """

    def __init__(self) -> None:
        self._mark = ResetMark()
        self.restart()

    def restart(self) -> None:
        """Start anew."""
        self._mark.forget()
        self._time: float | None = None
        self._timestep = 0.0

    def look(self, model: mujoco.MjModel, data: mujoco.MjData) -> Passed:
        """What happened since the last look."""
        time, timestep = float(data.time), float(model.opt.timestep)
        before, longest = self._time, max(timestep, self._timestep)
        reset = not self._mark.stands(model, data) or (before is not None and time < before)
        self._time, self._timestep = time, timestep
        if before is None or reset:
            return Passed(timestep if time else 0.0, reset=reset)
        elapsed = time - before
        # a step that equals the last one to the last bit saves the solver new coefficients
        if abs(elapsed - timestep) < _ROUND_OFF * timestep:
            return Passed(timestep)
        steps = round(elapsed / timestep)
        elapsed = steps * timestep if abs(elapsed - steps * timestep) < _ROUND_OFF * timestep else elapsed
        return Passed(elapsed, max(round(elapsed / longest) - 1, 0))


def missed_warning(missed: int) -> str | None:
    """What to warn of where steps were missed, else None."""
    if not missed:
        return None
    return (
        f"{missed + 1} physics steps were taken between two calls of `Ripples.step`, of which only the latest gives "
        f"its impulses: MuJoCo no longer has the contact forces of the other {missed}; call "
        f"`ripples.mj_step(data, nstep={missed + 1})` in place of `mujoco.mj_step`, or, around code that steps by "
        "itself, `with ripples.following(data):`"
    )
