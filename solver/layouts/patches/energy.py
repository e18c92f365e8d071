"""The energy of a seamless map: what a triangle costs that is stretched, squeezed or sheared.

For the map from a triangle of the surface (area A, scaled so that a chart has area 1 on average) to the charts, with
singular values s1 >= s2, let D = s1^2 + s2^2 and J = s1 s2. The energy for each unit of area is

    W = ((D / 2)^p + (D / 2 J^2)^p) / 2,

the mean of the Dirichlet energies of the map and of its inverse, each to the power p: 1 for an isometry, infinite at a
fold. With p = 1 a map is easily brought to its least energy; a larger p reduces the worst spots at the cost of others.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Floats, Ints, kernel
from ..sphere_map.vectors import cross, dot, row, subtract
from .seamless import SeamlessMap, corner_place

FOLDED = 1e-15  # the area of a triangle on the charts must exceed this
_FLATTEST = 0.02  # least double area over squared length that the energy believes in
_LEAST_AREA = 1e-6  # of a triangle, in units of their mean


class Reference(NamedTuple):
    """The triangles to resemble, and how much."""

    area: Floats  # [m]
    cotangent: Floats  # [m, 3], of their angles
    power: int  # p


@kernel
def density(dirichlet: float, jacobian: float, power: int) -> float:
    """Energy W of D and J for each unit of area."""
    return 0.5 * (0.5 * dirichlet) ** power * (1.0 + (1.0 / (jacobian * jacobian)) ** power)


@kernel
def density_derivatives(
    dirichlet: float, jacobian: float, power: int
) -> tuple[float, float, float, float, float, float]:
    """W and its derivatives W_D, W_J, W_DD, W_DJ, W_JJ."""
    straight = 0.5 * (0.5 * dirichlet) ** power
    inverse = straight * (1.0 / (jacobian * jacobian)) ** power
    w, p = straight + inverse, float(power)
    slope_d, slope_j = p * w / dirichlet, -2.0 * p * inverse / jacobian
    bend_d, mixed = (p - 1.0) * slope_d / dirichlet, p * slope_j / dirichlet
    return w, slope_d, slope_j, bend_d, mixed, 2.0 * p * (2.0 * p + 1.0) * inverse / (jacobian * jacobian)


def reference_of(V: Floats, F: Ints, charts: int, power: int) -> Reference:
    """The shapes of the triangles F [m, 3], their areas in units in which they add up to the number of charts."""
    areas, cotangent = _shapes(V, F, np.finfo(np.float64).tiny)
    areas = np.maximum(areas, _LEAST_AREA * areas.mean())
    return Reference(areas * (charts / areas.sum()), cotangent, power)


@kernel
def _shapes(V: Floats, F: Ints, tiny: float) -> tuple[Floats, Floats]:
    """Areas [m] and cotangents [m, 3] of triangles."""
    areas, cotangent = np.empty(len(F)), np.empty((len(F), 3))
    for f in range(len(F)):
        a, b, c = row(V, F[f, 0]), row(V, F[f, 1]), row(V, F[f, 2])
        ab, ac, bc = subtract(b, a), subtract(c, a), subtract(c, b)
        normal = cross(ab, ac)
        double = np.sqrt(dot(normal, normal))
        squares = (dot(bc, bc), dot(ac, ac), dot(ab, ab))
        dots = (dot(ab, ac), -dot(ab, bc), dot(ac, bc))
        top = 0 if squares[0] >= max(squares[1], squares[2]) else (1 if squares[1] >= squares[2] else 2)
        left, right = (top + 1) % 3, (top + 2) % 3
        areas[f] = max(double / 2, tiny)
        # needles count as a little thicker: the corner opposite to their longest side stands higher
        double = max(double, _FLATTEST * squares[top], tiny)
        cotangent[f, left], cotangent[f, right] = dots[left] / double, dots[right] / double
        total = max(cotangent[f, left] + cotangent[f, right], tiny)
        cotangent[f, top] = (1.0 - cotangent[f, left] * cotangent[f, right]) / total
    return areas, cotangent


@kernel
def shape_of(seamless: SeamlessMap, reference: Reference, f: int) -> tuple[float, float, float]:
    """D and J of a triangle, and its area on the charts."""
    ax, ay = corner_place(seamless, f, 0)
    bx, by = corner_place(seamless, f, 1)
    cx, cy = corner_place(seamless, f, 2)
    ux, uy, vx, vy = bx - ax, by - ay, cx - ax, cy - ay
    area = 0.5 * (ux * vy - uy * vx)
    cotangent = reference.cotangent[f]
    wx, wy = cx - bx, cy - by
    dirichlet = (
        cotangent[0] * (wx * wx + wy * wy) + cotangent[1] * (vx * vx + vy * vy) + cotangent[2] * (ux * ux + uy * uy)
    )
    return dirichlet / (2.0 * reference.area[f]), area / reference.area[f], area


@kernel
def total_energy(seamless: SeamlessMap, reference: Reference) -> float:
    """Energy of the whole map; infinite if a triangle is folded."""
    total = 0.0
    for f in range(len(seamless.F)):
        dirichlet, jacobian, area = shape_of(seamless, reference, f)
        if not area > FOLDED:
            return np.inf
        total += reference.area[f] * density(dirichlet, jacobian, reference.power)
    return total
