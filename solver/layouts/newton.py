"""Newton's method for maps of triangles: it moves all vertices at once, on the sphere or on charts.

Each vertex moves in the two directions of its surface.

The Hessian of the energy (see `energy`) is made positive semidefinite triangle by triangle, the
step comes from conjugate gradients, and it ends short of the first fold. Far from the minimum a
step is cut short by the steepest of the energy's walls, wherever it stands, and an exact direction
is wasted. So conjugate gradients start with few steps, and get more once whole Newton steps
succeed, and after a step cut short a sweep over single vertices clears the spots that were in the
way.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from ..kernel import Floats, Ints32, kernel
from ..mesh.vectors import Vector, combine, cross, dot, subtract
from .energy import MAX_TRIALS, Reference, Shares, projected_hessian

# Length of a trial step over the one before.
_LONGER_TRIAL = 1.6
_SHORTER_TRIAL = 0.6

# Residual at which conjugate gradients end, over the first one.
CG_TOLERANCE = 0.03

# A Newton step that is cut to less than this asks for fewer steps of conjugate gradients.
_SHORT_STEP = 0.3

# Determinant of a diagonal block, over the product of its diagonal, below which the block counts as
# diagonal: less is round-off.
_MIN_DETERMINANT_SHARE = 1e-14


def descend_by_newton(
    newton_step: Callable[[int], tuple[float, float]],
    sweep: Callable[[bool], float],
    energy: Callable[[], float],
    stop: tuple[float, int, int],
    cg_range: tuple[int, int],
) -> None:
    """Take Newton steps until they gain too little.

    Parameters
    ----------
    newton_step : function
        One step with up to so many steps of conjugate gradients; returns by how much the energy
        fell, and how long the step was: 1 for a whole one.
    sweep : function
        Moves the vertices one by one, backwards or not, and returns by how much the energy fell.
    energy : function
        Energy of the map as it is.
    stop : float, int, int
        Share of the energy that a step must gain, how many in a row may fail to, and the most
        steps.
    cg_range : int, int
        Steps of conjugate gradients, fewest and most.
    """
    least_gain, patience, most_steps = stop
    fewest_cg_steps, most_cg_steps = cg_range
    cg_steps = fewest_cg_steps
    failures = 0
    for i in range(most_steps):
        fall, step = newton_step(cg_steps)
        was_cut_short = step < 1.0
        if was_cut_short:
            fall += sweep(i % 2 == 0)
        failures = failures + 1 if fall < least_gain * energy() else 0
        if failures == patience:
            return
        if not was_cut_short:
            cg_steps = min(2 * cg_steps, most_cg_steps)
        elif step < _SHORT_STEP:
            cg_steps = max(cg_steps // 2, fewest_cg_steps)


def line_search(
    energy: float, slope: float, bound: float, energy_at: Callable[[float], float]
) -> tuple[float, float]:
    """Step of at most `bound` to about the least energy, and that energy; 0 if no step lowers it.

    A whole step that falls further than half of what the slope promises is lengthened, another
    shortened, for as long as that helps.
    """
    t = min(1.0, bound)
    lower = energy_at(t)
    fell_far = energy - lower > -0.5 * t * slope
    factor = _LONGER_TRIAL if fell_far else _SHORTER_TRIAL
    for _ in range(MAX_TRIALS):
        if factor * t > bound:
            break
        trial = energy_at(factor * t)
        if lower < energy and not trial < lower:
            break
        t = factor * t
        lower = trial
    return (t, lower) if lower < energy else (0.0, energy)


class System(NamedTuple):
    """Gradient and Hessian of the energy, in two directions a vertex.

    The rows of an edge's block belong to its first vertex.
    """

    gradient: Floats  # [n, 2]
    diagonal: Floats  # [n, 3]: xx, xy, yy
    blocks: Floats  # [e, 4]: xx, xy, yx, yy

    @classmethod
    def zeros(cls, vertices: int, edges: int) -> System:
        """One to add triangles to."""
        return cls(np.zeros((vertices, 2)), np.zeros((vertices, 3)), np.zeros((edges, 4)))


# Slopes of D and J along the two directions of a vertex: D_x, D_y, J_x, J_y; or the factors of
# these slopes.
Slopes: TypeAlias = tuple[float, float, float, float]

# A corner of a triangle: the two directions of its vertex, its slopes, and the factors of the
# slopes of other corners in the outer products.
Corner: TypeAlias = tuple[Vector, Vector, Slopes, Slopes]


# inlined: handing over so many numbers would take longer than the work
@kernel(inline="always")
def add_triangle(
    f: int,
    vertices: tuple[int, int, int],
    edges: tuple[tuple[int, bool], tuple[int, bool], tuple[int, bool]],
    points: tuple[Vector, Vector, Vector],
    x: tuple[Vector, Vector, Vector],
    y: tuple[Vector, Vector, Vector],
    reference: Reference,
    system: System,
) -> tuple[float, Vector]:
    """Add triangle f to the system; return its energy, and its slopes along the three corners.

    `edges` are the numbers of the sides ab, bc, ca, and whether they run from an edge's first
    vertex to its second; x and y the directions in which the vertices a, b, c, at `points`, may
    move.
    """
    a, b, c = points
    area = reference.area[f]
    h = 3 * f
    half = 0.5 / area
    cot_a = reference.cotangent[h]
    cot_b = reference.cotangent[h + 1]
    cot_c = reference.cotangent[h + 2]
    ab = subtract(b, a)
    ac = subtract(c, a)
    bc = subtract(c, b)
    dirichlet = cot_a * dot(bc, bc) + cot_b * dot(ac, ac) + cot_c * dot(ab, ab)
    jacobian = half * dot(a, cross(ab, ac))
    energy, shares = projected_hessian(area, dirichlet, jacobian, reference.density)
    grad_a = combine(-2.0 * cot_c, ab, -2.0 * cot_b, ac)
    grad_b = combine(-2.0 * cot_a, bc, 2.0 * cot_c, ab)
    grad_c = combine(2.0 * cot_b, ac, 2.0 * cot_a, bc)
    at_a = _add_vertex(
        vertices[0], grad_a, cross(b, c), half, x[0], y[0], cot_b + cot_c, shares, system
    )
    at_b = _add_vertex(
        vertices[1], grad_b, cross(c, a), half, x[1], y[1], cot_c + cot_a, shares, system
    )
    at_c = _add_vertex(
        vertices[2], grad_c, cross(a, b), half, x[2], y[2], cot_a + cot_b, shares, system
    )
    flat = -2.0 * shares[2]
    twist = shares[3] * half
    _add_edge(edges[0], at_a, at_b, c, flat * cot_c, twist, system)
    _add_edge(edges[1], at_b, at_c, a, flat * cot_a, twist, system)
    _add_edge(edges[2], at_c, at_a, b, flat * cot_b, twist, system)
    along_d = shares[0]
    along_j = shares[1] * jacobian
    radial = (
        along_d * dot(grad_a, a) + along_j,
        along_d * dot(grad_b, b) + along_j,
        along_d * dot(grad_c, c) + along_j,
    )
    return energy, radial


@kernel
def _add_vertex(
    v: int,
    grad_d: Vector,
    grad_j: Vector,
    half: float,
    x: Vector,
    y: Vector,
    bend: float,
    shares: Shares,
    system: System,
) -> Corner:
    """Add a triangle's share of the gradient and Hessian at its vertex v.

    The gradients of D and of J / `half` at that vertex are known.
    """
    dx = dot(grad_d, x)
    dy = dot(grad_d, y)
    jx = half * dot(grad_j, x)
    jy = half * dot(grad_j, y)
    dd = shares[4]
    dj = shares[5]
    jj = shares[6]
    px = dd * dx + dj * jx
    py = dd * dy + dj * jy
    qx = dj * dx + jj * jx
    qy = dj * dy + jj * jy
    system.gradient[v, 0] += shares[0] * dx + shares[1] * jx
    system.gradient[v, 1] += shares[0] * dy + shares[1] * jy
    flat = 2.0 * shares[2] * bend
    system.diagonal[v, 0] += flat + px * dx + qx * jx
    system.diagonal[v, 1] += px * dy + qx * jy
    system.diagonal[v, 2] += flat + py * dy + qy * jy
    return x, y, (dx, dy, jx, jy), (px, py, qx, qy)


@kernel
def _add_edge(
    edge: tuple[int, bool],
    u: Corner,
    v: Corner,
    apex: Vector,
    flat: float,
    twist: float,
    system: System,
) -> None:
    """Add what the triangle u, v, apex says about its edge from u to v.

    `flat` and `twist` are the shares of the second derivatives of D and J along it.
    """
    e, forwards = edge
    ux, uy, _, (px, py, qx, qy) = u
    vx, vy, (dx, dy, jx, jy), _ = v
    bent_x = combine(flat, ux, twist, cross(apex, ux))
    bent_y = combine(flat, uy, twist, cross(apex, uy))
    xy = dot(bent_x, vy) + px * dy + qx * jy
    yx = dot(bent_y, vx) + py * dx + qy * jx
    system.blocks[e, 0] += dot(bent_x, vx) + px * dx + qx * jx
    system.blocks[e, 1] += xy if forwards else yx
    system.blocks[e, 2] += yx if forwards else xy
    system.blocks[e, 3] += dot(bent_y, vy) + py * dy + qy * jy


@kernel
def conjugate_gradients(ends: Ints32, system: System, steps: int, tolerance: float) -> Floats:
    """Solve H x = -gradient roughly, preconditioned by the inverse diagonal blocks; x is [n, 2].

    `ends` [e, 2] are the vertices of the edges. Stops after `steps` iterations, or when the
    residual has fallen to `tolerance` of the first one.
    """
    gradient, diagonal, blocks = system
    n = len(gradient)
    x = np.zeros((n, 2))
    inverse = np.empty((n, 3))
    residual = np.empty((n, 2))
    image = np.empty((n, 2))
    direction = np.empty((n, 2))
    norm = 0.0
    for v in range(n):
        a = diagonal[v, 0]
        b = diagonal[v, 1]
        c = diagonal[v, 2]
        det = a * c - b * b
        if not det > _MIN_DETERMINANT_SHARE * a * c:
            b = 0.0
            det = a * c
        inverse[v, 0] = c / det
        inverse[v, 1] = -b / det
        inverse[v, 2] = a / det
        r = -gradient[v, 0]
        s = -gradient[v, 1]
        residual[v, 0] = r
        residual[v, 1] = s
        direction[v, 0] = inverse[v, 0] * r + inverse[v, 1] * s
        direction[v, 1] = inverse[v, 1] * r + inverse[v, 2] * s
        norm += r * direction[v, 0] + s * direction[v, 1]
    first_norm = norm
    for _ in range(steps):
        for v in range(n):
            p = direction[v, 0]
            q = direction[v, 1]
            image[v, 0] = diagonal[v, 0] * p + diagonal[v, 1] * q
            image[v, 1] = diagonal[v, 1] * p + diagonal[v, 2] * q
        for e in range(len(ends)):
            u = ends[e, 0]
            v = ends[e, 1]
            xx = blocks[e, 0]
            xy = blocks[e, 1]
            yx = blocks[e, 2]
            yy = blocks[e, 3]
            p = direction[u, 0]
            q = direction[u, 1]
            r = direction[v, 0]
            s = direction[v, 1]
            image[u, 0] += xx * r + xy * s
            image[u, 1] += yx * r + yy * s
            image[v, 0] += xx * p + yx * q
            image[v, 1] += xy * p + yy * q
        curvature = 0.0
        for v in range(n):
            curvature += direction[v, 0] * image[v, 0] + direction[v, 1] * image[v, 1]
        if not curvature > 0.0:
            break
        alpha = norm / curvature
        previous = norm
        norm = 0.0
        for v in range(n):
            x[v, 0] += alpha * direction[v, 0]
            x[v, 1] += alpha * direction[v, 1]
            residual[v, 0] -= alpha * image[v, 0]
            residual[v, 1] -= alpha * image[v, 1]
            r = residual[v, 0]
            s = residual[v, 1]
            image[v, 0] = inverse[v, 0] * r + inverse[v, 1] * s
            image[v, 1] = inverse[v, 1] * r + inverse[v, 2] * s
            norm += r * image[v, 0] + s * image[v, 1]
        if norm < tolerance * tolerance * first_norm:
            break
        beta = norm / previous
        for v in range(n):
            direction[v, 0] = image[v, 0] + beta * direction[v, 0]
            direction[v, 1] = image[v, 1] + beta * direction[v, 1]
    return x
