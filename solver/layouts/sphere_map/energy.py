"""The energy of a sphere map: one number a triangle, from its Dirichlet energy and its area ratio.

For the map from a reference triangle (real shape, real area A) to the unit sphere, with singular values s1 >= s2,

    D = s1^2 + s2^2  = sum of cotangent times squared chord over 2 A,   J = s1 s2 = (a x b . c) / 2 A.

J takes the triple product of the triangle's three unit vectors in place of its area: it vanishes exactly where the
triangle folds over on the sphere, so that a finite energy means a bijection.

Vectors in space as tuples of three floats, for kernels: they live in registers and read like mathematics.

The Hessian of one triangle's energy density, made positive semidefinite.

With a = (s1 + s2)/2 and b = (s1 - s2)/2, the energy density is a function of a^2 = D/4 + J/2 and b^2 = D/4 - J/2, and
its Hessian splits into a twist (slope along a over a), a flip (slope along b over b), and a 2 x 2 block in (a, b)
(Smith, de Goes, Kim 2019). Each of them loses its negative part in closed form.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from ...kernel import Floats, Ints32, kernel

Vector: TypeAlias = tuple[float, float, float]


@kernel
def row(array: Floats, i: int) -> Vector:
    """Row i of an array of shape [n, 3]."""
    return array[i, 0], array[i, 1], array[i, 2]


@kernel
def set_row(array: Floats, i: int, a: Vector) -> None:
    """Write a into row i of an array of shape [n, 3]."""
    array[i, 0] = a[0]
    array[i, 1] = a[1]
    array[i, 2] = a[2]


@kernel
def subtract(a: Vector, b: Vector) -> Vector:
    """Difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def combine(s: float, a: Vector, t: float, b: Vector) -> Vector:
    """Linear combination s a + t b."""
    return s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2]


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def unit(a: Vector) -> Vector:
    """Return a scaled to length 1; a vector of length 0 stays as it is."""
    length = np.sqrt(dot(a, a))
    s = 1.0 / length if length > 0.0 else 1.0
    return s * a[0], s * a[1], s * a[2]


@kernel
def tangent_frame(p: Vector) -> tuple[Vector, Vector]:
    """Two orthonormal tangents x, y of the unit sphere at p, with x, y, p right-handed."""
    x = unit((0.0, p[2], -p[1])) if abs(p[0]) < 0.6 else unit((-p[2], 0.0, p[0]))
    return x, cross(p, x)


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


# W_D and W_J; then the Hessian is the second of D, the second of J, and gD gD^T, gD gJ^T + gJ gD^T and gJ gJ^T with the
# gradients gD and gJ, in these shares
Shares: TypeAlias = tuple[float, float, float, float, float, float, float]


@kernel
def projected_hessian(area: float, dirichlet: float, jacobian: float) -> tuple[float, Shares]:
    """Energy of a triangle of the given area, and the shares that make up its Hessian's positive part."""
    w, wd, wj, wdd, wdj, wjj = density_derivatives(dirichlet, jacobian)
    aa, bb = 0.25 * dirichlet + 0.5 * jacobian, max(0.25 * dirichlet - 0.5 * jacobian, 0.0)
    twist, flip = 4.0 * wd + 2.0 * wj, 4.0 * wd - 2.0 * wj
    haa = aa * (16.0 * (wdd + wdj) + 4.0 * wjj) + twist
    hbb = bb * (16.0 * (wdd - wdj) + 4.0 * wjj) + flip
    root = np.sqrt(aa * bb)
    hab = root * (16.0 * wdd - 4.0 * wjj)
    if haa < 0.0 or hbb < 0.0 or haa * hbb < hab * hab:
        # keep the upper eigenvalue alone: its projector is (1 + (H - mean) / radius) / 2
        mean, half = 0.5 * (haa + hbb), 0.5 * (haa - hbb)
        radius = np.sqrt(half * half + hab * hab)
        upper = max(mean + radius, 0.0)
        turn = half / radius if radius > 0.0 else 0.0
        haa, hbb = 0.5 * upper * (1.0 + turn), 0.5 * upper * (1.0 - turn)
        hab = 0.5 * upper * hab / radius if radius > 0.0 else 0.0
    twist, flip = max(twist, 0.0), max(flip, 0.0)
    along_aa = 0.25 * (haa - twist) / aa
    along_bb = along_ab = 0.0
    if bb > 1e-10 * aa:  # else b has no direction
        along_bb, along_ab = 0.25 * (hbb - flip) / bb, 0.25 * hab / root
    dd = (along_aa + 2.0 * along_ab + along_bb) / 16.0
    dj = (along_aa - along_bb) / 8.0
    jj = (along_aa - 2.0 * along_ab + along_bb) / 4.0
    bend_d, bend_j = 0.125 * (twist + flip), 0.25 * (twist - flip)
    return area * w, (area * wd, area * wj, area * bend_d, area * bend_j, area * dd, area * dj, area * jj)
