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

from ripple_sim.solver.kernel import Floats, kernel

from .seamless import SeamlessMap, corner_place
from .surface import Surface

FOLDED = 1e-15  # the area of a triangle on the charts must exceed this
_FLATTEST = 0.02  # sine of the least angle that the energy believes in


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


def reference_of(surface: Surface, charts: int, power: int) -> Reference:
    """The surface's own triangles, scaled to `charts` in all."""
    total = surface.areas.sum()
    scale = charts / total
    cotangent = np.empty((len(surface.F), 3))
    least = np.finfo(np.float64).tiny
    longest = np.zeros(len(surface.F))
    for k in range(3):
        a, b = (surface.V[surface.F[:, (k + j) % 3]] for j in (0, 1))
        longest = np.maximum(longest, ((b - a) ** 2).sum(axis=1))
    doubled = np.maximum(2 * surface.areas, _FLATTEST * longest + least)
    for k in range(3):
        a, b, c = (surface.V[surface.F[:, (k + j) % 3]] for j in range(3))
        cotangent[:, k] = np.einsum("ij,ij->i", b - a, c - a) / doubled
    return Reference(scale * np.maximum(surface.areas, 1e-9 * total / len(surface.F)), cotangent, power)


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
