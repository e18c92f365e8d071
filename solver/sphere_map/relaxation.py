"""Gauss-Seidel relaxation: one vertex at a time takes a Newton step in its tangent plane that lowers the energy.

A step never folds a triangle, since a fold has infinite energy. Sweeps get out of states where the global Newton method
sticks (a long cigar), and remove what is rough; what is smooth is the work of `newton`.
"""

from __future__ import annotations

import numpy as np

from .corner_table import following, preceding
from .energy import FOLDED, Reference, density_derivatives, star_energy
from .vectors import Floats, Ints, combine, cross, dot, kernel, row, set_row, subtract, tangent_frame, unit

REACH = 0.3  # longest step [rad]
ARMIJO = 1e-4


@kernel
def _descent_direction(gx: float, gy: float, hxx: float, hxy: float, hyy: float) -> tuple[float, float]:
    """Newton step -|H|^-1 g of a 2 x 2 Hessian, its eigenvalues taken by their absolute value."""
    mean, half = 0.5 * (hxx + hyy), 0.5 * (hxx - hyy)
    radius = np.sqrt(half * half + hxy * hxy)
    if radius > 0.0:
        # eigenvector of mean + radius, from the better conditioned of two formulas
        ux, uy = (half + radius, hxy) if half > 0.0 else (hxy, radius - half)
        length = np.sqrt(ux * ux + uy * uy)
        ux, uy = ux / length, uy / length
    else:
        ux, uy = 1.0, 0.0
    first, second = abs(mean + radius), abs(mean - radius)
    floor = 1e-4 * max(first, second)
    along = -(gx * ux + gy * uy) / max(first, floor)
    across = -(gy * ux - gx * uy) / max(second, floor)
    return along * ux - across * uy, along * uy + across * ux


@kernel
def relax_vertex(v: int, star: Ints, degree: int, tail: Ints, S: Floats, reference: Reference) -> float:
    """Move v to lower the energy of its star; return by how much it fell."""
    p = row(S, v)
    x, y = tangent_frame(p)
    cotangent = reference.cotangent
    energy = gx = gy = radial = hxx = hxy = hyy = 0.0
    for i in range(degree):
        h = star[i]
        g, k = following(h), preceding(h)
        area = reference.area[h // 3]
        b, c = row(S, tail[g]), row(S, tail[k])
        pb, pc, bc = subtract(b, p), subtract(c, p), subtract(c, b)
        triple = dot(p, cross(pb, pc))
        if not triple > FOLDED:
            return 0.0
        jacobian = 0.5 * triple / area
        dirichlet = cotangent[h] * dot(bc, bc) + cotangent[g] * dot(pc, pc) + cotangent[k] * dot(pb, pb)
        w, wd, wj, wdd, wdj, wjj = density_derivatives(dirichlet, jacobian)
        grad_d = combine(-2.0 * cotangent[k], pb, -2.0 * cotangent[g], pc)
        grad_j = combine(0.5 / area, cross(b, c), 0.0, p)
        dx, dy, jx, jy = dot(grad_d, x), dot(grad_d, y), dot(grad_j, x), dot(grad_j, y)
        energy += area * w
        gx += area * (wd * dx + wj * jx)
        gy += area * (wd * dy + wj * jy)
        radial += area * (wd * dot(grad_d, p) + wj * dot(grad_j, p))
        flat = 2.0 * wd * (cotangent[g] + cotangent[k])
        hxx += area * (flat + wdd * dx * dx + 2.0 * wdj * dx * jx + wjj * jx * jx)
        hyy += area * (flat + wdd * dy * dy + 2.0 * wdj * dy * jy + wjj * jy * jy)
        hxy += area * (wdd * dx * dy + wdj * (dx * jy + dy * jx) + wjj * jx * jy)
    # on the sphere a tangent step also falls towards the centre: the Hessian loses the radial slope
    sx, sy = _descent_direction(gx, gy, hxx - radial, hxy, hyy - radial)
    descent = -(gx * sx + gy * sy)
    if not descent > 1e-13 * energy:
        return 0.0
    step = min(1.0, REACH / np.sqrt(sx * sx + sy * sy))
    direction = combine(sx, x, sy, y)
    for _ in range(14):
        q = unit(combine(1.0, p, step, direction))
        lower = star_energy(q, star, degree, tail, S, reference)
        if lower < energy - ARMIJO * step * descent:
            further = 2.0 * lower < energy  # high up a wall a Newton step is far too short
            while further:
                step *= 2.0
                ahead = unit(combine(1.0, p, step, direction))
                least = star_energy(ahead, star, degree, tail, S, reference)
                further = 2.0 * least < lower
                if least < lower:
                    q, lower = ahead, least
            set_row(S, v, q)
            return energy - lower
        step *= 0.35
    return 0.0


@kernel
def sweep(star_start: Ints, star: Ints, tail: Ints, S: Floats, reference: Reference, backwards: bool) -> float:
    """Relax every vertex once, in order or backwards; return by how much the energy fell.

    The star of vertex v is `star[star_start[v]:star_start[v + 1]]`.
    """
    count = len(star_start) - 1
    fall = 0.0
    for i in range(count):
        v = count - 1 - i if backwards else i
        first, last = star_start[v], star_start[v + 1]
        fall += relax_vertex(v, star[first:last], last - first, tail, S, reference)
    return fall
