"""The star of one vertex as a function of that vertex's position.

Let the vertex move from p to p + dx x + dy y + dz p with tangents x, y. Of each triangle of its star, J is linear in
the move and D quadratic: a few numbers a triangle say all, and a trial position costs next to nothing.
"""

from __future__ import annotations

import numpy as np

from ...kernel import Floats, kernel
from .energy import FOLDED, density, density_derivatives
from .vectors import Vector, dot, row, subtract

# what is known of a triangle: J and D at rest, their slopes (that of J along p is J itself), half of D's second
# derivative, and the reference area
J, JX, JY, D, DX, DY, DZ, BEND, AREA = range(9)
TERMS = 9


@kernel
def expand(p: Vector, x: Vector, y: Vector, ring: Floats, shapes: Floats, degree: int, terms: Floats) -> None:
    """Fill `terms` [degree, 9] for a vertex at p with tangents x, y.

    Triangle i has the corners p, ring[i] and ring[i + 1], counterclockwise; after the last of the ring, [degree, 3],
    comes the first. Row i of `shapes` [degree, 4] is the triangle's reference (see `level.star_shapes`).
    """
    e = subtract(row(ring, degree - 1), p)
    ax, ay, az = dot(e, x), dot(e, y), dot(e, p)
    i = degree - 1
    for k in range(degree):
        e = subtract(row(ring, k), p)
        bx, by, bz = dot(e, x), dot(e, y), dot(e, p)
        area, opposite, left, right = shapes[i, 0], shapes[i, 1], shapes[i, 2], shapes[i, 3]
        half = 0.5 / area
        cx, cy, cz = bx - ax, by - ay, bz - az
        terms[i, J] = half * (ax * by - ay * bx)
        terms[i, JX] = half * (ay * bz - az * by - cy)
        terms[i, JY] = half * (az * bx - ax * bz + cx)
        terms[i, D] = (
            opposite * (cx * cx + cy * cy + cz * cz)
            + left * (bx * bx + by * by + bz * bz)
            + right * (ax * ax + ay * ay + az * az)
        )
        terms[i, DX] = -2.0 * (left * bx + right * ax)
        terms[i, DY] = -2.0 * (left * by + right * ay)
        terms[i, DZ] = -2.0 * (left * bz + right * az)
        terms[i, BEND] = left + right
        terms[i, AREA] = area
        ax, ay, az = bx, by, bz
        i = k


@kernel
def energy_after(move: Vector, terms: Floats, degree: int) -> float:
    """Energy of the star after a move; infinite if a triangle is folded then."""
    dx, dy, dz = move
    square = dx * dx + dy * dy + dz * dz
    total = 0.0
    for i in range(degree):
        area = terms[i, AREA]
        jacobian = terms[i, J] * (1.0 + dz) + terms[i, JX] * dx + terms[i, JY] * dy
        if not 2.0 * area * jacobian > FOLDED:
            return np.inf
        dirichlet = terms[i, D] + terms[i, DX] * dx + terms[i, DY] * dy + terms[i, DZ] * dz + terms[i, BEND] * square
        total += area * density(dirichlet, 1.0 / jacobian)
    return total


@kernel
def tangent_move(a: float, b: float) -> Vector:
    """Move dx, dy, dz that takes p to p + a x + b y, brought back to the sphere."""
    square = a * a + b * b
    length = np.sqrt(1.0 + square)
    return a / length, b / length, -square / (length * (1.0 + length))


@kernel
def slopes(terms: Floats, degree: int) -> tuple[float, float, float, float, float, float]:
    """Energy, gradient x, y and Hessian xx, xy, yy at rest; the energy is infinite if a triangle is folded."""
    energy = gx = gy = radial = hxx = hxy = hyy = 0.0
    for i in range(degree):
        area, jacobian = terms[i, AREA], terms[i, J]
        if not 2.0 * area * jacobian > FOLDED:
            return np.inf, 0.0, 0.0, 0.0, 0.0, 0.0
        w, wd, wj, wdd, wdj, wjj = density_derivatives(terms[i, D], jacobian)
        dx, dy, jx, jy = terms[i, DX], terms[i, DY], terms[i, JX], terms[i, JY]
        energy += area * w
        gx += area * (wd * dx + wj * jx)
        gy += area * (wd * dy + wj * jy)
        radial += area * (wd * terms[i, DZ] + wj * jacobian)
        flat = 2.0 * wd * terms[i, BEND]
        ddx, ddy, jjx, jjy = wdd * dx + wdj * jx, wdd * dy + wdj * jy, wdj * dx + wjj * jx, wdj * dy + wjj * jy
        hxx += area * (flat + dx * ddx + jx * jjx)
        hyy += area * (flat + dy * ddy + jy * jjy)
        hxy += area * (dx * ddy + jx * jjy)
    # on the sphere a tangent step also falls towards the centre: the Hessian loses the radial slope
    return energy, gx, gy, hxx - radial, hxy, hyy - radial
