"""Coefficients that suit an object's size and what hits it."""

from __future__ import annotations

import math

from ..errors import SolverError
from .coefficients import require_positive
from .response import density_for, stiffness_under

# Size over the length to which a dent narrows, c / sqrt(k).
NARROW = 16.0

# Impulse of a hit over mass times speed: it bounces back with half its speed.
BOUNCE = 1.5

_RADIUS = 0.05  # footprint over size
_VISCOSITY = 1e-3  # over speed times size
_GRAVITY = 9.81


def suited_coefficients(
    size: float,
    hit: float | tuple[float, float],
    radius: float | None,
    amplitude: float,
    crossing: float,
    decay: float,
) -> dict[str, float]:
    """Coefficients by their names; see `Material.suited`."""
    require_positive(size=(size, "m"))
    radius = _RADIUS * size if radius is None else radius
    impulse, mass = _impulse(hit)
    require_positive(
        size=(size, "m"), radius=(radius, "m"), amplitude=(amplitude, "of the size"), crossing=(crossing, "s"),
        decay=(decay, "s"),
    )  # fmt: skip
    speed, depth = size / crossing, amplitude * size
    density = density_for(impulse, depth, radius=radius, speed=speed)
    resting = stiffness_under(_GRAVITY * mass, depth / 2, radius=radius, density=density, speed=speed)
    return {
        "speed": speed,
        "damping": damping_for(decay),
        "stiffness": max(narrow_stiffness(size, speed), resting),
        "viscosity": _VISCOSITY * speed * size,
        "density": density,
    }


def narrow_stiffness(size: float, speed: float) -> float:
    """Stiffness that keeps dents narrow beside the object [1/s^2]."""
    return (NARROW * speed / size) ** 2


def damping_for(decay: float) -> float:
    """Damping with which waves fall to a tenth in a time [s], in 1/s."""
    return 2 * math.log(10) / decay


def _impulse(hit: float | tuple[float, float]) -> tuple[float, float]:
    """Impulse [N s] of a hit, and the mass of the body [kg], or 0 where it is not known."""
    if isinstance(hit, tuple | list):
        if len(hit) != 2:
            raise SolverError(f"hit is {hit!r}; valid is an impulse [N s], or a mass [kg] and a speed [m/s]")
        mass, speed = hit
        require_positive(**{"mass of the hit": (mass, "kg"), "speed of the hit": (speed, "m/s")})
        return BOUNCE * mass * speed, mass
    require_positive(hit=(hit, "N s"))
    return hit, 0.0
