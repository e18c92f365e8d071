"""Relaxation of one level of a sphere map: sweeps over single vertices first, then Newton steps of all at once.

A sweep moves one vertex after the other by a Newton step in its tangent plane. A step never folds a triangle, since a
fold has infinite energy. Sweeps get out of states where the global Newton method sticks (a long cigar), and remove what
is rough; what is smooth is the work of `newton`.
"""

from __future__ import annotations

import numpy as np

from ...kernel import Floats, Ints32, kernel
from ...mesh.vectors import Vector, combine, cross, dot, row, subtract, unit
from ..energy import FOLDED, FREE, TERMS, Density, Reference, descend, energy_density, expand_star
from ..newton import CG_TOLERANCE, System, add_triangle, conjugate_gradients, descend_by_newton, line_search
from .level import Level, star_shapes

# Down to half their even share small areas are almost free: what limbs leave spares their roots from being stretched
# round. The wall beyond is so steep that 99.9 % of a surface has texels less than twice too wide.
SPHERE = Density(power=4, even=1.0, long=0.53**8, small=0.48**16)

MOST_SWEEPS, TIRED_SWEEP = 5, 0.1  # stop when a sweep lowers the energy by less than this share
MOST_NEWTON_STEPS, TIRED_NEWTON = 20, 5e-3  # stop when two steps in a row do
LARGE, TIRED_LARGE = 8000, 1.5e-2  # vertices of a level that is content with less
CG_RANGE = 10, 60
EXPLODED = 1e5 * 4 * np.pi  # energy of a level that is stuck: start over from the sweeps
MOST_ROUNDS = 4
LONGEST_STEP = 0.7  # of a vertex [rad]
HORIZON = 1.2  # Newton steps beyond which no fold is looked for


def relax_level(level: Level, S: Floats, reference: Reference) -> None:
    """Lower the energy of a level in place."""
    shapes = star_shapes(level.star, reference)
    least_gain = TIRED_NEWTON if len(S) < LARGE else TIRED_LARGE

    def energy() -> float:
        return total_energy(level.tail, S, reference)

    for _ in range(MOST_ROUNDS):
        for i in range(MOST_SWEEPS):
            if sweep(level, S, shapes, reference.density, i % 2 == 0) < TIRED_SWEEP * energy():
                break
        descend_by_newton(
            lambda cg_steps: newton_step(level, S, reference, cg_steps),
            lambda backwards: sweep(level, S, shapes, reference.density, backwards),
            energy,
            (least_gain, 2, MOST_NEWTON_STEPS),
            CG_RANGE,
        )
        if energy() < EXPLODED:
            return


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
        total += area * energy_density(dirichlet, 2.0 * area / triple, reference.density)
    return total


@kernel
def tangent_frame(p: Vector) -> tuple[Vector, Vector]:
    """Two orthonormal tangents x, y of the unit sphere at p, with x, y, p right-handed."""
    x = unit((0.0, p[2], -p[1])) if abs(p[0]) < 0.6 else unit((-p[2], 0.0, p[0]))
    return x, cross(p, x)


def newton_step(level: Level, S: Floats, reference: Reference, cg_steps: int) -> tuple[float, float]:
    """Move S by one Newton step in place, its direction found by up to `cg_steps` steps of conjugate gradients.

    Returns
    -------
    float
        By how much the energy fell; 0 where no step lowers it.
    float
        The step's length, 1 for a whole Newton step.
    """
    system, x, y = System.zeros(len(S), len(level.ends)), np.empty_like(S), np.empty_like(S)
    energy = assemble(level, S, reference, x, y, system)
    step = conjugate_gradients(level.ends, system, cg_steps, CG_TOLERANCE)
    slope = float(np.sum(system.gradient * step))
    if not slope < 0.0:
        return 0.0, 0.0
    velocity = step[:, :1] * x + step[:, 1:] * y
    longest = float(np.sqrt(np.max(np.sum(step * step, axis=1))))
    bound = min(0.9 * _time_of_first_fold(level.tail, S, velocity), LONGEST_STEP / longest)

    def moved(t: float) -> Floats:
        ahead = S + t * velocity
        ahead *= (1.0 / np.sqrt(dot(ahead.T, ahead.T)))[:, None]
        return ahead

    t, lower = line_search(energy, slope, bound, lambda t: total_energy(level.tail, moved(t), reference))
    if t > 0.0:
        S[:] = moved(t)
    return energy - lower, t


@kernel
def assemble(level: Level, S: Floats, reference: Reference, x: Floats, y: Floats, system: System) -> float:
    """Fill in the tangents x, y [n, 3] of the map S, add its triangles to the system, and return its energy."""
    for v in range(len(S)):
        (x[v, 0], x[v, 1], x[v, 2]), (y[v, 0], y[v, 1], y[v, 2]) = tangent_frame(row(S, v))
    radial = np.zeros(len(S))
    tail, edge, ends = level.tail, level.edge, level.ends
    total = 0.0
    for f in range(len(tail) // 3):
        u, v, w = tail[3 * f], tail[3 * f + 1], tail[3 * f + 2]
        i, j, k = edge[3 * f], edge[3 * f + 1], edge[3 * f + 2]
        energy, (at_u, at_v, at_w) = add_triangle(
            f,
            (u, v, w),
            ((i, ends[i, 0] == u), (j, ends[j, 0] == v), (k, ends[k, 0] == w)),
            (row(S, u), row(S, v), row(S, w)),
            (row(x, u), row(x, v), row(x, w)),
            (row(y, u), row(y, v), row(y, w)),
            reference,
            system,
        )
        total += energy
        radial[u] += at_u
        radial[v] += at_v
        radial[w] += at_w
    diagonal = system.diagonal
    for v in range(len(S)):
        # on the sphere a tangent step also falls towards the centre: the Hessian gains minus the radial slope
        shift = max(-radial[v], 0.0) + 1e-8 * (diagonal[v, 0] + diagonal[v, 2])
        diagonal[v, 0] += shift
        diagonal[v, 2] += shift
    return total


@kernel
def _time_of_first_fold(tail: Ints32, S: Floats, velocity: Floats) -> float:
    """Lower bound on the first time t up to the horizon at which det(a + t a', b + t b', c + t c') is 0 for a triangle.

    Infinite where no triangle folds by then.
    """
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
        if abs(c1) * HORIZON + abs(c2) * HORIZON**2 + abs(c3) * HORIZON**3 < 0.9 * c0:
            continue
        low = high = 0.0
        for s in range(1, 25):
            high = HORIZON * s / 24
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


@kernel
def sweep(level: Level, S: Floats, shapes: Floats, density: Density, backwards: bool) -> float:
    """Relax every vertex of a level once, in order or backwards; return by how much the energy fell.

    `shapes` [3 m, 4] comes from `level.star_shapes`.
    """
    count = len(level.star_start) - 1
    largest = 0
    for v in range(count):
        largest = max(largest, level.star_start[v + 1] - level.star_start[v])
    ring, terms = np.empty((largest, 3)), np.empty((largest, TERMS))
    fall = 0.0
    for i in range(count):
        v = count - 1 - i if backwards else i
        first, last = level.star_start[v], level.star_start[v + 1]
        for k in range(last - first):
            ring[k, 0], ring[k, 1], ring[k, 2] = row(S, level.ring[first + k])
        fall += relax_vertex(v, S, ring, shapes[first:last], last - first, density, terms)
    return fall


@kernel
def relax_vertex(
    v: int, S: Floats, ring: Floats, shapes: Floats, degree: int, density: Density, terms: Floats
) -> float:
    """Move v to lower the energy of its star; return by how much it fell.

    `ring` and `shapes` are as in `expand_star`, and `terms` is room for what it fills.
    """
    p = row(S, v)
    x, y = tangent_frame(p)
    expand_star(p, x, y, ring, shapes, degree, terms)
    fall, move = descend(terms, degree, density, FREE, True)
    if fall > 0.0:
        S[v, 0], S[v, 1], S[v, 2] = unit(combine(1.0, combine(move[0], x, move[1], y), 1.0 + move[2], p))
    return fall
