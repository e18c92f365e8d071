"""A soft layer on a rigid core: the coefficients of the waves that normal impacts drive over it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checked import POSITIVE, is_finite, shown
from ..errors import SolverError
from .coefficients import require_positive

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
