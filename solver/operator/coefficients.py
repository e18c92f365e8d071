"""The coefficients of a material: their units, limits and shapes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import POSITIVE, SolverError, shown

# Coefficients that are numbers: the unit of each, whether it must be greater than 0 rather than at
# least 0, and whether it may be infinite.
LIMITS = {
    "speed": ("m/s", False, False),
    "damping": ("1/s", False, False),
    "stiffness": ("1/s^2", False, False),
    "viscosity": ("m^2/s", False, False),
    "density": ("kg/m^2", True, False),
    "bending": ("m^4/s^2", False, False),
    "yield_height": ("m", True, True),
    "deep": ("1/m", False, False),
}

# Greatest coefficient, in its unit; one over it is the least of those that must be greater than 0.
# It is beyond any physical value, and small enough that nothing overflows on the way to the time
# step.
_HIGHEST = 1e12


def check_numbers(name: str, value: ArrayLike) -> None:
    """Raise `SolverError` unless a coefficient is a number or one a texel, within `LIMITS`."""
    unit, must_be_positive, may_be_infinite = LIMITS[name]
    numbers = _numbers(name, value)
    least = 1 / _HIGHEST if must_be_positive else 0
    too_low = ~(numbers >= least)  # so is NaN
    too_high = (numbers > _HIGHEST) & ~(np.isinf(numbers) & may_be_infinite)
    wrong = too_low | too_high
    if wrong.any():
        worst = numbers.flat[np.argmax(wrong)]
        bound = f"greater than 0 and at least {least:g}" if must_be_positive else "0 or greater"
        infinity = ", or infinity" if may_be_infinite else ""
        raise SolverError(
            f"material {name} must be a finite number, {bound}, up to {_HIGHEST:g}{infinity}, "
            f"got {worst:g} {unit}"
        )
    _check_shape(name, numbers)


def check_mask(name: str, value: ArrayLike) -> None:
    """Raise `SolverError` unless a value is one bool, or one bool a texel."""
    mask = np.asarray(value)
    if mask.dtype != bool:
        raise SolverError(
            f"material {name} must be False or a bool mask [C, n, n], got type {mask.dtype}"
        )
    _check_shape(name, mask)


def check_wavelengths(value: ArrayLike) -> None:
    """Raise `SolverError` unless a value is a shortest and a longest wave."""
    numbers = _numbers("wavelengths", value)
    if numbers.shape != (2,) or not 0 <= numbers[0] <= numbers[1]:
        raise SolverError(
            "material wavelengths must be two numbers, the shortest (0 or greater) and the "
            f"longest, got {shown(value)} m"
        )


def _numbers(name: str, value: object) -> NDArray[np.float64]:
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise SolverError(
            f"material {name} must be a number or an array of numbers, got {shown(value)}"
        ) from error


def _check_shape(name: str, value: NDArray) -> None:
    is_field = value.ndim == 3 and value.shape[1] == value.shape[2]
    if value.ndim != 0 and not is_field:
        raise SolverError(
            f"material {name} must be a number or have shape [C, n, n], one value a texel, got "
            f"shape {value.shape}"
        )


def require_positive(**values: tuple[float, str]) -> None:
    """Raise `SolverError` unless all values are finite numbers greater than 0.

    Values come with their units, by name.
    """
    for name, (value, unit) in values.items():
        if not POSITIVE.holds(value):
            raise SolverError(f"{name} must be {POSITIVE.words}, got {shown(value)} {unit}")
