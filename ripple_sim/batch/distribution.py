"""Distributions from which the values of a batch are drawn."""

from __future__ import annotations

import math
from typing import Any, Literal

import msgspec
import numpy as np

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import shown

Numbers = float | list[float]

# The kinds of distributions. A distribution has exactly one of them.
KINDS = ("uniform", "log_uniform", "normal", "integers", "choice", "orientation", "constant")

# Normal numbers are drawn at most so many times until they lie within their limits.
_MAX_DRAWS = 10_000


class Distribution(msgspec.Struct, forbid_unknown_fields=True, omit_defaults=True):
    """A distribution, of exactly one kind.

    The kinds are `uniform`, `log_uniform`, `normal`, `integers`, `choice`, `orientation` and
    `constant`.
    """

    uniform: tuple[Numbers, Numbers] | None = None
    """Lowest and highest number, or vectors of these."""
    log_uniform: tuple[Numbers, Numbers] | None = None
    """Likewise, above 0; as many between 1 and 2 as between 2 and 4."""
    normal: tuple[float, float] | None = None
    """Mean and standard deviation."""
    integers: tuple[int, int] | None = None
    """Lowest and highest whole number, both included."""
    choice: list[Any] | None = None
    """Values of any kind."""
    orientation: bool = False
    """A turn, all equally likely, as a unit quaternion w, x, y, z."""
    constant: Any = None
    """Always this value."""
    weights: list[float] | None = None
    """How likely each of the choices is, in any unit; by default all are equally likely."""
    limits: tuple[float, float] | None = None
    """Of a normal one: it is drawn again until it lies between them."""
    length: int | None = None
    """How many numbers are drawn, independently, for a vector."""
    apply: Literal["set", "add", "multiply"] = "set"
    """How the drawn value changes the value in the scene: replace it, add to it, or multiply it."""
    together: bool = False
    """Whether a key that fits several places gives them all the same value."""

    def draw(self, rng: np.random.Generator) -> Any:
        """Draw a value: a float, an int, a list of these, or any of the choices.

        Floats are rounded to 12 digits, so that no processor's last bit counts.
        """
        if self.choice is not None:
            probabilities = None
            if self.weights is not None:
                probabilities = np.divide(self.weights, math.fsum(self.weights))
            return self.choice[int(rng.choice(len(self.choice), p=probabilities))]
        if self.constant is not None:
            return self.constant
        if self.orientation:
            quaternion = rng.standard_normal(4)
            return _plain(quaternion / math.sqrt(math.fsum(quaternion**2)))
        if self.integers is not None:
            low, high = self.integers
            integers = rng.integers(low, high, size=self.length, endpoint=True)
            return integers.tolist() if self.length else int(integers)
        if self.uniform is not None:
            return _plain(rng.uniform(*self.uniform, size=self.length))
        if self.log_uniform is not None:
            log_low, log_high = (np.log(np.array(limit)) for limit in self.log_uniform)
            return _plain(np.exp(rng.uniform(log_low, log_high, size=self.length)))
        return self._draw_normal(rng)

    def _draw_normal(self, rng: np.random.Generator) -> Any:
        """Draw normal numbers, again and again until they lie within the limits."""
        mean, deviation = self.normal or (0.0, 0.0)
        least, greatest = self.limits or (-math.inf, math.inf)
        number = rng.normal(mean, deviation, size=self.length)
        for _ in range(_MAX_DRAWS):
            outside = (number < least) | (number > greatest)
            if not np.any(outside):
                return _plain(number)
            number = np.where(outside, rng.normal(mean, deviation, size=self.length), number)
        raise SceneError(
            f"normal {self.normal} hardly ever lies within the limits {self.limits}; widen them"
        )

    def check(self, key: str) -> None:
        """Check that there is one kind, and that its numbers are valid.

        Raises `SceneError` with the key.
        """
        kinds = [kind for kind in KINDS if getattr(self, kind) not in (None, False)]
        if len(kinds) != 1:
            raise SceneError(
                f"plan: {key} must be drawn from one of {', '.join(KINDS)}, got "
                f"{' and '.join(kinds) or 'nothing'}"
            )
        kind = kinds[0]
        if self.weights is not None and kind != "choice":
            raise SceneError(f"plan: {key} has weights, which {kind} does not take")
        if self.limits is not None and kind != "normal":
            raise SceneError(f"plan: {key} has limits, which {kind} does not take")
        if self.length is not None and (self.length < 1 or kind not in KINDS[:4]):
            raise SceneError(
                f"plan: the length of {key} must be 1 or more, and its values numbers, got "
                f"length {self.length}"
            )
        problem = self._problem()
        if problem:
            raise SceneError(
                f"plan: {key} is drawn from {kind} = {shown(getattr(self, kind))}; {problem}"
            )

    def _problem(self) -> str | None:
        """The rule that the values break, in words; None if they break none."""
        return self._problem_of_limits() or self._problem_of_normal() or self._problem_of_choice()

    def _problem_of_limits(self) -> str | None:
        """The rule that the lowest and highest numbers break, if any."""
        pair = self.uniform or self.log_uniform or self.integers or self.limits
        if pair is None:
            return None
        low = np.array(pair[0], float)
        high = np.array(pair[1], float)
        if low.shape not in ((), high.shape) and high.shape != ():
            return "it must be two numbers, or two vectors of the same length"
        if not (np.isfinite(low).all() and np.isfinite(high).all() and np.all(low <= high)):
            return "it must be two finite numbers, the lower one first"
        if self.log_uniform and np.any(low <= 0):
            return "its numbers must be above 0"
        if self.length is not None and max(low.size, high.size) > 1:
            return "vectors have their own length; leave `length` out"
        return None

    def _problem_of_normal(self) -> str | None:
        """The rule that mean and deviation break, if any."""
        if self.normal is None:
            return None
        if np.isfinite(self.normal).all() and self.normal[1] >= 0:
            return None
        return "it must be a mean and a standard deviation of 0 or more"

    def _problem_of_choice(self) -> str | None:
        """The rule that choices and weights break, if any."""
        if self.choice is None:
            return None
        if not self.choice:
            return "it must have at least one value"
        if self.weights is None:
            return None
        has_all_weights = len(self.weights) == len(self.choice)
        if has_all_weights and min(self.weights) >= 0 and 0 < sum(self.weights) < math.inf:
            return None
        return f"it must have {len(self.choice)} weights, none below 0"


def _plain(value: Any) -> Any:
    """Numbers of NumPy as Python's, with 12 digits."""
    if np.ndim(value):
        return [float(f"{number:.12g}") for number in value]
    return float(f"{value:.12g}")
