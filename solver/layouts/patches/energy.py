"""The energy of a seamless map, and its relaxation.

A triangle that is stretched, squeezed or sheared costs energy.

Areas of triangles are scaled so that a chart has area 1 on average. The energy is the mean of the
Dirichlet energies of the map and of its inverse, each squared: 1 for an isometry, infinite at a
fold. Not squared it would be brought to its least more easily; a higher power reduces the worst
spots at the cost of others.

Newton steps of all vertices at once are cut short by the first triangle that would fold; sweeps
over single vertices, each inside its star, clear such spots.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Floats, Ints, Ints32, kernel
from ...mesh.topology import edges_of
from ...mesh.vectors import Vector, cross, dot, subtract
from ..energy import (
    FIXED,
    FREE,
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
from .seamless import (
    Complex,
    SeamlessMap,
    corner_place,
    rehome,
    rehome_vertex,
    square,
    turned,
    wedge,
)

CHARTS = Density(power=2, even=0.5, long=0.5, small=0.0)

FOLDED = 1e-15  # the area of a triangle on the charts must exceed this
# Double area of a triangle over its squared length, at least, in its reference.
_MIN_FLATNESS = 0.02

# Area of a reference triangle, at least, in units of the mean area.
_MIN_REFERENCE_AREA = 1e-6

UP = (0.0, 0.0, 1.0)
COLUMNS = (1.0, 0.0, 0.0)
ROWS = (0.0, 1.0, 0.0)

# Way of a vertex in one Newton step, at most [charts].
_MAX_STEP = 0.5

# Sweeps over single vertices before the Newton steps.
_SWEEPS_BEFORE_NEWTON = 2

# Newton steps of a relaxation, at most.
_MAX_NEWTON_STEPS = 30

# Ways of a vertex to the middle of its star that are tried to give each triangle an area, and how
# much shorter each is than the one before.
_MAX_OPENING_TRIALS = 12
_SHORTER_OPENING = 0.5

# Least and most steps of conjugate gradients in a Newton step.
_CG_RANGE = 40, 200


def reference_of(V: Floats, F: Ints, charts: float) -> Reference:
    """Reference for the triangles F [m, 3]: the map is to resemble them.

    Their areas are scaled to add up to the number of charts.
    """
    a, b, c = (V[F[:, k]].T for k in range(3))
    ab = subtract(b, a)
    ac = subtract(c, a)
    bc = subtract(c, b)
    normal = cross(ab, ac)
    tiny = np.finfo(np.float64).tiny
    double = np.sqrt(dot(normal, normal))
    area = np.maximum(double / 2, tiny)
    area = np.maximum(area, _MIN_REFERENCE_AREA * area.mean())
    area *= charts / area.sum()
    squares = np.stack([dot(bc, bc), dot(ac, ac), dot(ab, ab)])
    top = squares.argmax(axis=0)
    every = np.arange(len(F))
    # needles count as a little thicker: the corner opposite to their longest side stands higher
    double = np.maximum(np.maximum(double, _MIN_FLATNESS * squares[top, every]), tiny)
    cotangent = np.stack([dot(ab, ac), -dot(ab, bc), dot(ac, bc)]) / double
    left = cotangent[(top + 1) % 3, every]
    right = cotangent[(top + 2) % 3, every]
    cotangent[top, every] = (1.0 - left * right) / np.maximum(left + right, tiny)
    return Reference(area, (cotangent / (2.0 * area)).T.ravel(), CHARTS)


def total_energy(seamless: SeamlessMap, reference: Reference) -> float:
    """Energy of the whole map; infinite if a triangle is folded."""
    return energy_of(seamless, reference, np.arange(len(seamless.F)))


@kernel
def energy_of(seamless: SeamlessMap, reference: Reference, triangles: Ints) -> float:
    """Energy of some triangles [k]; infinite if one is folded."""
    total = 0.0
    cotangent = reference.cotangent
    for f in triangles:
        a = corner_place(seamless, f, 0)
        b = corner_place(seamless, f, 1)
        c = corner_place(seamless, f, 2)
        area = 0.5 * wedge(b - a, c - a)
        if not area > FOLDED:
            return np.inf
        h = 3 * f
        share = reference.area[f]
        dirichlet = (
            cotangent[h] * square(c - b)
            + cotangent[h + 1] * square(c - a)
            + cotangent[h + 2] * square(b - a)
        )
        total += share * energy_density(dirichlet, share / area, reference.density)
    return total


@kernel
def assemble(
    seamless: SeamlessMap, reference: Reference, edge: Ints, ends: Ints32, system: System
) -> None:
    """Add the triangles to the system, in the vertices' own frames.

    `edge` [m, 3] are their edges, `ends` [e, 2].
    """
    for f in range(len(seamless.F)):
        u = seamless.F[f, 0]
        v = seamless.F[f, 1]
        w = seamless.F[f, 2]
        i = edge[f, 0]
        j = edge[f, 1]
        k = edge[f, 2]
        add_triangle(
            f,
            (u, v, w),
            ((i, ends[i, 0] == u), (j, ends[j, 0] == v), (k, ends[k, 0] == w)),
            (_corner(seamless, f, 0), _corner(seamless, f, 1), _corner(seamless, f, 2)),
            (_along(seamless, f, 0, 1.0), _along(seamless, f, 1, 1.0), _along(seamless, f, 2, 1.0)),
            (_along(seamless, f, 0, 1j), _along(seamless, f, 1, 1j), _along(seamless, f, 2, 1j)),
            reference,
            system,
        )


@kernel
def _corner(seamless: SeamlessMap, f: int, k: int) -> Vector:
    """Corner k of a triangle on the plane z = 1."""
    place = corner_place(seamless, f, k)
    return place.real, place.imag, 1.0


@kernel
def _along(seamless: SeamlessMap, f: int, k: int, way: complex) -> Vector:
    """A direction in the frame of a triangle's corner k, seen by the triangle."""
    there = turned(complex(way), seamless.turn[f, k])
    return there.real, there.imag, 0.0


class Star(NamedTuple):
    """Room for what `expand_star` takes and fills, for up to d triangles round a vertex."""

    first: Floats  # [d, 3]
    second: Floats  # [d, 3]
    shapes: Floats  # [d, 4]
    terms: Floats  # [d, 9]


def scratch(seamless: SeamlessMap) -> Star:
    """Room for the star of any vertex."""
    degree = int(np.diff(seamless.star_start).max())
    return Star(*(np.empty((degree, width)) for width in (3, 3, 4, TERMS)))


@kernel
def gather(seamless: SeamlessMap, reference: Reference, v: int, origin: complex, star: Star) -> int:
    """Expand the star of a vertex about a place in its frame; return how many triangles it has.

    Its corners are seen from that place.
    """
    start = seamless.star_start[v]
    cotangent = reference.cotangent
    degree = seamless.star_start[v + 1] - start
    for i in range(degree):
        f = seamless.star[start + i] // 3
        k = seamless.star[start + i] % 3
        following = (k + 1) % 3
        before = (k + 2) % 3
        back = (4 - seamless.turn[f, k]) % 4
        p = turned(corner_place(seamless, f, following) - seamless.shift[f, k], back) - origin
        q = turned(corner_place(seamless, f, before) - seamless.shift[f, k], back) - origin
        star.first[i, 0] = p.real
        star.first[i, 1] = p.imag
        star.first[i, 2] = 1.0
        star.second[i, 0] = q.real
        star.second[i, 1] = q.imag
        star.second[i, 2] = 1.0
        star.shapes[i, 0] = reference.area[f]
        star.shapes[i, 1] = cotangent[3 * f + k]
        star.shapes[i, 2] = cotangent[3 * f + following]
        star.shapes[i, 3] = cotangent[3 * f + before]
    expand_star(UP, COLUMNS, ROWS, star.first, star.second, star.shapes, degree, star.terms)
    return degree


@kernel
def sweep(
    seamless: SeamlessMap, reference: Reference, vertices: Ints, star: Star, follow_at_once: bool
) -> float:
    """Move some vertices, one after the other; return how far the energy falls.

    Each moves by a Newton step inside its star.

    `star` is room for any. Each vertex is followed into its new chart at once, or left to `rehome`.
    """
    fall = 0.0
    for v in vertices:
        if seamless.freedom[v] != FIXED:
            before = seamless.z[v]
            degree = gather(seamless, reference, v, before, star)
            lower, move = descend(star.terms, degree, reference.density, 0.0, seamless.freedom[v])
            if lower == 0.0 and seamless.freedom[v] == FREE:
                move = _opening(star, degree, reference.density)
            fall += lower
            seamless.z[v] = before + complex(move[0], move[1])
            if follow_at_once:
                rehome_vertex(seamless, v, before)
    return fall


@kernel
def _opening(star: Star, degree: int, density: Density) -> Vector:
    """A move of a star's vertex that gives an area to triangles that round-off left without one.

    It leads some way to the middle of the star. The vertex stays where all triangles have areas, or
    no move is found.
    """
    stay = (0.0, 0.0, 0.0)
    if star_energy(star.terms, degree, density, stay) < np.inf:
        return stay
    x = 0.0
    y = 0.0
    for i in range(degree):
        x += (star.first[i, 0] + star.second[i, 0]) / (2 * degree)
        y += (star.first[i, 1] + star.second[i, 1]) / (2 * degree)
    for _ in range(_MAX_OPENING_TRIALS):
        x *= _SHORTER_OPENING
        y *= _SHORTER_OPENING
        if star_energy(star.terms, degree, density, (x, y, 0.0)) < np.inf:
            return x, y, 0.0
    return stay


def sweep_all(seamless: SeamlessMap, reference: Reference, backwards: bool) -> float:
    """Move every vertex once, and follow it into its chart; return how far the energy falls."""
    before = seamless.z.copy()
    vertices = np.arange(len(seamless.z))[:: -1 if backwards else 1].copy()
    fall = sweep(seamless, reference, vertices, scratch(seamless), False)
    rehome(seamless, before)
    return fall


def relax_all(seamless: SeamlessMap, reference: Reference, least_gain: float) -> None:
    """Lower the energy of a map in place: sweeps first, then Newton steps.

    It ends when a step saves less than the given share of the energy.
    """
    edges = edges_of(seamless.F)
    ends = edges.ends.astype(np.int32)
    for i in range(_SWEEPS_BEFORE_NEWTON):
        sweep_all(seamless, reference, i % 2 == 0)
    descend_by_newton(
        lambda cg_steps: newton_step(seamless, reference, edges.of, ends, cg_steps),
        lambda backwards: sweep_all(seamless, reference, backwards),
        lambda: total_energy(seamless, reference),
        (least_gain, 1, _MAX_NEWTON_STEPS),
        _CG_RANGE,
    )


def newton_step(
    seamless: SeamlessMap, reference: Reference, edge: Ints, ends: Ints32, cg_steps: int
) -> tuple[float, float]:
    """Move the map by one Newton step in place; return the fall of the energy and the step.

    Whole steps have length 1; 0 where no step lowers the energy, or it is infinite. `edge` [m, 3]
    are the edges ab, bc, ca of the triangles, and `ends` [e, 2] their vertices.
    """
    system = System.zeros(len(seamless.z), len(ends))
    energy = total_energy(seamless, reference)
    if not energy < np.inf:
        return 0.0, 0.0
    assemble(seamless, reference, edge, ends, system)
    # the directions in which vertices may not move are taken out
    free = np.stack([seamless.freedom & 1, seamless.freedom >> 1], axis=1).astype(bool)
    system.gradient[~free] = 0.0
    system.diagonal[~free[:, 0], 0] = system.diagonal[~free[:, 1], 2] = 1.0
    system.diagonal[~free.all(axis=1), 1] = 0.0
    held = np.flatnonzero(~free[ends].all(axis=(1, 2)))
    first, second = free[ends[held]].transpose(1, 0, 2)
    both = (first[:, :, None] & second[:, None, :]).reshape(-1, 4)
    system.blocks[held] = np.where(both, system.blocks[held], 0.0)
    step = conjugate_gradients(ends, system, cg_steps, CG_TOLERANCE)
    slope = float((system.gradient * step).sum())
    if not slope < 0:
        return 0.0, 0.0
    before = seamless.z.copy()
    way = step @ (1, 1j)
    bound = min(
        0.9 * _time_of_first_fold(seamless, way), _MAX_STEP / float(np.sqrt(square(way).max()))
    )

    def energy_at(t: float) -> float:
        seamless.z[:] = before + t * way
        return total_energy(seamless, reference)

    t, lower = line_search(energy, slope, bound, energy_at)
    seamless.z[:] = before + t * way
    rehome(seamless, before)
    return energy - lower, t


@kernel
def _time_of_first_fold(seamless: SeamlessMap, way: Complex) -> float:
    """The first time at which a triangle has no area, if its corners move straight on.

    They go their ways [n] in a unit of time.
    """
    first = np.inf
    x = np.empty(3, np.complex128)
    d = np.empty(3, np.complex128)
    for f in range(len(seamless.F)):
        for k in range(3):
            x[k] = corner_place(seamless, f, k)
            d[k] = turned(way[seamless.F[f, k]], seamless.turn[f, k])
        u = x[1] - x[0]
        v = x[2] - x[0]
        p = d[1] - d[0]
        q = d[2] - d[0]
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
