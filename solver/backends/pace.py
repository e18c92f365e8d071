"""One thread or several: whichever took the steps faster lately.

Threads that wait for each other lose more than they gain where the cores are busy with something
else, such as a renderer in software or another program: each meeting then waits until the system
gives the slowest thread a core. Only a measurement tells. Heights do not depend on the choice.
"""

from __future__ import annotations

# Steps until the slower choice is tried again. The number doubles, up to the greatest, with every
# trial that fails: a trial of threads on busy cores may take thirty times as long as a step.
_FIRST_TRIAL = 16
_LAST_TRIAL = 1024


class Pace:
    """Chooses the number of threads for each step, and learns from the time that the step took.

    Parameters
    ----------
    threads : int
        Threads that may take a step together.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._best = threads
        self._seconds: dict[int, float] = {}  # time of the latest substep, by number of threads
        self._interval = _FIRST_TRIAL
        self._steps_until_trial = 1

    def choose(self) -> int:
        """The number of threads for the next step."""
        if self.threads == 1 or self._steps_until_trial > 0:
            return self._best
        return 1 if self._best == self.threads else self.threads

    def note(self, threads: int, seconds: float) -> None:
        """Learn the time [s] that a substep took with a number of threads from `choose`."""
        if self.threads == 1:
            return
        self._seconds[threads] = seconds
        if threads == self._best:
            self._steps_until_trial -= 1
            return
        if seconds < self._seconds[self._best]:
            self._best = threads
            self._interval = _FIRST_TRIAL
        else:
            self._interval = min(2 * self._interval, _LAST_TRIAL)
        self._steps_until_trial = self._interval
