"""Exact waves over an incompressible layer on a rigid base, which `Material.layer` is a fit to.

Shear modulus, density and thickness are 1, so that frequencies are in c_T / d and wave numbers in 1 / d.
"""

import numpy as np
from scipy.optimize import brentq


def lowest_square(q: float) -> float:
    """Square of the angular frequency of the lowest normal mode, of a wave number from 1 to 10."""
    # the determinant is 0 at 0 as well, where s is q
    squares = np.linspace(1.0, q**2 + 20.0, 800)
    signs = np.sign([determinant(q, square) for square in squares])
    first = int(np.flatnonzero(np.diff(signs) != 0)[0])
    return float(brentq(lambda square: determinant(q, square), squares[first], squares[first + 1], xtol=1e-12))


def determinant(q: float, square: float) -> float:
    """Of the lowest modes' conditions: no motion at the base, no shear and no pressure at the surface.

    The normal displacement is a sum of cosh and sinh of q z, which carry the pressure, and of s z with
    s^2 = q^2 - omega^2, which do not; the tangential one follows, since the volume is kept. Conditions are in rows.
    """
    s = np.sqrt(complex(q**2 - square, 1e-30))
    start = [1, 0, 1, 0]
    start_slope = [0, q, 0, 1]
    displacement = np.array([np.cosh(q), np.sinh(q), np.cosh(s), np.sinh(s) / s])
    slope = np.array([q * np.sinh(q), q * np.cosh(q), s * np.sinh(s), np.cosh(s)])
    curvature = np.array([q**2, q**2, s**2, s**2]) * displacement
    pressure = square * np.array([np.sinh(q) / q, np.cosh(q) / q, 0, 0])
    rows = np.array([start, start_slope, curvature + q**2 * displacement, 2 * slope - pressure])
    return float(np.linalg.det(rows / np.abs(rows).max(axis=0)).real)
