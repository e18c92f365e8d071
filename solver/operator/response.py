"""How far a surface gives way under a load or a hit, and what stiffness or density keeps it from giving way further.

A load F that is spread like a Gaussian of standard deviation s presses a membrane with a restoring stiffness in by

    h = F / (4 pi sigma c^2) exp(z) E1(z),    z = s^2 k / (2 c^2),

the integral of exp(-q^2 s^2 / 2) / (c^2 q^2 + k) over all wave numbers q. For the exponential integral this takes
ln(1 + 1/z), which is an upper bound and can be inverted (Abramowitz and Stegun 1964, 5.1.20).
"""

from __future__ import annotations

import math

# Standard deviation of a footprint (1 - (d/r)^2)^3 along an axis, over its radius r.
SPREAD = 10**-0.5


def stiffness_under(force: float, depth: float, *, radius: float, density: float, speed: float) -> float:
    """Stiffness with which a resting load sinks by a depth at most [1/s^2].

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
    spread = SPREAD * radius
    if ratio < 1e-9:  # tension bears nothing
        return force / (2 * math.pi * density * spread**2 * depth)
    return 2 * speed**2 / spread**2 / math.expm1(ratio) if ratio < 100 else 0.0


def stiffness_after(
    impulse: float, depth: float, *, duration: float, radius: float, density: float, speed: float
) -> float:
    """Stiffness with which a hit dents the surface by about a depth at most [1/s^2].

    The hit counts as a load impulse / T for a time T, its duration or, if that is longer, the time that a wave takes
    across the footprint's standard deviation. In this time the surface's own inertia holds it back as a stiffness of
    1 / T^2 would.

    Parameters
    ----------
    impulse : float
        [N s].
    duration : float
        [s].
    depth, radius, density, speed : float
        As for `stiffness_under`.
    """
    time = _time(duration, radius, speed)
    whole = stiffness_under(impulse / time, depth, radius=radius, density=density, speed=speed)
    return max(whole - 1 / time**2, 0.0)


def density_under(force: float, depth: float, *, radius: float, speed: float, stiffness: float) -> float:
    """Density with which a resting load sinks by a depth at most [kg/m^2]; infinite without speed and stiffness.

    Parameters
    ----------
    force, depth, radius, speed : float
        As for `stiffness_under`.
    stiffness : float
        Of the material [1/s^2].
    """
    if not force > 0:
        return 0.0
    if not stiffness > 0:
        return math.inf
    ratio = 2 * speed**2 / ((SPREAD * radius) ** 2 * stiffness)
    share = math.log1p(ratio) / ratio if ratio > 0 else 1.0  # of what the stiffness alone would let it sink
    return share * force / (2 * math.pi * (SPREAD * radius) ** 2 * stiffness * depth)


def density_after(
    impulse: float, depth: float, *, duration: float, radius: float, speed: float, stiffness: float
) -> float:
    """Density with which a hit dents the surface by about a depth at most [kg/m^2]; see `stiffness_after`."""
    time = _time(duration, radius, speed)
    return density_under(impulse / time, depth, radius=radius, speed=speed, stiffness=stiffness + 1 / time**2)


def _time(duration: float, radius: float, speed: float) -> float:
    """How long a hit counts as a load [s]."""
    return max(duration, SPREAD * radius / speed if speed > 0 else 0.0)


def density_for(impulse: float, depth: float, *, radius: float, speed: float) -> float:
    """Density with which a short hit dents a surface without stiffness by a depth [kg/m^2].

    The dent of a Gaussian footprint is deepest after 1.31 s / c, with s its standard deviation: there it is
    0.765 J / (2 pi sigma c s), where 0.765 is sqrt(2) times the maximum of Dawson's integral.
    """
    return 0.765 * impulse / (2 * math.pi * speed * SPREAD * radius * depth)
