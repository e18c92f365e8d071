"""Gauss-Seidel relaxation: one vertex at a time takes a Newton step in its tangent plane that lowers the energy.

A step never folds a triangle, since a fold has infinite energy. Sweeps get out of states where the global Newton method
sticks (a long cigar), and remove what is rough; what is smooth is the work of `newton`.

The star of one vertex as a function of that vertex's position.

Let the vertex move from p to p + dx x + dy y + dz p with tangents x, y. Of each triangle of its star, J is linear in
the move and D quadratic: a few numbers a triangle say all, and a trial position costs next to nothing.

Undoing collapses: each vertex comes back inside the kernel of its star, so that no triangle ever folds.

Next to the vertex v it was merged with, the kernel is the wedge between the great circles through v and the two
neighbours they share, left and right. The bisector of that wedge always leads into it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Floats, Ints32, kernel
from .decimation import CornerTable, following, gather_star, preceding, undo_collapse
from .energy import (
    FOLDED,
    Reference,
    Vector,
    combine,
    cross,
    density,
    density_derivatives,
    dot,
    row,
    set_row,
    subtract,
    tangent_frame,
    unit,
)
from .level import Level, Source, set_shape, update_load, update_triangle

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


REACH = 0.3  # longest step [rad]
ARMIJO = 1e-4


@kernel
def _descent_direction(gx: float, gy: float, hxx: float, hxy: float, hyy: float) -> tuple[float, float]:
    """Newton step -|H|^-1 g of a 2 x 2 Hessian, its eigenvalues taken by their absolute value."""
    mean, half = 0.5 * (hxx + hyy), 0.5 * (hxx - hyy)
    determinant = hxx * hyy - hxy * hxy
    if mean > 0.0 and determinant > 1e-3 * mean * mean:
        return (hxy * gy - hyy * gx) / determinant, (hxy * gx - hxx * gy) / determinant
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
def relax_vertex(v: int, S: Floats, ring: Floats, shapes: Floats, degree: int, terms: Floats) -> float:
    """Move v to lower the energy of its star; return by how much it fell.

    `ring` and `shapes` are as in `star.expand`, and `terms` is room for what it fills.
    """
    p = row(S, v)
    x, y = tangent_frame(p)
    expand(p, x, y, ring, shapes, degree, terms)
    energy, gx, gy, hxx, hxy, hyy = slopes(terms, degree)
    if not energy < np.inf:
        return 0.0
    sx, sy = _descent_direction(gx, gy, hxx, hxy, hyy)
    descent = -(gx * sx + gy * sy)
    if not descent > 1e-13 * energy:
        return 0.0
    step = min(1.0, REACH / np.sqrt(sx * sx + sy * sy))
    for _ in range(14):
        move = tangent_move(step * sx, step * sy)
        lower = energy_after(move, terms, degree)
        if lower < energy - ARMIJO * step * descent:
            further = 2.0 * lower < energy  # high up a wall a Newton step is far too short
            while further:
                step *= 2.0
                ahead = tangent_move(step * sx, step * sy)
                least = energy_after(ahead, terms, degree)
                further = 2.0 * least < lower
                if least < lower:
                    move, lower = ahead, least
            set_row(S, v, unit(combine(1.0, combine(move[0], x, move[1], y), 1.0 + move[2], p)))
            return energy - lower
        step *= 0.35
    return 0.0


@kernel
def sweep(level: Level, S: Floats, shapes: Floats, backwards: bool) -> float:
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
            set_row(ring, k, row(S, level.ring[first + k]))
        fall += relax_vertex(v, S, ring, shapes[first:last], last - first, terms)
    return fall


CROWDED = 64  # neighbours of a new vertex with more triangles than this wait for the sweeps


class _Star(NamedTuple):
    """Scratch for the star of one vertex, of room for so many neighbours; see `star.expand`."""

    ring: Floats  # [room, 3]
    shapes: Floats  # [room, 4]
    terms: Floats  # [room, 9]


@kernel
def _gather(neighbours: Ints32, degree: int, tail: Ints32, S: Floats, reference: Reference, star: _Star) -> None:
    """Fill in what `star.expand` asks for, from the half-edges to the neighbours."""
    for i in range(degree):
        set_row(star.ring, i, row(S, tail[following(neighbours[i])]))
        set_shape(star.shapes, i, neighbours[i], reference)


@kernel
def _place(u: int, v: int, left: int, right: int, S: Floats, star: _Star, degree: int) -> None:
    """Put u where its star's energy is least among trial points on the ways from v."""
    ring, shapes, terms = star
    start = row(S, v)
    x, y = tangent_frame(start)
    expand(start, x, y, ring, shapes, degree, terms)
    middle = (0.0, 0.0, 0.0)
    for i in range(degree):
        middle = combine(1.0, middle, 1.0, row(ring, i))
    inward = combine(1.0, unit(cross(start, row(S, left))), 1.0, unit(cross(row(S, right), start)))
    least = np.inf
    best = start
    for goal, share, trials in ((unit(middle), 0.65, 16), (unit(combine(1.0, start, 1.0, unit(inward))), 0.4, 40)):
        t = 1.0
        for _ in range(trials):
            p = unit(combine(1.0 - t, start, t, goal))
            move = subtract(p, start)
            energy = energy_after((dot(move, x), dot(move, y), dot(move, start)), terms, degree)
            if energy < least:
                least = energy
                best = p
            elif least < np.inf:
                break
            t *= share
        if least < np.inf:
            break
    set_row(S, u, best)


@kernel
def insert_vertices(log: Ints32, table: CornerTable, source: Source, S: Floats, reference: Reference) -> None:
    """Undo the collapses in `log`, latest first, and relax round every new vertex.

    A vertex that finds no place leaves a fold behind, which the certificate will find.
    """
    tail = table.tail
    neighbours, others = np.empty(len(S), np.int32), np.empty(len(S), np.int32)
    star = _Star(np.empty((len(S), 3)), np.empty((len(S), 4)), np.empty((len(S), TERMS)))
    other_star = _Star(np.empty((CROWDED, 3)), np.empty((CROWDED, 4)), star.terms)
    for h in log[::-1]:
        u, v = tail[h], tail[table.twin[h]]
        undo_collapse(table, h)
        source.carried[v] -= source.carried[u]
        for w in (v, u):
            update_load(w, neighbours, gather_star(table, w, neighbours), tail, source)
        for w in (v, u):
            degree = gather_star(table, w, neighbours)
            for i in range(degree):
                update_triangle(neighbours[i] // 3, tail, source, reference)
        _gather(neighbours, degree, tail, S, reference, star)
        _place(u, v, tail[preceding(h)], tail[preceding(table.twin[h])], S, star, degree)
        relax_vertex(u, S, star.ring, star.shapes, degree, star.terms)
        for i in range(degree):
            w = tail[following(neighbours[i])]
            other_degree = gather_star(table, w, others)
            if other_degree <= CROWDED:
                _gather(others, other_degree, tail, S, reference, other_star)
                relax_vertex(w, S, other_star.ring, other_star.shapes, other_degree, other_star.terms)
            set_row(star.ring, i, row(S, w))
