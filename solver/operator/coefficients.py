"""The coefficients of a material: their units, limits and shapes.

A soft layer on a rigid core: the coefficients of the waves that normal impacts drive over it.

Coefficients that nobody gave.

The coefficients of the wave equation as one object: numbers or maps, checked.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import POSITIVE, SolverError, is_finite, shown

# name: unit, least value, whether the least value itself is excluded, whether infinity is allowed
LIMITS = {
    "speed": ("m/s", 0.0, False, False),
    "damping": ("1/s", 0.0, False, False),
    "stiffness": ("1/s^2", 0.0, False, False),
    "viscosity": ("m^2/s", 0.0, False, False),
    "density": ("kg/m^2", 0.0, True, False),
    "bending": ("m^4/s^2", 0.0, False, False),
    "yield_height": ("m", 0.0, True, True),
    "deep": ("1/m", 0.0, False, False),
}

# Beyond any physical value, and small enough that nothing overflows on the way to the time step.
_HIGHEST = 1e12


def check_numbers(name: str, value: ArrayLike) -> None:
    """Raise `SolverError` unless a coefficient is within its limits, and one number or one value a texel."""
    unit, low, strict, endless = LIMITS[name]
    numbers = _numbers(name, value)
    small = (numbers <= low) | (numbers < 1 / _HIGHEST) if strict else numbers < low
    wrong = small | np.isnan(numbers) | ((numbers > _HIGHEST) & ~(np.isinf(numbers) & endless))
    if wrong.any():
        worst = numbers.flat[np.argmax(wrong)]
        bound = f"greater than {low:g} and at least {1 / _HIGHEST:g}" if strict else f"{low:g} or greater"
        raise SolverError(
            f"material {name} is {worst:g} {unit}; valid is a finite number, {bound}, up to {_HIGHEST:g}"
            f"{', or infinity' if endless else ''}"
        )
    _check_shape(name, numbers)


def check_mask(name: str, value: ArrayLike) -> None:
    """Raise `SolverError` unless a value is one bool, or one a texel."""
    mask = np.asarray(value)
    if mask.dtype != bool:
        raise SolverError(f"material {name} has type {mask.dtype}; valid is bool: a mask [C, n, n], or False")
    _check_shape(name, mask)


def check_wavelengths(value: ArrayLike) -> None:
    """Raise `SolverError` unless a value is a shortest and a longest wave."""
    numbers = _numbers("wavelengths", value)
    if numbers.shape != (2,) or not 0 <= numbers[0] <= numbers[1]:
        raise SolverError(
            f"material wavelengths is {shown(value)} m; valid are two numbers: the shortest, 0 or greater, and the "
            "longest"
        )


def _numbers(name: str, value: object) -> NDArray[np.float64]:
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise SolverError(f"material {name} is {shown(value)}; valid is a number or an array of numbers") from error


def _check_shape(name: str, value: NDArray) -> None:
    charts = value.ndim == 3 and value.shape[1] == value.shape[2]
    if value.ndim != 0 and not charts:
        raise SolverError(f"material {name} has shape {value.shape}; valid is a number or [C, n, n], one value a texel")


def require_positive(**values: tuple[float, str]) -> None:
    """Raise `SolverError` unless every value, given with its unit, is a finite number greater than 0."""
    for name, (value, unit) in values.items():
        if not POSITIVE.holds(value):
            raise SolverError(f"{name} is {shown(value)} {unit}; valid is {POSITIVE.words}")


# omega^2 = STIFF G / (rho d^2) + FAST G / rho q^2 is the even fit, for 1.3 <= q d <= 8, to the lowest normal mode of an
# incompressible layer bonded to a rigid base: its frequency is within 3.0 % of the root of the mode's determinant.
STIFF, FAST = 6.527, 0.7668

# The mode's kinetic energy is that of MASS rho d moving as the surface does: 0.56 to 0.95 in that range, the least at
# its short end; this is the geometric mean.
MASS = 0.665

# Shortest and longest wave, over the thickness, for which the fit holds.
SHORTEST, LONGEST = 2 * np.pi / 8, 2 * np.pi / 1.3


def layer_coefficients(modulus: float, viscosity: float, density: float, thickness: ArrayLike) -> dict[str, Any]:
    """Coefficients of `Material` by their names; see `Material.layer`."""
    require_positive(modulus=(modulus, "Pa"), density=(density, "kg/m^3"))
    if not (is_finite(viscosity) and viscosity >= 0):
        raise SolverError(f"viscosity is {shown(viscosity)} Pa s; valid is a finite number, 0 or greater")
    depth = _thickness(thickness)
    square, kinematic = modulus / density, viscosity / density
    return {
        "speed": (FAST * square) ** 0.5,
        "stiffness": STIFF * square / depth**2,
        "viscosity": FAST * kinematic,
        "damping": STIFF * kinematic / depth**2,
        "density": MASS * density * depth,
    }


def layer_wavelengths(thickness: ArrayLike) -> tuple[float, float]:
    """Shortest and longest wave [m] that the fit holds for somewhere: at the thinnest and at the thickest place."""
    depth = _thickness(thickness)
    return SHORTEST * float(np.min(depth)), LONGEST * float(np.max(depth))


def _thickness(value: Any) -> float | NDArray[np.float64]:
    if np.ndim(value) == 0:  # a word, too
        require_positive(thickness=(value, "m"))
        return float(value)
    depth = np.asarray(value)
    wrong = ~(np.isfinite(depth) & (depth > 0)) if np.issubdtype(depth.dtype, np.number) else np.ones(1, np.bool_)
    if wrong.any():
        worst = depth.tolist() if depth.size == 0 else depth.flat[np.argmax(wrong)].item()
        raise SolverError(f"thickness is {shown(worst)} m; valid is {POSITIVE.words}, or one at every texel")
    return depth.astype(np.float64)


class Unset(float):
    """A default value: it counts as the number that it is, until someone who knows better replaces it.

    `WaveSolver` takes it as it stands. `Ripples` knows the model, and puts in what suits its target.
    """

    __slots__ = ()


_ZERO, _ONE = Unset(0.0), Unset(1.0)

_STEEPEST = 8.0  # power with which tension may follow the area


@dataclasses.dataclass(frozen=True, eq=False)
class MaterialFields:
    """The fields of `Material`, which says what each of them is: checked, and read at every texel."""

    speed: float | ArrayLike = _ONE
    damping: float | ArrayLike = _ZERO
    stiffness: float | ArrayLike = _ZERO
    viscosity: float | ArrayLike = 0.0
    density: float | ArrayLike = _ONE
    bending: float | ArrayLike = 0.0
    yield_height: float | ArrayLike = np.inf
    deep: float = 0.0
    fixed: bool | ArrayLike = False
    tightening: float = 0.0
    wavelengths: ArrayLike = (0.0, np.inf)

    def __post_init__(self) -> None:
        for name in LIMITS:
            check_numbers(name, getattr(self, name))
        check_mask("fixed", self.fixed)
        if not (is_finite(self.tightening) and -_STEEPEST <= self.tightening <= _STEEPEST):
            raise SolverError(
                f"material tightening is {shown(self.tightening)}; valid is from {-_STEEPEST:g} to {_STEEPEST:g}"
            )
        if np.ndim(self.deep):
            raise SolverError(f"material deep has shape {np.shape(self.deep)}; valid is one number")
        check_wavelengths(self.wavelengths)

    @property
    def unset(self) -> tuple[str, ...]:
        """Names of the coefficients that are left to the model: none where the density is given."""
        if not isinstance(self.density, Unset):
            return ()
        return tuple(name for name in LIMITS if isinstance(getattr(self, name), Unset))

    def texels(self, name: str, shape: tuple[int, int, int]) -> NDArray:
        """One coefficient at every texel, [C, n, n], float64 (bool for `fixed`).

        Raises
        ------
        SolverError
            If the coefficient was given for another atlas.
        """
        value = np.asarray(getattr(self, name), dtype=bool if name == "fixed" else np.float64)
        if value.ndim and value.shape != shape:
            raise SolverError(f"material {name} has shape {value.shape}, the atlas needs a number or {shape}")
        return np.array(np.broadcast_to(value, shape))
