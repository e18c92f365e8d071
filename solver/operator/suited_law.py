"""Coefficients for the size of an object and the hits on it, from the depth of dents.

A load F, spread like a Gaussian of standard deviation s, presses a membrane with a restoring
stiffness k in by

    h = F / (4 pi sigma c^2) exp(z) E1(z),    z = s^2 k / (2 c^2),

the integral of exp(-q^2 s^2 / 2) / (c^2 q^2 + k) over all wave numbers q. For exp(z) E1(z) this
module takes ln(1 + 1/z), which is an upper bound and can be inverted (Abramowitz and Stegun 1964,
5.1.20). The functions solve the equation for the depth, the stiffness or the density.
"""

from __future__ import annotations

import math

from ..errors import SolverError
from .coefficients import require_positive

# Standard deviation of a footprint (1 - (d/r)^2)^3 along an axis, over its radius r.
SPREAD = 10**-0.5

# Size of the object over the width of a dent, c / sqrt(k).
NARROW = 16.0

# Impulse of a hit over mass times speed: it bounces back with half its speed.
BOUNCE = 1.5

# Radius of a footprint over the size of the object, unless it is given.
_DEFAULT_RADIUS = 0.05

# Least radius of a footprint over the size of the object. Smaller footprints count as this large:
# texels do not resolve them, and their rings would not be visible.
FOOTPRINT = 0.025

# Viscosity over the product of speed and size.
_VISCOSITY = 1e-3

# [m/s^2]
_GRAVITY = 9.81

# Ratio of the load that tension carries to the whole load: below the first tension carries nothing,
# above the second it carries everything, and no stiffness is needed.
_SLACK_RATIO = 1e-9
_STIFF_RATIO = 100

# Deepest dent of a short hit on a membrane, in units of J / (2 pi sigma c s): sqrt(2) times the
# maximum of Dawson's integral.
_SHORT_HIT = 0.765


def stiffness_under(
    force: float, depth: float, *, radius: float, density: float, speed: float
) -> float:
    """Stiffness at which a resting load sinks at most by a depth [1/s^2].

    Parameters
    ----------
    force : float
        [N].
    depth, radius : float
        [m], the latter of the footprint.
    density, speed : float
        Of the material [kg/m^2], [m/s].
    """
    if not force > 0:
        return 0.0
    ratio = 4 * math.pi * density * speed**2 * depth / force
    spread = SPREAD * radius  # standard deviation of the footprint [m]
    if ratio < _SLACK_RATIO:
        return force / (2 * math.pi * density * spread**2 * depth)
    if ratio >= _STIFF_RATIO:
        return 0.0
    return 2 * speed**2 / spread**2 / math.expm1(ratio)


def density_under(
    force: float, depth: float, *, radius: float, speed: float, stiffness: float
) -> float:
    """Density at which a resting load sinks at most by a depth [kg/m^2].

    Infinite without a stiffness. Arguments are as for `stiffness_under`; `stiffness` is the
    material's [1/s^2].
    """
    if not force > 0:
        return 0.0
    if not stiffness > 0:
        return math.inf
    return depth_under(force, radius=radius, density=1.0, speed=speed, stiffness=stiffness) / depth


def depth_under(
    force: float, *, radius: float, density: float, speed: float, stiffness: float
) -> float:
    """Greatest depth of a resting load [m]; the stiffness must be greater than 0.

    Arguments are as for `density_under`.
    """
    spread = SPREAD * radius  # standard deviation of the footprint [m]
    ratio = 2 * speed**2 / (spread**2 * stiffness)
    # depth over the depth on springs without tension
    share = math.log1p(ratio) / ratio if ratio > 0 else 1.0
    return share * force / (2 * math.pi * spread**2 * stiffness * density)


def density_after(
    impulse: float, depth: float, *, duration: float, radius: float, speed: float, stiffness: float
) -> float:
    """Density at which a hit [N s] dents the surface at most by about a depth [m] [kg/m^2].

    The hit counts as a load impulse / T for a time T, its duration or, if that is longer, the time
    of a wave across the footprint's standard deviation. In this time the inertia of the surface
    acts like a stiffness of 1 / T^2.
    """
    crossing = SPREAD * radius / speed if speed > 0 else 0.0  # [s]
    time = max(duration, crossing)
    inertia = 1 / time**2  # [1/s^2]
    return density_under(
        impulse / time, depth, radius=radius, speed=speed, stiffness=stiffness + inertia
    )


def density_for(impulse: float, depth: float, *, radius: float, speed: float) -> float:
    """Density at which a short hit dents a surface without stiffness by a depth [kg/m^2].

    The dent of a Gaussian footprint is deepest after 1.31 s / c, with s its standard deviation:
    there it is 0.765 J / (2 pi sigma c s), where 0.765 is sqrt(2) times the maximum of Dawson's
    integral.
    """
    return _SHORT_HIT * impulse / (2 * math.pi * speed * SPREAD * radius * depth)


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
    radius = _DEFAULT_RADIUS * size if radius is None else radius
    impulse, mass = _impulse_and_mass(hit)
    require_positive(radius=(radius, "m"), amplitude=(amplitude, "of the size"))
    require_positive(crossing=(crossing, "s"), decay=(decay, "s"))
    speed = size / crossing
    depth = amplitude * size
    radius = max(radius, FOOTPRINT * size)
    density = density_for(impulse, depth, radius=radius, speed=speed)
    weight = _GRAVITY * mass  # [N]
    bearing = stiffness_under(weight, depth / 2, radius=radius, density=density, speed=speed)
    return {
        "speed": speed,
        "damping": damping_for(decay),
        "stiffness": max(narrow_stiffness(size, speed), bearing),
        "viscosity": _VISCOSITY * speed * size,
        "density": density,
    }


def _impulse_and_mass(hit: float | tuple[float, float]) -> tuple[float, float]:
    """Impulse of a hit [N s], and the mass of its body [kg], 0 if it is unknown."""
    if not isinstance(hit, tuple | list):
        require_positive(hit=(hit, "N s"))
        return hit, 0.0
    if len(hit) != 2:
        raise SolverError(
            f"hit must be an impulse [N s], or a mass [kg] and a speed [m/s], got {hit!r}"
        )
    mass, velocity = hit
    require_positive(**{"mass of the hit": (mass, "kg"), "speed of the hit": (velocity, "m/s")})
    return BOUNCE * mass * velocity, mass


def narrow_stiffness(size: float, speed: float) -> float:
    """Stiffness that keeps dents narrow beside the object [1/s^2]."""
    return (NARROW * speed / size) ** 2


def damping_for(decay: float) -> float:
    """Damping at which waves fall to a tenth in a time [s], in 1/s."""
    return 2 * math.log(10) / decay
