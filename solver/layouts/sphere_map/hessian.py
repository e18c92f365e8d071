"""The energy's Hessian on the vertices and edges of a level, made positive semidefinite triangle by triangle.

Global inexact Newton method: all vertices of a level move at once along a conjugate-gradient direction.

The Hessian is made positive semidefinite (`hessian`), and the step ends short of the first fold.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from ...kernel import Floats, Ints32, kernel
from ..conjugate_gradients import solve
from .energy import (
    Reference,
    Shares,
    Vector,
    combine,
    cross,
    dot,
    projected_hessian,
    row,
    set_row,
    subtract,
    tangent_frame,
    total_energy,
    unit,
)
from .level import Level

# of D and J along the two tangents of a vertex: D_x, D_y, J_x, J_y
Slopes: TypeAlias = tuple[float, float, float, float]
# an end of an edge: its tangents, and its slopes
End: TypeAlias = tuple[Vector, Vector, Slopes]


@kernel
def assemble(
    level: Level,
    S: Floats,
    reference: Reference,
    x: Floats,
    y: Floats,
    gradient: Floats,
    diagonal: Floats,
    blocks: Floats,
) -> float:
    """Fill gradient [n, 2] and Hessian for the tangents x, y [n, 3] of the map S, and return the energy.

    The Hessian has 2 x 2 blocks: `diagonal` [n, 3] with xx, xy, yy, and `blocks` [e, 4] with xx, xy, yx, yy, the rows
    belonging to the edge's first vertex.
    """
    gradient[:] = 0.0
    diagonal[:] = 0.0
    blocks[:] = 0.0
    radial = np.zeros(len(S))
    tail, edge, ends = level.tail, level.edge, level.ends
    total = 0.0
    for f in range(len(tail) // 3):
        h = 3 * f
        area = reference.area[f]
        half = 0.5 / area
        u, v, w = tail[h], tail[h + 1], tail[h + 2]
        cot_a, cot_b, cot_c = reference.cotangent[h], reference.cotangent[h + 1], reference.cotangent[h + 2]
        a, b, c = row(S, u), row(S, v), row(S, w)
        xa, ya, xb, yb, xc, yc = row(x, u), row(y, u), row(x, v), row(y, v), row(x, w), row(y, w)
        ab, ac, bc = subtract(b, a), subtract(c, a), subtract(c, b)
        dirichlet = cot_a * dot(bc, bc) + cot_b * dot(ac, ac) + cot_c * dot(ab, ab)
        jacobian = half * dot(a, cross(ab, ac))
        energy, shares = projected_hessian(area, dirichlet, jacobian)
        total += energy
        grad_a = combine(-2.0 * cot_c, ab, -2.0 * cot_b, ac)
        grad_b = combine(-2.0 * cot_a, bc, 2.0 * cot_c, ab)
        grad_c = combine(2.0 * cot_b, ac, 2.0 * cot_a, bc)
        at_a = _slopes(grad_a, cross(b, c), half, xa, ya)
        at_b = _slopes(grad_b, cross(c, a), half, xb, yb)
        at_c = _slopes(grad_c, cross(a, b), half, xc, yc)
        along_d, along_j = shares[0], shares[1] * jacobian
        radial[u] += along_d * dot(grad_a, a) + along_j
        radial[v] += along_d * dot(grad_b, b) + along_j
        radial[w] += along_d * dot(grad_c, c) + along_j
        _add_vertex(u, at_a, cot_b + cot_c, shares, gradient, diagonal)
        _add_vertex(v, at_b, cot_c + cot_a, shares, gradient, diagonal)
        _add_vertex(w, at_c, cot_a + cot_b, shares, gradient, diagonal)
        i, j, k = edge[h], edge[h + 1], edge[h + 2]
        end_a, end_b, end_c = (xa, ya, at_a), (xb, yb, at_b), (xc, yc, at_c)
        flat, twist = -2.0 * shares[2], shares[3] * half
        _add_edge(blocks, i, ends[i, 0] == u, end_a, end_b, c, (flat * cot_c, twist), shares)
        _add_edge(blocks, j, ends[j, 0] == v, end_b, end_c, a, (flat * cot_a, twist), shares)
        _add_edge(blocks, k, ends[k, 0] == w, end_c, end_a, b, (flat * cot_b, twist), shares)
    for v in range(len(S)):
        # on the sphere a tangent step also falls towards the centre: the Hessian gains minus the radial slope
        shift = max(-radial[v], 0.0) + 1e-8 * (diagonal[v, 0] + diagonal[v, 2])
        diagonal[v, 0] += shift
        diagonal[v, 2] += shift
    return total


@kernel
def _slopes(grad_d: Vector, grad_j: Vector, half: float, x: Vector, y: Vector) -> Slopes:
    """Slopes of D and J along the tangents x and y of a vertex, from their gradients."""
    return dot(grad_d, x), dot(grad_d, y), half * dot(grad_j, x), half * dot(grad_j, y)


@kernel
def _combined(slopes: Slopes, shares: Shares) -> Slopes:
    """What the slopes at another vertex are multiplied with to get the outer products of the gradients."""
    dx, dy, jx, jy = slopes
    dd, dj, jj = shares[4], shares[5], shares[6]
    return dd * dx + dj * jx, dd * dy + dj * jy, dj * dx + jj * jx, dj * dy + jj * jy


@kernel
def _add_vertex(v: int, at_v: Slopes, bend: float, shares: Shares, gradient: Floats, diagonal: Floats) -> None:
    """Add what a triangle says about its vertex v to gradient [n, 2] and diagonal [n, 3]."""
    dx, dy, jx, jy = at_v
    gradient[v, 0] += shares[0] * dx + shares[1] * jx
    gradient[v, 1] += shares[0] * dy + shares[1] * jy
    flat = 2.0 * shares[2] * bend
    px, py, qx, qy = _combined(at_v, shares)
    diagonal[v, 0] += flat + px * dx + qx * jx
    diagonal[v, 1] += px * dy + qx * jy
    diagonal[v, 2] += flat + py * dy + qy * jy


@kernel
def _add_edge(
    blocks: Floats,
    e: int,
    forwards: bool,
    u: End,
    v: End,
    apex: Vector,
    bends: tuple[float, float],
    shares: Shares,
) -> None:
    """Add what the triangle u, v, apex says about its edge e, which `blocks` takes from u to v if `forwards`.

    `bends` are the shares of the second derivatives of D and J along the edge.
    """
    (ux, uy, at_u), (vx, vy, at_v), (flat, twist) = u, v, bends
    bent_x, bent_y = combine(flat, ux, twist, cross(apex, ux)), combine(flat, uy, twist, cross(apex, uy))
    px, py, qx, qy = _combined(at_u, shares)
    dx, dy, jx, jy = at_v
    xy = dot(bent_x, vy) + px * dy + qx * jy
    yx = dot(bent_y, vx) + py * dx + qy * jx
    blocks[e, 0] += dot(bent_x, vx) + px * dx + qx * jx
    blocks[e, 1] += xy if forwards else yx
    blocks[e, 2] += yx if forwards else xy
    blocks[e, 3] += dot(bent_y, vy) + py * dy + qy * jy


LONGEST_STEP = 0.7  # [rad]
FURTHER, SHORTER = 1.6, 0.6  # factors from one trial step to the next
MOST_TRIALS = 14
CG_TOLERANCE = 0.03


def newton_step(level: Level, S: Floats, reference: Reference, cg_steps: int) -> tuple[float, float]:
    """Move S by one Newton step in place, its direction found by up to `cg_steps` steps of conjugate gradients.

    Returns
    -------
    float
        By how much the energy fell; 0 where no step lowers it.
    float
        The step's length, 1 for a whole Newton step.
    """
    gradient, diagonal, blocks = np.empty((len(S), 2)), np.empty((len(S), 3)), np.empty((len(level.ends), 4))
    x, y = tangents(S)
    energy = assemble(level, S, reference, x, y, gradient, diagonal, blocks)
    step = solve(level.ends, diagonal, blocks, gradient, cg_steps, CG_TOLERANCE)
    if not np.sum(gradient * step) < 0.0:
        return 0.0, 0.0
    velocity = step[:, :1] * x + step[:, 1:] * y
    longest = float(np.sqrt(np.max(np.sum(step * step, axis=1))))
    bound = min(0.9 * _time_of_first_fold(level.tail, S, velocity), LONGEST_STEP / longest)
    expected = -0.5 * float(np.sum(gradient * step))
    t, lower = _search(energy, expected, bound, level.tail, S, velocity, reference)
    return energy - lower, t


def _search(
    energy: float, expected: float, bound: float, tail: Ints32, S: Floats, velocity: Floats, reference: Reference
) -> tuple[float, float]:
    """Move S along `velocity`, by less than `bound`, to about the least energy; return the step and that energy.

    A whole step that falls further than `expected` is lengthened, another shortened, for as long as that helps.
    """
    best, trial = np.empty_like(S), np.empty_like(S)
    t = min(1.0, bound)
    lower = _energy_at(t, tail, S, velocity, reference, best)
    factor = FURTHER if energy - lower > t * expected else SHORTER
    for _ in range(MOST_TRIALS):
        if factor * t > bound:
            break
        next_lower = _energy_at(factor * t, tail, S, velocity, reference, trial)
        if lower < energy and not next_lower < lower:
            break
        t, lower, best, trial = factor * t, next_lower, trial, best
    if not lower < energy:
        return 0.0, energy
    S[:] = best
    return t, lower


@kernel
def tangents(S: Floats) -> tuple[Floats, Floats]:
    """Two orthonormal tangents at each of the unit vectors S, each of shape [n, 3]."""
    x, y = np.empty_like(S), np.empty_like(S)
    for v in range(len(S)):
        first, second = tangent_frame(row(S, v))
        set_row(x, v, first)
        set_row(y, v, second)
    return x, y


@kernel
def _energy_at(t: float, tail: Ints32, S: Floats, velocity: Floats, reference: Reference, moved: Floats) -> float:
    """Energy a step t along `velocity`; fills the positions there."""
    for v in range(len(S)):
        set_row(moved, v, unit(combine(1.0, row(S, v), t, row(velocity, v))))
    return total_energy(tail, moved, reference)


@kernel
def _time_of_first_fold(tail: Ints32, S: Floats, velocity: Floats) -> float:
    """Lower bound on the first time t in (0, 1.2] at which det(a + t a', b + t b', c + t c') of a triangle is zero.

    Infinite where no triangle folds by then.
    """
    horizon = 1.2
    first = np.inf
    for f in range(len(tail) // 3):
        i, j, k = tail[3 * f], tail[3 * f + 1], tail[3 * f + 2]
        p, dp = row(S, i), row(velocity, i)
        e, g = subtract(row(S, j), p), subtract(row(S, k), p)
        de, dg = subtract(row(velocity, j), dp), subtract(row(velocity, k), dp)
        n0, n2 = cross(e, g), cross(de, dg)
        n1 = combine(1.0, cross(de, g), 1.0, cross(e, dg))
        c0, c3 = dot(p, n0), dot(dp, n2)
        c1, c2 = dot(dp, n0) + dot(p, n1), dot(dp, n1) + dot(p, n2)
        if abs(c1) * horizon + abs(c2) * horizon**2 + abs(c3) * horizon**3 < 0.9 * c0:
            continue
        low = high = 0.0
        for s in range(1, 25):
            high = horizon * s / 24
            if c0 + high * (c1 + high * (c2 + high * c3)) <= 0.0:
                for _ in range(12):
                    middle = 0.5 * (low + high)
                    if c0 + middle * (c1 + middle * (c2 + middle * c3)) > 0.0:
                        low = middle
                    else:
                        high = middle
                first = min(first, low)
                break
            low = high
    return first
