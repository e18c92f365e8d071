"""The energy of a map of triangles onto a sphere or flat charts: the cost of stretch and shear.

For the map from a reference triangle (area A) with singular values s1 >= s2, let

    D = s1^2 + s2^2 = sum of cotangent times squared side over 2 A,
    J = s1 s2 = (a x b . c) / 2 A.

On the unit sphere J takes the triple product of the triangle's three unit vectors in place of its
area: it vanishes exactly where the triangle folds over. Charts are the plane z = 1, where the
triple product is twice the area. A finite energy thus means that nothing is folded.

The star of a vertex are the triangles round it. Let the vertex move from p to p + dx x + dy y + dz
p with tangents x, y. Then J of each triangle is linear in the move, and D quadratic. A few numbers
a triangle hold both, and the energy at a trial position costs next to nothing.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from ..kernel import Floats, kernel
from ..mesh.vectors import Vector, combine, cross, dot, row, subtract

# A triangle is folded unless its triple product is greater than this.
MIN_TRIPLE_PRODUCT = 1e-16

# Step of a vertex, at most: radians on the sphere, or charts.
_MAX_STEP = 0.3

# Trial steps of a line search, at most, and the length of a single vertex's trial step over the one
# before.
MAX_TRIALS = 14
_SHORTER_TRIAL = 0.35

# Share of the fall that the slope promises, which a step must bring (Armijo's condition).
_MIN_FALL_SHARE = 1e-4

# Fall that the slope must promise, over the energy: less is round-off.
_MIN_PROMISED_FALL = 1e-13

# Square of b = (s1 - s2) / 2 over the square of a = (s1 + s2) / 2 below which b has no direction.
_MIN_SQUARED_RATIO = 1e-10

# Determinant of a 2 x 2 Hessian, over its squared mean eigenvalue, above which its inverse is taken
# as it is.
_MIN_DETERMINANT = 1e-3

# Least eigenvalue of a Hessian over the greatest, where its inverse is taken by eigenvectors.
_MIN_EIGENVALUE_SHARE = 1e-4

# Keeps a division by a second derivative finite.
_MIN_CURVATURE = 1e-300

# Directions in which a vertex may move: none, x, y, both.
FIXED, COLUMN, ROW, FREE = range(4)

# The numbers of a triangle in the expansion of a star, see `expand_star`: J and D at rest, their
# slopes (the slope of J along p is J itself), half of D's second derivative, and the reference
# area.
TERMS = 9
J, JX, JY, D, DX, DY, DZ, BEND, AREA = range(TERMS)


class Density(NamedTuple):
    """Energy per reference area, W = (D / 2)^p (even + long J^-2p + small J^-4p).

    The first term punishes a large singular value, hence short texel edges on the real surface,
    which set the wave solver's time step. D / J^2 is D of the inverse map: the second term punishes
    long texel edges. The third is a wall for areas that get too small.
    """

    power: int  # p: 2 or 4
    even: float
    long: float
    small: float


class Reference(NamedTuple):
    """The triangles to resemble, and what it costs to differ from them."""

    area: Floats  # [m]
    cotangent: Floats  # [3 m], of each corner, over twice the area
    density: Density


# Energy derivatives of a triangle times its area: W_D and W_J, which make its gradient, and the
# factors that make its Hessian: of the second derivatives of D and of J, and of gD gD^T,
# gD gJ^T + gJ gD^T and gJ gJ^T, with the gradients gD and gJ of D and J.
Shares: TypeAlias = tuple[float, float, float, float, float, float, float]


@kernel
def energy_density(dirichlet: float, inverse: float, density: Density) -> float:
    """W of D and of `inverse` = 1 / J; see `Density`."""
    square = inverse * inverse
    wall = square * square
    scale = (0.5 * dirichlet) * (0.5 * dirichlet)
    if density.power == 4:
        wall = wall * wall
        scale = scale * scale
    return scale * (density.even + wall * (density.long + density.small * wall))


@kernel
def density_derivatives(
    dirichlet: float, jacobian: float, density: Density
) -> tuple[float, float, float, float, float, float]:
    """W and its derivatives W_D, W_J, W_DD, W_DJ, W_JJ."""
    inverse = 1.0 / jacobian
    inverse_d = 1.0 / dirichlet
    p = float(density.power)
    square = inverse * inverse
    wall = square * square
    scale = (0.5 * dirichlet) * (0.5 * dirichlet)
    if density.power == 4:
        wall = wall * wall
        scale = scale * scale
    long = density.long * wall
    small = density.small * wall * wall
    w = scale * (density.even + long + small)
    slope_d = p * w * inverse_d
    slope_j = -scale * (2.0 * p * long + 4.0 * p * small) * inverse
    bend_d = (p - 1.0) * slope_d * inverse_d
    bend_mixed = p * slope_j * inverse_d
    bend_j = scale * (2.0 * p * (2.0 * p + 1.0) * long + 4.0 * p * (4.0 * p + 1.0) * small) * square
    return w, slope_d, slope_j, bend_d, bend_mixed, bend_j


@kernel
def projected_hessian(
    area: float, dirichlet: float, jacobian: float, density: Density
) -> tuple[float, Shares]:
    """Energy of a triangle of the given area, and the terms of its Hessian's positive part.

    With a = (s1 + s2)/2 and b = (s1 - s2)/2, W is a function of a^2 = D/4 + J/2 and b^2 = D/4 -
    J/2, and its Hessian splits into a twist (slope along a over a), a flip (slope along b over b),
    and a 2 x 2 block in (a, b) (Smith, de Goes, Kim 2019). Each of them loses its negative part in
    closed form.
    """
    w, wd, wj, wdd, wdj, wjj = density_derivatives(dirichlet, jacobian, density)
    aa = 0.25 * dirichlet + 0.5 * jacobian
    bb = max(0.25 * dirichlet - 0.5 * jacobian, 0.0)
    twist = 4.0 * wd + 2.0 * wj
    flip = 4.0 * wd - 2.0 * wj
    haa = aa * (16.0 * (wdd + wdj) + 4.0 * wjj) + twist
    hbb = bb * (16.0 * (wdd - wdj) + 4.0 * wjj) + flip
    root = np.sqrt(aa * bb)
    hab = root * (16.0 * wdd - 4.0 * wjj)
    if haa < 0.0 or hbb < 0.0 or haa * hbb < hab * hab:
        # keep the upper eigenvalue alone: its projector is (1 + (H - mean) / radius) / 2
        mean = 0.5 * (haa + hbb)
        half = 0.5 * (haa - hbb)
        radius = np.sqrt(half * half + hab * hab)
        upper = max(mean + radius, 0.0)
        turn = half / radius if radius > 0.0 else 0.0
        haa = 0.5 * upper * (1.0 + turn)
        hbb = 0.5 * upper * (1.0 - turn)
        hab = 0.5 * upper * hab / radius if radius > 0.0 else 0.0
    twist = max(twist, 0.0)
    flip = max(flip, 0.0)
    along_aa = 0.25 * (haa - twist) / aa
    along_bb = along_ab = 0.0
    if bb > _MIN_SQUARED_RATIO * aa:
        along_bb = 0.25 * (hbb - flip) / bb
        along_ab = 0.25 * hab / root
    dd = (along_aa + 2.0 * along_ab + along_bb) / 16.0
    dj = (along_aa - along_bb) / 8.0
    jj = (along_aa - 2.0 * along_ab + along_bb) / 4.0
    bend_d = 0.125 * (twist + flip)
    bend_j = 0.25 * (twist - flip)
    return area * w, (
        area * wd,
        area * wj,
        area * bend_d,
        area * bend_j,
        area * dd,
        area * dj,
        area * jj,
    )


@kernel
def expand_star(
    p: Vector,
    x: Vector,
    y: Vector,
    first: Floats,
    second: Floats,
    shapes: Floats,
    degree: int,
    terms: Floats,
) -> None:
    """Fill `terms` [degree, 9] for a vertex at p with tangents x, y.

    Triangle i has the corners p, first[i] and second[i], each [degree, 3], counterclockwise. Row i
    of `shapes` [degree, 4] is its reference: area, and cotangents of the angles at p, first[i] and
    second[i] over twice the area.
    """
    for i in range(degree):
        to_first = subtract(row(first, i), p)
        to_second = subtract(row(second, i), p)
        # both sides in the frame x, y, p
        a = (dot(to_first, x), dot(to_first, y), dot(to_first, p))
        b = (dot(to_second, x), dot(to_second, y), dot(to_second, p))
        c = subtract(b, a)
        normal = cross(a, b)
        area = shapes[i, 0]
        opposite = shapes[i, 1]
        left = shapes[i, 2]
        right = shapes[i, 3]
        half = 0.5 / area
        pull = combine(left, b, right, a)
        terms[i, J] = half * normal[2]
        terms[i, JX] = half * (normal[0] - c[1])
        terms[i, JY] = half * (normal[1] + c[0])
        terms[i, D] = opposite * dot(c, c) + left * dot(b, b) + right * dot(a, a)
        terms[i, DX] = -2.0 * pull[0]
        terms[i, DY] = -2.0 * pull[1]
        terms[i, DZ] = -2.0 * pull[2]
        terms[i, BEND] = left + right
        terms[i, AREA] = area


@kernel
def star_energy(terms: Floats, degree: int, density: Density, move: Vector) -> float:
    """Energy of the star after a move; infinite if a triangle is folded then."""
    dx, dy, dz = move
    square = dx * dx + dy * dy + dz * dz
    total = 0.0
    for i in range(degree):
        area = terms[i, AREA]
        jacobian = terms[i, J] * (1.0 + dz) + terms[i, JX] * dx + terms[i, JY] * dy
        if not 2.0 * area * jacobian > MIN_TRIPLE_PRODUCT:
            return np.inf
        dirichlet = (
            terms[i, D]
            + terms[i, DX] * dx
            + terms[i, DY] * dy
            + terms[i, DZ] * dz
            + terms[i, BEND] * square
        )
        total += area * energy_density(dirichlet, 1.0 / jacobian, density)
    return total


@kernel
def star_slopes(
    terms: Floats, degree: int, density: Density, curvature: float
) -> tuple[float, float, float, float, float, float]:
    """Energy, gradient x, y and Hessian xx, xy, yy of a star with its vertex at rest.

    The energy is infinite if a triangle is folded. With a curvature of 1, on the sphere, a tangent
    step also falls towards the centre, and the Hessian loses the radial slope; charts have 0.
    """
    energy = gx = gy = radial = hxx = hxy = hyy = 0.0
    for i in range(degree):
        area = terms[i, AREA]
        jacobian = terms[i, J]
        if not 2.0 * area * jacobian > MIN_TRIPLE_PRODUCT:
            return np.inf, 0.0, 0.0, 0.0, 0.0, 0.0
        w, wd, wj, wdd, wdj, wjj = density_derivatives(terms[i, D], jacobian, density)
        dx = terms[i, DX]
        dy = terms[i, DY]
        jx = terms[i, JX]
        jy = terms[i, JY]
        energy += area * w
        gx += area * (wd * dx + wj * jx)
        gy += area * (wd * dy + wj * jy)
        radial += area * (wd * terms[i, DZ] + wj * jacobian)
        flat = 2.0 * wd * terms[i, BEND]
        ddx = wdd * dx + wdj * jx
        ddy = wdd * dy + wdj * jy
        jjx = wdj * dx + wjj * jx
        jjy = wdj * dy + wjj * jy
        hxx += area * (flat + dx * ddx + jx * jjx)
        hyy += area * (flat + dy * ddy + jy * jjy)
        hxy += area * (dx * ddy + jx * jjy)
    radial *= curvature
    return energy, gx, gy, hxx - radial, hxy, hyy - radial


@kernel
def newton_direction(
    gx: float, gy: float, hxx: float, hxy: float, hyy: float
) -> tuple[float, float]:
    """Newton step -|H|^-1 g of a 2 x 2 Hessian, its eigenvalues taken by their absolute value."""
    mean = 0.5 * (hxx + hyy)
    half = 0.5 * (hxx - hyy)
    determinant = hxx * hyy - hxy * hxy
    if mean > 0.0 and determinant > _MIN_DETERMINANT * mean * mean:
        return (hxy * gy - hyy * gx) / determinant, (hxy * gx - hxx * gy) / determinant
    radius = np.sqrt(half * half + hxy * hxy)
    if radius > 0.0:
        # eigenvector of mean + radius, from the better conditioned of two formulas
        ux, uy = (half + radius, hxy) if half > 0.0 else (hxy, radius - half)
        length = np.sqrt(ux * ux + uy * uy)
        ux = ux / length
        uy = uy / length
    else:
        ux = 1.0
        uy = 0.0
    first = abs(mean + radius)
    second = abs(mean - radius)
    floor = _MIN_EIGENVALUE_SHARE * max(first, second)
    along = -(gx * ux + gy * uy) / max(first, floor)
    across = -(gy * ux - gx * uy) / max(second, floor)
    return along * ux - across * uy, along * uy + across * ux


@kernel
def tangent_move(a: float, b: float, curvature: float) -> Vector:
    """Move dx, dy, dz that takes p to p + a x + b y; a curvature of 1 keeps it on the sphere."""
    square = curvature * (a * a + b * b)
    length = np.sqrt(1.0 + square)
    return a / length, b / length, -square / (length * (1.0 + length))


@kernel
def descend(
    terms: Floats, degree: int, density: Density, curvature: float, freedom: int
) -> tuple[float, Vector]:
    """Find the Newton step of a star's vertex that folds no triangle.

    Returns the fall of the energy and the move.
    """
    stay = (0.0, 0.0, 0.0)
    energy, gx, gy, hxx, hxy, hyy = star_slopes(terms, degree, density, curvature)
    if not energy < np.inf:
        return 0.0, stay
    if freedom == FREE:
        sx, sy = newton_direction(gx, gy, hxx, hxy, hyy)
    elif freedom == COLUMN:
        sx = -gx / max(abs(hxx), _MIN_CURVATURE)
        sy = 0.0
    else:
        sx = 0.0
        sy = -gy / max(abs(hyy), _MIN_CURVATURE)
    descent = -(gx * sx + gy * sy)
    if not descent > _MIN_PROMISED_FALL * energy:
        return 0.0, stay
    step = min(1.0, _MAX_STEP / np.sqrt(sx * sx + sy * sy))
    for _ in range(MAX_TRIALS):
        move = tangent_move(step * sx, step * sy, curvature)
        lower = star_energy(terms, degree, density, move)
        if lower < energy - _MIN_FALL_SHARE * step * descent:
            fell_far = 2.0 * lower < energy  # high up a wall a Newton step is far too short
            while fell_far:
                step *= 2.0
                longer_move = tangent_move(step * sx, step * sy, curvature)
                longer_energy = star_energy(terms, degree, density, longer_move)
                fell_far = 2.0 * longer_energy < lower
                if longer_energy < lower:
                    move = longer_move
                    lower = longer_energy
            return energy - lower, move
        step *= _SHORTER_TRIAL
    return 0.0, stay
