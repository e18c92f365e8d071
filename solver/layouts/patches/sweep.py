"""Relaxing a seamless map one vertex after the other, each inside its star.

Newton steps of all vertices at once are cut short by the first triangle that would fold; sweeps clear such spots.
"""

from __future__ import annotations

import numpy as np

from ...kernel import Floats, kernel
from .energy import FOLDED, Reference, density, density_derivatives
from .frames import turned
from .seamless import COLUMN, FIXED, FREE, SeamlessMap, corner_place

_ARMIJO = 1e-4
_REACH = 0.3  # of a chart
_MOST_TRIALS = 14
# what is known of a triangle of the star: the place of its next corner and of the one before, in the vertex's frame,
# their cotangents, and its area
TERMS = 7


@kernel
def sweep(seamless: SeamlessMap, reference: Reference, backwards: bool) -> float:
    """Move every vertex once; return by how much the energy fell."""
    count = len(seamless.x)
    largest = 0
    for v in range(count):
        largest = max(largest, seamless.star_start[v + 1] - seamless.star_start[v])
    star = np.empty((largest, TERMS))
    fall = 0.0
    for i in range(count):
        v = count - 1 - i if backwards else i
        if seamless.freedom[v] != FIXED:
            fall += relax_vertex(seamless, reference, v, star)
    return fall


@kernel
def relax_vertex(seamless: SeamlessMap, reference: Reference, v: int, star: Floats) -> float:
    """Move one vertex by a Newton step inside its star; return by how much the energy fell. `star` is room."""
    degree = gather(seamless, reference, v, star)
    x, y, freedom = seamless.x[v, 0], seamless.x[v, 1], seamless.freedom[v]
    energy, gx, gy, hxx, hxy, hyy = _slopes(star, degree, x, y, reference.power)
    if not energy < np.inf:
        return 0.0
    if freedom == FREE:
        sx, sy = _descent(gx, gy, hxx, hxy, hyy)
    elif freedom == COLUMN:
        sx, sy = -gx / max(abs(hxx), 1e-300), 0.0
    else:
        sx, sy = 0.0, -gy / max(abs(hyy), 1e-300)
    descent = -(gx * sx + gy * sy)
    if not descent > 1e-13 * energy:
        return 0.0
    step = min(1.0, _REACH / np.sqrt(sx * sx + sy * sy))
    for _ in range(_MOST_TRIALS):
        lower = star_energy(star, degree, x + step * sx, y + step * sy, reference.power)
        if lower < energy - _ARMIJO * step * descent:
            # high up a wall a Newton step is far too short
            further = 2.0 * lower < energy
            while further and step * np.hypot(sx, sy) < _REACH:
                least = star_energy(star, degree, x + 2 * step * sx, y + 2 * step * sy, reference.power)
                further = 2.0 * least < lower
                if least < lower:
                    step, lower = 2 * step, least
                else:
                    break
            seamless.x[v, 0], seamless.x[v, 1] = x + step * sx, y + step * sy
            return energy - lower
        step *= 0.35
    return 0.0


@kernel
def gather(seamless: SeamlessMap, reference: Reference, v: int, star: Floats) -> int:
    """Fill in the star of a vertex, see above, and return how many triangles it has."""
    first, last = seamless.star_start[v], seamless.star_start[v + 1]
    for i in range(first, last):
        f, k = seamless.star[i] // 3, seamless.star[i] % 3
        back = (4 - seamless.turn[f, k]) % 4
        dx, dy = float(seamless.shift[f, k, 0]), float(seamless.shift[f, k, 1])
        for j in (1, 2):
            px, py = corner_place(seamless, f, (k + j) % 3)
            star[i - first, 2 * j - 2], star[i - first, 2 * j - 1] = turned(px - dx, py - dy, back)
        star[i - first, 4] = reference.cotangent[f, (k + 1) % 3]
        star[i - first, 5] = reference.cotangent[f, (k + 2) % 3]
        # with the cotangent of the vertex itself the triangle is known: it follows from the other two
        star[i - first, 6] = reference.area[f]
    return last - first


@kernel
def star_energy(star: Floats, degree: int, x: float, y: float, power: int) -> float:
    """Energy of a star whose vertex lies at x, y; infinite if a triangle is folded."""
    total = 0.0
    for i in range(degree):
        bx, by, cx, cy, cot_b, cot_c, area = star[i]
        ux, uy, vx, vy = bx - x, by - y, cx - x, cy - y
        flat = 0.5 * (ux * vy - uy * vx)
        if not flat > FOLDED:
            return np.inf
        cot_a = (1.0 - cot_b * cot_c) / (cot_b + cot_c)
        wx, wy = cx - bx, cy - by
        d = cot_a * (wx * wx + wy * wy) + cot_b * (vx * vx + vy * vy) + cot_c * (ux * ux + uy * uy)
        total += area * density(d / (2.0 * area), flat / area, power)
    return total


@kernel
def _slopes(
    star: Floats, degree: int, x: float, y: float, power: int
) -> tuple[float, float, float, float, float, float]:
    energy = gx = gy = hxx = hxy = hyy = 0.0
    for i in range(degree):
        bx, by, cx, cy, cot_b, cot_c, area = star[i]
        ux, uy, vx, vy = bx - x, by - y, cx - x, cy - y
        flat = 0.5 * (ux * vy - uy * vx)
        if not flat > FOLDED:
            return np.inf, 0.0, 0.0, 0.0, 0.0, 0.0
        half = 0.5 / area
        cot_a = (1.0 - cot_b * cot_c) / (cot_b + cot_c)
        wx, wy = cx - bx, cy - by
        d = half * (cot_a * (wx * wx + wy * wy) + cot_b * (vx * vx + vy * vy) + cot_c * (ux * ux + uy * uy))
        w, wd, wj, wdd, wdj, wjj = density_derivatives(d, flat / area, power)
        dx, dy = -2.0 * half * (cot_b * vx + cot_c * ux), -2.0 * half * (cot_b * vy + cot_c * uy)
        jx, jy = half * (by - cy), half * (cx - bx)
        bend = 2.0 * half * (cot_b + cot_c) * wd
        energy += area * w
        gx += area * (wd * dx + wj * jx)
        gy += area * (wd * dy + wj * jy)
        hxx += area * (bend + wdd * dx * dx + 2.0 * wdj * dx * jx + wjj * jx * jx)
        hyy += area * (bend + wdd * dy * dy + 2.0 * wdj * dy * jy + wjj * jy * jy)
        hxy += area * (wdd * dx * dy + wdj * (dx * jy + dy * jx) + wjj * jx * jy)
    return energy, gx, gy, hxx, hxy, hyy


@kernel
def _descent(gx: float, gy: float, hxx: float, hxy: float, hyy: float) -> tuple[float, float]:
    """Newton direction with the Hessian's eigenvalues made positive."""
    mean, radius = 0.5 * (hxx + hyy), np.hypot(0.5 * (hxx - hyy), hxy)
    angle = 0.5 * np.arctan2(2.0 * hxy, hxx - hyy)
    ux, uy = np.cos(angle), np.sin(angle)
    first, second = abs(mean + radius), abs(mean - radius)
    floor = 1e-4 * max(first, second)
    along = -(gx * ux + gy * uy) / max(first, floor)
    across = -(gy * ux - gx * uy) / max(second, floor)
    return along * ux - across * uy, along * uy + across * ux
