"""The progressive sphere map: collapse the mesh, then bring its vertices back on the sphere.

The mesh is collapsed to a tetrahedron, which is put on the sphere. The vertices come back level by
level.

The method is in the family of Praun and Hoppe (2003) and of Hu, Fu and Liu (2017). New here are the
carried area (`level`), and a triple-product barrier with Newton steps on every level (`energy`,
`newton`).

Each vertex comes back inside the kernel of its star, so that no triangle ever folds. Next to the
vertex v with which it was merged, the kernel is the wedge between the great circles through v and
the two neighbours that they share, left and right. The bisector of the wedge always leads into it.

Each level is relaxed: by sweeps over single vertices first, then by Newton steps of all vertices at
once. A sweep moves one vertex after the other by a Newton step in its tangent plane. No step folds
a triangle, since a fold has infinite energy. Sweeps leave states in which the global Newton method
sticks (a long cigar), and remove rough errors; smooth errors are the work of `newton`.
"""

from __future__ import annotations

import functools
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...errors import SphereMapError
from ...kernel import Floats, Ints32, kernel
from ...mesh.topology import triangle_areas
from ...mesh.vectors import Vector, combine, cross, dot, row, subtract, unit
from ..energy import (
    FREE,
    MIN_TRIPLE_PRODUCT,
    TERMS,
    Density,
    Reference,
    descend,
    energy_density,
    expand_star,
    star_energy,
)
from ..newton import (
    CG_TOLERANCE,
    System,
    add_triangle,
    conjugate_gradients,
    descend_by_newton,
    line_search,
)
from .certificate import align, certify
from .decimation import (
    CornerTable,
    corner_table,
    decimate,
    following,
    gather_star,
    preceding,
    undo_collapse,
)
from .level import (
    Level,
    RealSurface,
    build_level,
    carry,
    star_shapes,
    update_level,
    update_load,
    update_triangle,
)

# Energy density of the sphere map. Long edges cost as much as short ones: the operator's error
# comes from long texels, at the roots of limbs, and its time step from narrow ones. With the wall
# `small` 99.9 % of most surfaces have texels less than twice too wide.
SPHERE = Density(power=4, even=1.0, long=1.0, small=0.55**16)

# Sweeps before the Newton steps of a level, at most.
MAX_SWEEPS = 5

# Share of the energy that a sweep must save for another sweep to follow.
MIN_SWEEP_GAIN = 0.1

# Newton steps of a level, at most.
MAX_NEWTON_STEPS = 20

# Relaxation ends when two Newton steps in a row save less than this share of the energy.
MIN_NEWTON_GAIN = 5e-3

# Vertices from which on a level counts as large.
LARGE_LEVEL = 8000

# As `MIN_NEWTON_GAIN`, on a large level.
MIN_NEWTON_GAIN_LARGE = 1.5e-2

# Least and most steps of conjugate gradients in a Newton step.
CG_RANGE = 10, 60

# Energy of a level that is stuck: it starts over from the sweeps.
EXPLODED_ENERGY = 1e5 * 4 * np.pi

# Times that a level starts over, at most.
MAX_ROUNDS = 4

# Way of a vertex in one Newton step, at most [rad].
MAX_VERTEX_STEP = 0.7

# Time up to which folds are searched for, in Newton steps; the steps in which the search proceeds,
# and the halvings of the step that holds the fold.
FOLD_HORIZON = 1.2
FOLD_SEARCH_STEPS = 24
FOLD_HALVINGS = 12

# A triangle whose volume changes by less than this share up to the horizon is not searched.
MAX_SAFE_CHANGE = 0.9

# A Newton step goes no further than this share of the way to the first fold.
MAX_SHARE_OF_FOLD = 0.9

# Share of the Hessian's diagonal that is added to it, so that it is positive.
HESSIAN_SHIFT = 1e-8

# Corners of the tetrahedron with which the map begins: unit vectors.
TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)

# Vertices of the normalised mesh are rounded to multiples of 1 / GRID.
GRID = 2.0**32

# Levels of up to this number of vertices have equal equilateral references.
EQUAL_UNTIL = 12

# Levels of at least this number of vertices have the real shapes as references.
REAL_FROM = 100

# Shape quality (1 is equilateral) below which a reference is pulled towards equilateral, on coarse
# and on fine levels.
COARSE_SLIVER = 0.5
FINE_SLIVER = 0.15

# Vertices of a level over vertices of the level before, below and above CAREFUL_UNTIL vertices.
SLOW_GROWTH = 1.25
FAST_GROWTH = 2.0

# Levels of fewer vertices than this grow slowly.
CAREFUL_UNTIL = 30

# Trust in the real triangles, 0 to 1. A value is tried if the one before gave no certified map.
TRUST_LADDER = (1.0, 0.6, 0.3, 0.0)

# Neighbours of a new vertex with more triangles than this are left to the sweeps.
CROWDED_DEGREE = 64

# Coefficients of a cubic polynomial, the constant first.
Cubic: TypeAlias = tuple[float, float, float, float]


def relax_level(level: Level, S: Floats, reference: Reference) -> None:
    """Lower the energy of a level in place."""
    shapes = star_shapes(level.star, reference)
    least_gain = MIN_NEWTON_GAIN if len(S) < LARGE_LEVEL else MIN_NEWTON_GAIN_LARGE
    energy = functools.partial(total_energy, level.tail, S, reference)
    for _ in range(MAX_ROUNDS):
        for i in range(MAX_SWEEPS):
            fall = sweep(level, S, shapes, reference.density, i % 2 == 0)
            if fall < MIN_SWEEP_GAIN * energy():
                break
        descend_by_newton(
            lambda cg_steps: newton_step(level, S, reference, cg_steps),
            lambda backwards: sweep(level, S, shapes, reference.density, backwards),
            energy,
            (least_gain, 2, MAX_NEWTON_STEPS),
            CG_RANGE,
        )
        if energy() < EXPLODED_ENERGY:
            return


@kernel
def total_energy(tail: Ints32, S: Floats, reference: Reference) -> float:
    """Energy of the whole map S; infinite if a triangle is folded."""
    total = 0.0
    cotangent = reference.cotangent
    for f in range(len(tail) // 3):
        h = 3 * f
        area = reference.area[f]
        a = row(S, tail[h])
        b = row(S, tail[h + 1])
        c = row(S, tail[h + 2])
        ab = subtract(b, a)
        ac = subtract(c, a)
        bc = subtract(c, b)
        triple = dot(a, cross(ab, ac))
        if not triple > MIN_TRIPLE_PRODUCT:
            return np.inf
        dirichlet = (
            cotangent[h] * dot(bc, bc)
            + cotangent[h + 1] * dot(ac, ac)
            + cotangent[h + 2] * dot(ab, ab)
        )
        total += area * energy_density(dirichlet, 2.0 * area / triple, reference.density)
    return total


@kernel
def tangent_frame(p: Vector) -> tuple[Vector, Vector]:
    """Two orthonormal tangents x, y of the unit sphere at p, with x, y, p right-handed."""
    x = unit((0.0, p[2], -p[1])) if abs(p[0]) < 0.6 else unit((-p[2], 0.0, p[0]))
    return x, cross(p, x)


def newton_step(
    level: Level, S: Floats, reference: Reference, cg_steps: int
) -> tuple[float, float]:
    """Move the map S [n, 3] by one Newton step in place.

    Returns the fall of the energy and the length of the step.

    Up to `cg_steps` steps of conjugate gradients find the direction. The step is 1 for a whole one,
    and 0 where no step lowers the energy.
    """
    system = System.zeros(len(S), len(level.ends))
    x = np.empty_like(S)
    y = np.empty_like(S)
    energy = assemble(level, S, reference, x, y, system)
    step = conjugate_gradients(level.ends, system, cg_steps, CG_TOLERANCE)
    slope = float(np.sum(system.gradient * step))
    if not slope < 0.0:
        return 0.0, 0.0
    velocity = step[:, :1] * x + step[:, 1:] * y
    longest = float(np.sqrt(np.max(np.sum(step * step, axis=1))))
    to_fold = MAX_SHARE_OF_FOLD * _time_of_first_fold(level.tail, S, velocity)
    to_longest = MAX_VERTEX_STEP / longest

    def moved(t: float) -> Floats:
        ahead = S + t * velocity
        ahead *= (1.0 / np.sqrt(dot(ahead.T, ahead.T)))[:, None]
        return ahead

    def energy_at(t: float) -> float:
        return total_energy(level.tail, moved(t), reference)

    t, lower = line_search(energy, slope, min(to_fold, to_longest), energy_at)
    if t > 0.0:
        S[:] = moved(t)
    return energy - lower, t


@kernel
def assemble(
    level: Level, S: Floats, reference: Reference, x: Floats, y: Floats, system: System
) -> float:
    """Add the triangles of the map S to the Newton system; return the energy of the map.

    The tangents x and y [n, 3] of the vertices are filled in.
    """
    for v in range(len(S)):
        (x[v, 0], x[v, 1], x[v, 2]), (y[v, 0], y[v, 1], y[v, 2]) = tangent_frame(row(S, v))
    radial = np.zeros(len(S))
    tail = level.tail
    edge = level.edge
    ends = level.ends
    total = 0.0
    for f in range(len(tail) // 3):
        a = tail[3 * f]
        b = tail[3 * f + 1]
        c = tail[3 * f + 2]
        ab = edge[3 * f]
        bc = edge[3 * f + 1]
        ca = edge[3 * f + 2]
        energy, (at_a, at_b, at_c) = add_triangle(
            f,
            (a, b, c),
            ((ab, ends[ab, 0] == a), (bc, ends[bc, 0] == b), (ca, ends[ca, 0] == c)),
            (row(S, a), row(S, b), row(S, c)),
            (row(x, a), row(x, b), row(x, c)),
            (row(y, a), row(y, b), row(y, c)),
            reference,
            system,
        )
        total += energy
        radial[a] += at_a
        radial[b] += at_b
        radial[c] += at_c
    diagonal = system.diagonal
    for v in range(len(S)):
        # on the sphere a tangent step also falls towards the centre: the Hessian gains minus the
        # radial slope
        shift = max(-radial[v], 0.0) + HESSIAN_SHIFT * (diagonal[v, 0] + diagonal[v, 2])
        diagonal[v, 0] += shift
        diagonal[v, 2] += shift
    return total


@kernel
def _time_of_first_fold(tail: Ints32, S: Floats, velocity: Floats) -> float:
    """Lower bound on the first time at which a triangle folds.

    The vertices move at constant velocities [n, 3]. The triangle a, b, c folds when the determinant
    det(a + t a', b + t b', c + t c') is 0: a cubic polynomial of the time. Infinite where no
    triangle folds up to the horizon.
    """
    first_time = np.inf
    for f in range(len(tail) // 3):
        a = row(S, tail[3 * f])
        a_rate = row(velocity, tail[3 * f])
        ab = subtract(row(S, tail[3 * f + 1]), a)
        ac = subtract(row(S, tail[3 * f + 2]), a)
        ab_rate = subtract(row(velocity, tail[3 * f + 1]), a_rate)
        ac_rate = subtract(row(velocity, tail[3 * f + 2]), a_rate)
        # ab x ac as a quadratic polynomial of the time
        normal_0 = cross(ab, ac)
        normal_1 = combine(1.0, cross(ab_rate, ac), 1.0, cross(ab, ac_rate))
        normal_2 = cross(ab_rate, ac_rate)
        c0 = dot(a, normal_0)
        c1 = dot(a_rate, normal_0) + dot(a, normal_1)
        c2 = dot(a_rate, normal_1) + dot(a, normal_2)
        c3 = dot(a_rate, normal_2)
        max_change = abs(c1) * FOLD_HORIZON + abs(c2) * FOLD_HORIZON**2 + abs(c3) * FOLD_HORIZON**3
        if max_change < MAX_SAFE_CHANGE * c0:
            continue
        first_time = min(first_time, _first_root((c0, c1, c2, c3)))
    return first_time


@kernel
def _first_root(cubic: Cubic) -> float:
    """Lower bound on the first time at which a cubic polynomial is not positive any more.

    Infinite where it is positive at all times that are tried, up to the horizon.
    """
    low = 0.0
    for step in range(1, FOLD_SEARCH_STEPS + 1):
        high = FOLD_HORIZON * step / FOLD_SEARCH_STEPS
        if _value_at(cubic, high) <= 0.0:
            for _ in range(FOLD_HALVINGS):
                middle = 0.5 * (low + high)
                if _value_at(cubic, middle) > 0.0:
                    low = middle
                else:
                    high = middle
            return low
        low = high
    return np.inf


@kernel
def _value_at(cubic: Cubic, t: float) -> float:
    """Value of a cubic polynomial."""
    c0, c1, c2, c3 = cubic
    return c0 + t * (c1 + t * (c2 + t * c3))


@kernel
def sweep(level: Level, S: Floats, shapes: Floats, density: Density, backwards: bool) -> float:
    """Relax every vertex of a level once, in order or backwards; return how far the energy falls.

    `shapes` [3 m, 4] comes from `level.star_shapes`.
    """
    count = len(level.star_start) - 1
    largest = 0
    for v in range(count):
        largest = max(largest, level.star_start[v + 1] - level.star_start[v])
    ring = np.empty((largest + 1, 3))
    terms = np.empty((largest, TERMS))
    fall = 0.0
    for i in range(count):
        v = count - 1 - i if backwards else i
        first = level.star_start[v]
        last = level.star_start[v + 1]
        for k in range(last - first):
            ring[k, 0], ring[k, 1], ring[k, 2] = row(S, level.ring[first + k])
        ring[last - first, 0], ring[last - first, 1], ring[last - first, 2] = row(ring, 0)
        fall += relax_vertex(v, S, ring, shapes[first:last], last - first, density, terms)
    return fall


@kernel
def relax_vertex(
    v: int, S: Floats, ring: Floats, shapes: Floats, degree: int, density: Density, terms: Floats
) -> float:
    """Move v to lower the energy of its star; return by how much it fell.

    `ring` [degree + 1, 3] are its neighbours, counterclockwise, and the first again, `shapes` as in
    `expand_star`, and `terms` is room for what it fills.
    """
    p = row(S, v)
    x, y = tangent_frame(p)
    expand_star(p, x, y, ring, ring[1:], shapes, degree, terms)
    fall, move = descend(terms, degree, density, 1.0, FREE)
    if fall > 0.0:
        S[v, 0], S[v, 1], S[v, 2] = unit(
            combine(1.0, combine(move[0], x, move[1], y), 1.0 + move[2], p)
        )
    return fall


def progressive_sphere_map(V: Floats, F: NDArray[np.integer]) -> Floats:
    """Map a closed triangle mesh of genus 0 one-to-one and evenly onto the unit sphere.

    Parameters
    ----------
    V
        Vertices, shape [n, 3].
    F
        Triangles, counterclockwise seen from outside, shape [m, 3].

    Returns
    -------
    NDArray[np.float64]
        A unit vector for each vertex, shape [n, 3]. No triangle is folded (see `certify`).

    Raises
    ------
    SphereMapError
        No such map was found.
    """
    V = _normalised(V, F)
    order = _morton_order(V)
    number = np.empty(len(V), dtype=np.int64)
    number[order] = np.arange(len(V))
    triangles = number[F]
    triangles = triangles[np.argsort(triangles.min(axis=1), kind="stable")]
    for trust in TRUST_LADDER:
        S = _map_by_levels(V[order], triangles, trust)[number]
        certificate = certify(F, S)
        if certificate.valid:
            turned = align(V, F, S)
            # round-off can fold the tiniest triangles
            return turned if certify(F, turned).valid else S
    raise SphereMapError(
        f"no fold-free sphere map was found: {certificate.flipped} of {len(F)} triangles are "
        f"folded, the solid angle is {certificate.solid_angle:.6g} instead of 4 pi; simplify or "
        f"remesh the mesh, and remove its slivers"
    )


def _normalised(V: Floats, F: NDArray[np.integer]) -> Floats:
    """Vertices centred, scaled to an area of 4 pi, and rounded.

    So place and size of the mesh do not change the map. Without rounding the last bits would decide
    between the many equivalent ways out of a symmetric coarse level.
    """
    V = V - np.mean(V, axis=0, dtype=np.float64)
    return np.rint(V * np.sqrt(4 * np.pi / np.sum(triangle_areas(V, F))) * GRID) / GRID


def _morton_order(V: Floats) -> NDArray[np.int64]:
    """Order of the vertices along a Morton curve: neighbours in space are close in memory."""
    size = max(float(np.ptp(V, axis=0).max()), 1e-300)
    cells = ((V - V.min(axis=0)) / size * 1023.999).astype(np.int64)
    code = np.zeros(len(V), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _map_by_levels(V: Floats, F: NDArray[np.integer], trust: float) -> Floats:
    """Sphere map by levels of detail; `trust` in the real triangles is 0 to 1."""
    n = len(V)
    # every vertex gets some room, even if its triangles have no area
    carried = np.full(n, 1e-3 * 4 * np.pi / n)
    carried += np.bincount(F.ravel(), np.repeat(triangle_areas(V, F) / 3, 3), n)
    table = corner_table(F, n)
    log = decimate(table, V)
    removed = table.tail[log]
    merged_with = table.tail[table.twin[log]]
    carry(removed, merged_with, carried)
    # the number of vertices of the first level that shows each vertex or triangle
    vertex_since = np.full(n, 4)
    triangle_since = np.full(len(F), 4)
    arrival = n - np.arange(len(log))
    vertex_since[removed] = arrival
    triangle_since[log // 3] = arrival
    triangle_since[table.twin[log] // 3] = arrival
    vertices = np.flatnonzero(vertex_since == 4)
    triangles = np.flatnonzero(triangle_since == 4)

    S = np.zeros((n, 3))
    # the four last vertices, in the order in which no triangle is inside out
    h = table.leaving[vertices[0]]
    S[table.tail[[h, following(h), preceding(h), preceding(table.twin[h])]]] = TETRAHEDRON
    reference = Reference(np.zeros(len(F)), np.zeros(3 * len(F)), SPHERE)
    load = np.ones(n)
    for size in _level_sizes(n):
        realism = np.log(size / EQUAL_UNTIL) / np.log(REAL_FROM / EQUAL_UNTIL)
        shape_trust = trust * min(max(realism, 0.0), 1.0)
        sliver = COARSE_SLIVER if size < n / 4 else FINE_SLIVER
        surface = RealSurface(V, carried, load, shape_trust, sliver, 4 * np.pi / (2 * size - 4))
        update_level(vertices, triangles, table, surface, reference)
        insert_vertices(log[n - size : n - len(vertices)], table, surface, S, reference)
        vertices = np.flatnonzero(vertex_since <= size)
        triangles = np.flatnonzero(triangle_since <= size)
        update_level(vertices, triangles, table, surface, reference)
        level_S = S[vertices]
        level_cotangent = reference.cotangent.reshape(-1, 3)[triangles].ravel()
        level_reference = Reference(reference.area[triangles], level_cotangent, SPHERE)
        relax_level(build_level(table, vertices, triangles), level_S, level_reference)
        S[vertices] = level_S
    return S


def _level_sizes(n: int) -> list[int]:
    """Vertex counts of the levels, from just above four to n."""
    sizes = []
    size = 4.0
    while size < n:
        size = size * (SLOW_GROWTH if size < CAREFUL_UNTIL else FAST_GROWTH) + 1
        sizes.append(min(int(size), n))
    if len(sizes) > 1 and sizes[-2] > 0.75 * n:
        del sizes[-2]
    return sizes


@kernel
def _gather(
    neighbours: Ints32,
    degree: int,
    tail: Ints32,
    S: Floats,
    reference: Reference,
    ring: Floats,
    shapes: Floats,
) -> None:
    """Fill in `ring` and `shapes` of `relax_vertex`, from the half-edges to the neighbours."""
    cotangent = reference.cotangent
    for i in range(degree):
        h = neighbours[i]
        ring[i, 0], ring[i, 1], ring[i, 2] = row(S, tail[following(h)])
        shapes[i, 0] = reference.area[h // 3]
        shapes[i, 1] = cotangent[h]
        shapes[i, 2] = cotangent[following(h)]
        shapes[i, 3] = cotangent[preceding(h)]
    ring[degree, 0], ring[degree, 1], ring[degree, 2] = row(ring, 0)


@kernel
def _place(
    v: int,
    left: int,
    right: int,
    S: Floats,
    ring: Floats,
    shapes: Floats,
    degree: int,
    density: Density,
    terms: Floats,
) -> Vector:
    """The trial point at which the energy of a new vertex's star is least.

    Trial points lie on two ways from v: to the middle of the star, and into the wedge between the
    great circles through v and the neighbours left and right. The second way is tried if all points
    of the first one fold a triangle. `ring`, `shapes` and `terms` are as in `relax_vertex`.
    """
    start = row(S, v)
    x, y = tangent_frame(start)
    expand_star(start, x, y, ring, ring[1:], shapes, degree, terms)
    middle = (0.0, 0.0, 0.0)
    for i in range(degree):
        middle = combine(1.0, middle, 1.0, row(ring, i))
    inward = combine(1.0, unit(cross(start, row(S, left))), 1.0, unit(cross(row(S, right), start)))
    lowest_energy = np.inf
    best = start
    # the end of each way, the length of a trial over the one before, and the number of trials
    for goal, share, trials in (
        (unit(middle), 0.65, 16),
        (unit(combine(1.0, start, 1.0, unit(inward))), 0.4, 40),
    ):
        t = 1.0
        for _ in range(trials):
            p = unit(combine(1.0 - t, start, t, goal))
            move = subtract(p, start)
            energy = star_energy(
                terms, degree, density, (dot(move, x), dot(move, y), dot(move, start))
            )
            if energy < lowest_energy:
                lowest_energy = energy
                best = p
            elif lowest_energy < np.inf:
                break
            t *= share
        if lowest_energy < np.inf:
            break
    return best


@kernel
def insert_vertices(
    log: Ints32, table: CornerTable, surface: RealSurface, S: Floats, reference: Reference
) -> None:
    """Undo the collapses in `log`, latest first, and relax round every new vertex.

    A vertex that finds no place leaves a fold behind, which the certificate will find.
    """
    tail = table.tail
    density = reference.density
    neighbours = np.empty(len(S), np.int32)
    others = np.empty(len(S), np.int32)
    ring = np.empty((len(S) + 1, 3))
    shapes = np.empty((len(S), 4))
    terms = np.empty((len(S), TERMS))
    other_ring = np.empty((CROWDED_DEGREE + 1, 3))
    other_shapes = np.empty((CROWDED_DEGREE, 4))
    for h in log[::-1]:
        u = tail[h]
        v = tail[table.twin[h]]
        undo_collapse(table, h)
        surface.carried[v] -= surface.carried[u]
        for w in (v, u):
            update_load(w, neighbours, gather_star(table, w, neighbours), tail, surface)
        for w in (v, u):
            degree = gather_star(table, w, neighbours)
            for i in range(degree):
                update_triangle(neighbours[i] // 3, tail, surface, reference)
        _gather(neighbours, degree, tail, S, reference, ring, shapes)
        left = tail[preceding(h)]
        right = tail[preceding(table.twin[h])]
        S[u, 0], S[u, 1], S[u, 2] = _place(v, left, right, S, ring, shapes, degree, density, terms)
        relax_vertex(u, S, ring, shapes, degree, density, terms)
        for i in range(degree):
            w = tail[following(neighbours[i])]
            other_degree = gather_star(table, w, others)
            if other_degree <= CROWDED_DEGREE:
                _gather(others, other_degree, tail, S, reference, other_ring, other_shapes)
                relax_vertex(w, S, other_ring, other_shapes, other_degree, density, terms)
            ring[i, 0], ring[i, 1], ring[i, 2] = row(S, w)
