"""The energy of a sphere map: one number a triangle, from its Dirichlet energy and its area ratio.

For the map from a reference triangle (real shape, real area A) to the unit sphere, with singular values s1 >= s2,

    D = s1^2 + s2^2  = sum of cotangent times squared chord over 2 A,   J = s1 s2 = (a x b . c) / 2 A.

J takes the triple product of the triangle's three unit vectors in place of its area: it vanishes exactly where the
triangle folds over on the sphere, so that a finite energy means a bijection.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Floats, Ints32, kernel
from .vectors import cross, dot, row, subtract

FOLDED = 1e-16  # a triple product must exceed this
LONG = 0.53**8  # weights of long texel edges ...
SMALL = 0.48**16  # ... and of areas that are small on the sphere


class Reference(NamedTuple):
    """The triangles to resemble: area, and cotangent over twice the area of each corner."""

    area: Floats  # [m]
    cotangent: Floats  # [3 m]


@kernel
def density(dirichlet: float, inverse: float) -> float:
    """Energy per reference area, W = (D / 2)^4 (1 + (0.53 / J)^8 + (0.48 / J)^16), with `inverse` = 1 / J.

    The first term punishes a large singular value, hence short texel edges on the real surface, which set the wave
    solver's time step. D / J^2 is D of the inverse map: the second term punishes long texel edges, but far less. The
    third is a wall for areas that get too small on the sphere. Down to half their even share they are almost free:
    what limbs leave spares their roots from being stretched round. The wall is so steep that 99.9 % of a surface has
    texels less than twice too wide.
    """
    square = inverse * inverse
    eighth = (square * square) * (square * square)
    square_d = (0.5 * dirichlet) * (0.5 * dirichlet)
    return square_d * square_d * (1.0 + eighth * (LONG + SMALL * eighth))


@kernel
def density_derivatives(dirichlet: float, jacobian: float) -> tuple[float, float, float, float, float, float]:
    """W and its derivatives W_D, W_J, W_DD, W_DJ, W_JJ."""
    inverse, inverse_d = 1.0 / jacobian, 1.0 / dirichlet
    square = inverse * inverse
    eighth = (square * square) * (square * square)
    long, small = LONG * eighth, SMALL * eighth * eighth
    square_d = (0.5 * dirichlet) * (0.5 * dirichlet)
    fourth = square_d * square_d
    w = fourth * (1.0 + long + small)
    slope_d, slope_j = 4.0 * w * inverse_d, -fourth * (8.0 * long + 16.0 * small) * inverse
    bend_d, bend_mixed = 3.0 * slope_d * inverse_d, 4.0 * slope_j * inverse_d
    bend_j = fourth * (72.0 * long + 272.0 * small) * square
    return w, slope_d, slope_j, bend_d, bend_mixed, bend_j


@kernel
def total_energy(tail: Ints32, S: Floats, reference: Reference) -> float:
    """Energy of the whole map S; infinite if a triangle is folded."""
    cotangent = reference.cotangent
    total = 0.0
    for f in range(len(tail) // 3):
        a, b, c = row(S, tail[3 * f]), row(S, tail[3 * f + 1]), row(S, tail[3 * f + 2])
        ab, ac, bc = subtract(b, a), subtract(c, a), subtract(c, b)
        triple = dot(a, cross(ab, ac))
        if not triple > FOLDED:
            return np.inf
        area = reference.area[f]
        dirichlet = (
            cotangent[3 * f] * dot(bc, bc) + cotangent[3 * f + 1] * dot(ac, ac) + cotangent[3 * f + 2] * dot(ab, ab)
        )
        total += area * density(dirichlet, 2.0 * area / triple)
    return total
