"""The time that a physics step took."""

from __future__ import annotations


class StepClock:
    """Follows the simulation's time from step to step."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start anew."""
        self._time: float | None = None

    def elapsed(self, time: float, timestep: float) -> tuple[float, bool]:
        """Time since the last step [s], and whether the simulation's time was set back.

        The first step, and the first after the time was set back, count as one time step.
        """
        elapsed = timestep if self._time is None else time - self._time
        set_back = elapsed < 0
        self._time = time
        if set_back:
            elapsed = timestep
        # a step that equals the last one to the last bit saves the solver new coefficients
        steps = round(elapsed / timestep)
        return (steps * timestep if abs(elapsed - steps * timestep) < 1e-6 * timestep else elapsed), set_back
