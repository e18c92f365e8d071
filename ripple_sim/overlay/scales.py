"""Scales of the overlays: steady, round numbers as their ends, and numbers with units."""

from __future__ import annotations

import math
from typing import TypeAlias

# End of a scale that is shown, and the round number (the goal) that it approaches.
Scale: TypeAlias = tuple[float, float]

# SI prefixes, by their powers of ten.
_PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}

# Round numbers from 1 to 10; the halves of them are short numbers too, for labels.
_ROUND_NUMBERS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)

_EASING_TIME = 0.12  # in which a limit covers most of the way to its goal [s]
_MAX_LAG = 4.0  # a limit that is smaller than its goal by a larger factor catches up at once


def round_up(value: float, steps: tuple[float, ...] = _ROUND_NUMBERS) -> float:
    """Return the smallest of `steps` times a power of ten that is at least a positive value."""
    power = 10.0 ** math.floor(math.log10(value) + 1e-9)
    return next(
        (step * power for step in steps if value <= step * power * (1 + 1e-9)), 10.0 * power
    )


class Limit:
    """End of a scale that follows the magnitudes so far and never shrinks.

    Its goals are round numbers, so it seldom moves, and it glides from one to the next. It depends
    on the magnitudes alone: the same run has the same limits.

    Parameters
    ----------
    floor : float
        The least limit. 0: the first positive magnitude sets it.
    fixed : float, optional
        The limit, for good.
    memory : float
        Magnitudes are averaged over about this time [s], so that brief peaks do not count. 0: each
        counts.
    """

    def __init__(self, floor: float = 0.0, fixed: float | None = None, memory: float = 0.0) -> None:
        self._fixed = fixed is not None
        self._memory = memory
        self._mean = 0.0
        if fixed is not None:
            self.goal = fixed
        else:
            self.goal = round_up(floor) if floor > 0 else 0.0
        self.value = self.goal

    def follow(self, magnitude: float, dt: float) -> float:
        """Take in a magnitude, `dt` [s] after the last one; return the limit.

        It is 0 until there is a positive magnitude.
        """
        if self._fixed:
            return self.value
        weight = -math.expm1(-dt / self._memory) if self._memory else 1.0
        self._mean += (magnitude - self._mean) * weight
        if self._mean > self.goal:
            self.goal = round_up(self._mean)
        self.value = max(self.value, self.goal / _MAX_LAG) if self.value else self.goal
        if self.value >= 0.995 * self.goal:
            self.value = self.goal
        else:
            self.value *= (self.goal / self.value) ** -math.expm1(-dt / _EASING_TIME)
        return self.value


def readable(limit: float, unit: str) -> tuple[float, str]:
    """Factor and unit in which a limit is a number from 1 to 1000.

    For a limit of 0.02 and the unit "m" they are 1e3 and "mm".
    """
    power = min(9, max(-9, 3 * math.floor(math.log10(limit * (1 + 1e-9)) / 3)))
    return 10.0**-power, _PREFIXES[power] + unit


def number(value: float) -> str:
    """Format a number briefly, with a true minus sign."""
    text = f"{value:.4g}"
    return "0" if text == "-0" else text.replace("-", "\N{MINUS SIGN}")
