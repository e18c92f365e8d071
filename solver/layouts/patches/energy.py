"""The energy of a seamless map, and its relaxation: what a triangle costs that is stretched, squeezed or sheared.

For the map from a triangle of the surface (area A, scaled so that a chart has area 1 on average) to the charts, with
singular values s1 >= s2, let D = s1^2 + s2^2 and J = s1 s2. The energy for each unit of area is

    W = ((D / 2)^p + (D / 2 J^2)^p) / 2,

the mean of the Dirichlet energies of the map and of its inverse, each to the power p: 1 for an isometry, infinite at a
fold. With p = 1 a map is easily brought to its least energy; a larger p reduces the worst spots at the cost of others.

In the basis of its singular vectors, the Hessian of a function f(s1, s2) of a 2 x 2 matrix falls into a 2 x 2 block of
second derivatives, and two numbers: for the antisymmetric change and for the symmetric one off the diagonal.

`energy` of the package above says the same law for both maps; the sums here are in another order, and maps onto charts
amplify round-off: in that order every atlas of this layout would be another, as good as this one.

Newton steps of all vertices at once are cut short by the first triangle that would fold; sweeps over single vertices,
each inside its star, clear such spots.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import Floats, Ints, Ints32, kernel
from ...mesh.topology import edges_of
from ...mesh.vectors import cross, dot, subtract
from ..energy import ARMIJO, COLUMN, FIXED, FREE, MOST_TRIALS, REACH
from ..newton import CG_TOLERANCE, System, conjugate_gradients, descend_by_newton, line_search
from .seamless import Complex, SeamlessMap, corner_place, rehome, rehome_vertex, square, turned, wedge

FOLDED = 1e-15  # the area of a triangle on the charts must exceed this
_POWER = 2  # p
_FLATTEST = 0.02  # least double area over squared length that the energy believes in
_LEAST_AREA = 1e-6  # of a triangle, in units of their mean
# what is known of a triangle of the star: the place of its next corner and of the one before, in the vertex's frame,
# their cotangents, and its area
TERMS = 7


class ChartShapes(NamedTuple):
    """The triangles that a map onto charts is to resemble, and how much."""

    area: Floats  # [m]
    cotangent: Floats  # [m, 3], of their angles


def shapes_of(V: NDArray[np.float64], F: NDArray[np.int64], charts: int) -> ChartShapes:
    """The shapes of the triangles F [m, 3], their areas in units in which they add up to the number of charts."""
    a, b, c = (V[F[:, k]].T for k in range(3))
    ab, ac, bc = subtract(b, a), subtract(c, a), subtract(c, b)
    normal, tiny = cross(ab, ac), np.finfo(np.float64).tiny
    double = np.sqrt(dot(normal, normal))
    area = np.maximum(double / 2, tiny)
    area = np.maximum(area, _LEAST_AREA * area.mean())
    area *= charts / area.sum()
    squares = np.stack([dot(bc, bc), dot(ac, ac), dot(ab, ab)])
    top, every = squares.argmax(axis=0), np.arange(len(F))
    # needles count as a little thicker: the corner opposite to their longest side stands higher
    double = np.maximum(np.maximum(double, _FLATTEST * squares[top, every]), tiny)
    cotangent = np.stack([dot(ab, ac), -dot(ab, bc), dot(ac, bc)]) / double
    left, right = cotangent[(top + 1) % 3, every], cotangent[(top + 2) % 3, every]
    cotangent[top, every] = (1.0 - left * right) / np.maximum(left + right, tiny)
    return ChartShapes(area, np.ascontiguousarray(cotangent.T))


def total_energy(seamless: SeamlessMap, shapes: ChartShapes) -> float:
    """Energy of the whole map; infinite if a triangle is folded."""
    return energy_of(seamless, shapes, np.arange(len(seamless.F)))


@kernel
def energy_of(seamless: SeamlessMap, shapes: ChartShapes, triangles: Ints) -> float:
    """Energy of some triangles [k]; infinite if one is folded."""
    total = 0.0
    for f in triangles:
        a, b, c = corner_place(seamless, f, 0), corner_place(seamless, f, 1), corner_place(seamless, f, 2)
        area, cotangent = 0.5 * wedge(b - a, c - a), shapes.cotangent[f]
        if not area > FOLDED:
            return np.inf
        dirichlet = cotangent[0] * square(c - b) + cotangent[1] * square(c - a) + cotangent[2] * square(b - a)
        dirichlet, jacobian = dirichlet / (2.0 * shapes.area[f]), area / shapes.area[f]
        total += shapes.area[f] * density(dirichlet, jacobian)
    return total


@kernel
def density(dirichlet: float, jacobian: float) -> float:
    """Energy W of D and J for each unit of area."""
    return 0.5 * (0.5 * dirichlet) ** _POWER * (1.0 + (1.0 / (jacobian * jacobian)) ** _POWER)


@kernel
def density_derivatives(dirichlet: float, jacobian: float) -> tuple[float, float, float, float, float, float]:
    """W and its derivatives W_D, W_J, W_DD, W_DJ, W_JJ."""
    straight = 0.5 * (0.5 * dirichlet) ** _POWER
    inverse = straight * (1.0 / (jacobian * jacobian)) ** _POWER
    w, p = straight + inverse, float(_POWER)
    slope_d, slope_j = p * w / dirichlet, -2.0 * p * inverse / jacobian
    bend_d, mixed = (p - 1.0) * slope_d / dirichlet, p * slope_j / dirichlet
    return w, slope_d, slope_j, bend_d, mixed, 2.0 * p * (2.0 * p + 1.0) * inverse / (jacobian * jacobian)


@kernel
def assemble(
    seamless: SeamlessMap,
    shapes: ChartShapes,
    edge: Ints,
    ends: Ints32,
    system: System,
) -> None:
    """Add the triangles to the system, in the vertices' own frames. `edge` [m, 3] are their edges, `ends` [e, 2]."""
    gradient, diagonal, blocks = system
    slopes, modes, curvature = np.empty(3, np.complex128), np.empty((4, 3), np.complex128), np.empty(4)
    for f in range(len(seamless.F)):
        _triangle(seamless, shapes, f, slopes, modes, curvature)
        for k in range(3):
            v, back = seamless.F[f, k], (4 - seamless.turn[f, k]) % 4
            slope = turned(slopes[k], back)
            gradient[v, 0] += slope.real
            gradient[v, 1] += slope.imag
            for m in range(4):
                mode = modes[m, k] = turned(modes[m, k], back)
                diagonal[v, 0] += curvature[m] * mode.real * mode.real
                diagonal[v, 1] += curvature[m] * mode.real * mode.imag
                diagonal[v, 2] += curvature[m] * mode.imag * mode.imag
        for k in range(3):
            e, j = edge[f, k], (k + 1) % 3
            p, q = (k, j) if ends[e, 0] == seamless.F[f, k] else (j, k)
            for m in range(4):
                a, b = modes[m, p], modes[m, q]
                blocks[e, 0] += curvature[m] * a.real * b.real
                blocks[e, 1] += curvature[m] * a.real * b.imag
                blocks[e, 2] += curvature[m] * a.imag * b.real
                blocks[e, 3] += curvature[m] * a.imag * b.imag


@kernel
def _triangle(
    seamless: SeamlessMap, shapes: ChartShapes, f: int, slopes: Complex, modes: Complex, curvature: Floats
) -> None:
    """Gradient [3] at the corners of a triangle, and its Hessian: the sum of c m m', modes [4, 3]."""
    area, cotangent = shapes.area[f], shapes.cotangent[f]
    # a flat copy of the triangle, by its cotangents: side ab along x
    total = cotangent[0] + cotangent[1]
    length = np.sqrt(2.0 * area * max(total, 1e-12))
    height = 2.0 * area / length
    foot = cotangent[0] * height
    # gradients of the corners' hat functions
    second, third = complex(1.0 / length, -foot / (length * height)), complex(0.0, 1.0 / height)
    hats = -second - third, second, third
    a = b = c = d = 0.0
    for k in range(3):
        place, hat = corner_place(seamless, f, k), hats[k]
        a, b = a + place.real * hat.real, b + place.real * hat.imag
        c, d = c + place.imag * hat.real, d + place.imag * hat.imag
    # singular values of (a b; c d) = U S V', rotations by half sums and differences of two angles
    sum_length, sum_angle = np.hypot(a + d, c - b) / 2, np.arctan2(c - b, a + d)
    rest_length, rest_angle = np.hypot(a - d, c + b) / 2, np.arctan2(c + b, a - d)
    s1, s2 = sum_length + rest_length, sum_length - rest_length
    left, right = (sum_angle + rest_angle) / 2, (rest_angle - sum_angle) / 2
    cl, sl, cr, sr = np.cos(left), np.sin(left), np.cos(right), np.sin(right)
    _, wd, wj, wdd, wdj, wjj = density_derivatives(s1 * s1 + s2 * s2, s1 * s2)
    f1, f2 = 2 * s1 * wd + s2 * wj, 2 * s2 * wd + s1 * wj
    f11 = 2 * wd + 4 * s1 * s1 * wdd + 4 * s1 * s2 * wdj + s2 * s2 * wjj
    f22 = 2 * wd + 4 * s2 * s2 * wdd + 4 * s1 * s2 * wdj + s1 * s1 * wjj
    f12 = wj + 4 * s1 * s2 * wdd + 2 * (s1 * s1 + s2 * s2) * wdj + s1 * s2 * wjj
    mean, half, angle = (f11 + f22) / 2, np.hypot((f11 - f22) / 2, f12), np.arctan2(2 * f12, f11 - f22) / 2
    curvature[0], curvature[1] = area * max(mean + half, 0.0), area * max(mean - half, 0.0)
    curvature[2] = area * max(wd + wj / 2, 0.0)
    curvature[3] = area * max(wd - wj / 2, 0.0)
    ca, sa = np.cos(angle), np.sin(angle)
    for k in range(3):
        # the hat's gradient along the right singular vectors
        p, q = cr * hats[k].real + sr * hats[k].imag, -sr * hats[k].real + cr * hats[k].imag
        slopes[k] = complex(area * (cl * f1 * p - sl * f2 * q), area * (sl * f1 * p + cl * f2 * q))
        # changes (first: along U; second: across) of S for the four modes
        for m, u, v in ((0, ca * p, sa * q), (1, -sa * p, ca * q), (2, -q, p), (3, q, p)):
            modes[m, k] = complex(cl * u - sl * v, sl * u + cl * v)


@kernel
def sweep(
    seamless: SeamlessMap,
    shapes: ChartShapes,
    vertices: Ints,
    star: Floats,
    follow_at_once: bool,
) -> float:
    """Move some vertices, one after the other; return by how much the energy fell. `star` is room for any, [d, 7].

    Each is followed into its new chart at once, or left to `rehome`.
    """
    fall = 0.0
    for v in vertices:
        if seamless.freedom[v] != FIXED:
            before = seamless.z[v]
            fall += relax_vertex(seamless, shapes, v, star)
            if follow_at_once:
                rehome_vertex(seamless, v, before)
    return fall


@kernel
def relax_vertex(seamless: SeamlessMap, shapes: ChartShapes, v: int, star: Floats) -> float:
    """Move one vertex by a Newton step inside its star; return by how much the energy fell. `star` is room."""
    degree = gather(seamless, shapes, v, star)
    x, y, freedom = seamless.z[v].real, seamless.z[v].imag, seamless.freedom[v]
    energy, gx, gy, hxx, hxy, hyy = star_slopes(star, degree, x, y)
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
    step = min(1.0, REACH / np.sqrt(sx * sx + sy * sy))
    for _ in range(MOST_TRIALS):
        lower = star_energy(star, degree, x + step * sx, y + step * sy)
        if lower < energy - ARMIJO * step * descent:
            # high up a wall a Newton step is far too short
            further = 2.0 * lower < energy
            while further and step * np.hypot(sx, sy) < REACH:
                least = star_energy(star, degree, x + 2 * step * sx, y + 2 * step * sy)
                further = 2.0 * least < lower
                if least < lower:
                    step, lower = 2 * step, least
                else:
                    break
            seamless.z[v] = complex(x + step * sx, y + step * sy)
            return energy - lower
        step *= 0.35
    return 0.0


@kernel
def gather(seamless: SeamlessMap, shapes: ChartShapes, v: int, star: Floats) -> int:
    """Fill in the star of a vertex, see above, and return how many triangles it has."""
    first, last = seamless.star_start[v], seamless.star_start[v + 1]
    for i in range(first, last):
        f, k = seamless.star[i] // 3, seamless.star[i] % 3
        back = (4 - seamless.turn[f, k]) % 4
        for j in (1, 2):
            place = turned(corner_place(seamless, f, (k + j) % 3) - seamless.shift[f, k], back)
            star[i - first, 2 * j - 2], star[i - first, 2 * j - 1] = place.real, place.imag
        star[i - first, 4] = shapes.cotangent[f, (k + 1) % 3]
        star[i - first, 5] = shapes.cotangent[f, (k + 2) % 3]
        # with the cotangent of the vertex itself the triangle is known: it follows from the other two
        star[i - first, 6] = shapes.area[f]
    return last - first


@kernel
def star_energy(star: Floats, degree: int, x: float, y: float) -> float:
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
        total += area * density(d / (2.0 * area), flat / area)
    return total


@kernel
def star_slopes(star: Floats, degree: int, x: float, y: float) -> tuple[float, float, float, float, float, float]:
    """Energy of a star whose vertex lies at x, y, gradient x, y and Hessian xx, xy, yy; infinite if one is folded."""
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
        w, wd, wj, wdd, wdj, wjj = density_derivatives(d, flat / area)
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


_LONGEST_STEP = 0.5  # of a chart
_SWEEPS = 2
_MOST_STEPS = 30
_CG_RANGE = 40, 200


def scratch(seamless: SeamlessMap) -> Floats:
    """Room for the star of any vertex, [d, 7]."""
    return np.empty((int(np.diff(seamless.star_start).max()), TERMS))


def sweep_all(seamless: SeamlessMap, shapes: ChartShapes, backwards: bool) -> float:
    """Move every vertex once, and follow them into their charts; return by how much the energy fell."""
    before, vertices = seamless.z.copy(), np.arange(len(seamless.z))
    if backwards:
        vertices = vertices[::-1].copy()
    fall = sweep(seamless, shapes, vertices, scratch(seamless), False)
    rehome(seamless, before)
    return fall


def relax_all(seamless: SeamlessMap, shapes: ChartShapes, least_gain: float) -> None:
    """Lower the energy of a map in place, until a step saves less than this share of it: sweeps, then Newton steps."""
    edges = edges_of(seamless.F)
    ends = edges.ends.astype(np.int32)
    for i in range(_SWEEPS):
        sweep_all(seamless, shapes, i % 2 == 0)
    descend_by_newton(
        lambda cg_steps: newton_step(seamless, shapes, edges.of, ends, cg_steps),
        lambda backwards: sweep_all(seamless, shapes, backwards),
        lambda: total_energy(seamless, shapes),
        (least_gain, 1, _MOST_STEPS),
        _CG_RANGE,
    )


def newton_step(
    seamless: SeamlessMap, shapes: ChartShapes, edge: Ints, ends: Ints32, cg_steps: int
) -> tuple[float, float]:
    """Move the map by one Newton step in place; return by how much the energy fell, and the step's length.

    Whole steps have length 1; 0 where no step lowers the energy. `edge` [m, 3] are the edges ab, bc, ca of the
    triangles, and `ends` [e, 2] their vertices.
    """
    system = System.zeros(len(seamless.z), len(ends))
    energy = total_energy(seamless, shapes)
    assemble(seamless, shapes, edge, ends, system)
    _hold(seamless.freedom, ends, system)
    step = conjugate_gradients(ends, system, cg_steps, CG_TOLERANCE)
    slope = float((system.gradient * step).sum())
    if not slope < 0:
        return 0.0, 0.0
    before, way = seamless.z.copy(), step @ (1, 1j)
    bound = min(0.9 * _time_of_first_fold(seamless, way), _LONGEST_STEP / float(np.sqrt(square(way).max())))

    def energy_at(t: float) -> float:
        seamless.z[:] = before + t * way
        return total_energy(seamless, shapes)

    t, lower = line_search(energy, slope, bound, energy_at)
    seamless.z[:] = before + t * way
    rehome(seamless, before)
    return energy - lower, t


def _hold(freedom: Ints, ends: Ints32, system: System) -> None:
    """Take out the directions in which vertices may not move."""
    free = np.stack([freedom & 1, freedom >> 1], axis=1).astype(bool)
    system.gradient[~free] = 0.0
    system.diagonal[~free[:, 0], 0] = system.diagonal[~free[:, 1], 2] = 1.0
    system.diagonal[~free.all(axis=1), 1] = 0.0
    held = np.flatnonzero(~free[ends].all(axis=(1, 2)))
    first, second = free[ends[held]].transpose(1, 0, 2)
    both = (first[:, :, None] & second[:, None, :]).reshape(-1, 4)
    system.blocks[held] = np.where(both, system.blocks[held], 0.0)


@kernel
def _time_of_first_fold(seamless: SeamlessMap, way: Complex) -> float:
    """The first time at which a triangle has no area, if its corners go their ways [n] in a unit of time."""
    first = np.inf
    x, d = np.empty(3, np.complex128), np.empty(3, np.complex128)
    for f in range(len(seamless.F)):
        for k in range(3):
            x[k], d[k] = corner_place(seamless, f, k), turned(way[seamless.F[f, k]], seamless.turn[f, k])
        u, v, p, q = x[1] - x[0], x[2] - x[0], d[1] - d[0], d[2] - d[0]
        c = wedge(u, v)
        b = wedge(u, q) + p.real * v.imag - p.imag * v.real
        a = wedge(p, q)
        # the least positive root of a t^2 + b t + c, with c > 0
        root = b * b - 4 * a * c
        if root < 0 or (a >= 0 and b >= 0):
            continue
        t = 2 * c / (-b + np.sqrt(root))
        if t > 0:
            first = min(first, t)
    return first
