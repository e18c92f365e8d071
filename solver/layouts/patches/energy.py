"""The energy of a seamless map, and its relaxation.

A triangle that is stretched, squeezed or sheared costs energy. Areas of triangles are scaled so
that a chart has area 1 on average. The energy density is

    W = (D / 2)^2 (1 + J^-2) / 2

with D and J of `layouts.energy`: the mean of the squared Dirichlet energies of the map and of its
inverse. It is 1 for an isometry and infinite at a fold. Without the square, the minimum would be
easier to reach. A higher power would reduce the worst spots at the cost of others.

Newton steps move all vertices at once, and end short of the first triangle that would fold. Sweeps
over single vertices, each of which stays inside its star, clear the spots that cut a step short.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Floats, Ints, Ints32, kernel
from ...mesh.topology import edges_of
from ...mesh.vectors import Vector, cross, dot, subtract
from ..energy import (
    COLUMN,
    FIXED,
    FREE,
    ROW,
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
    place_seen_from,
    rehome,
    rehome_vertex,
    square,
    turned,
    wedge,
)

# See the formula at the top of this module.
_CHART_DENSITY = Density(power=2, even=0.5, long=0.5, small=0.0)

# A triangle whose area on the charts is not greater than this is folded [charts].
_MIN_AREA = 1e-15

# A reference triangle that is a needle counts as thicker: it gets at least this double area over
# the square of its longest side.
_MIN_FLATNESS = 0.02

# Area of a reference triangle, at least, in units of the mean area.
_MIN_REFERENCE_AREA = 1e-6

# Charts are the plane z = 1 of `layouts.energy`: the place of a star's vertex, and the directions
# in which it moves.
_ORIGIN = (0.0, 0.0, 1.0)
_COLUMN_DIRECTION = (1.0, 0.0, 0.0)
_ROW_DIRECTION = (0.0, 1.0, 0.0)

# Way of a vertex in one Newton step, at most [charts].
_MAX_STEP = 0.5

# A Newton step goes no further than this share of the way to the first fold.
_MAX_SHARE_OF_FOLD = 0.9

# Sweeps over single vertices before the Newton steps.
_SWEEPS_BEFORE_NEWTON = 2

# Energy of a triangle over its reference area above which it is strained: 1 is an isometry. Where
# cones and holes stand close together no map is better, so it counts as no more for the progress.
_STRAINED = 100.0

# Spots that are strained most are eased together with those of more than this share of their
# energy over area.
_EASED_TOGETHER = 1e-3

# Rounds that ease spots, at most, the sweeps of each, and the share of the spots' energy that each
# round must save.
_MAX_EASING_ROUNDS = 25
_SWEEPS_OF_EASING = 4
_MIN_EASING = 0.2

# Newton steps of a relaxation, at most.
_MAX_NEWTON_STEPS = 30

# Moves towards the middle of a star that are tried to give each of its triangles an area, and the
# length of each over the one before.
_MAX_OPENING_TRIALS = 12
_SHORTER_OPENING = 0.5

# Least and most steps of conjugate gradients in a Newton step.
_CG_RANGE = 40, 200

# Keeps quotients by areas and by cotangents finite.
_TINY = np.finfo(np.float64).tiny


def reference_of(V: Floats, F: Ints, charts: float) -> Reference:
    """Reference that a map of the triangles F [m, 3] is to resemble: the mesh with vertices V [m].

    The areas are scaled to add up to the number of charts.
    """
    a, b, c = (V[F[:, k]].T for k in range(3))
    ab = subtract(b, a)
    ac = subtract(c, a)
    bc = subtract(c, b)
    normal = cross(ab, ac)
    double_area = np.sqrt(dot(normal, normal))
    area = np.maximum(double_area / 2, _TINY)
    area = np.maximum(area, _MIN_REFERENCE_AREA * area.mean())
    area *= charts / area.sum()
    # row k belongs to corner k: the product of the sides that meet there, and the side opposite
    products = np.stack([dot(ab, ac), -dot(ab, bc), dot(ac, bc)])
    squared_opposite_sides = np.stack([dot(bc, bc), dot(ac, ac), dot(ab, ab)])
    cotangent = _cotangents(double_area, products, squared_opposite_sides)
    return Reference(area, (cotangent / (2.0 * area)).T.ravel(), _CHART_DENSITY)


def _cotangents(double_area: Floats, products: Floats, squared_opposite_sides: Floats) -> Floats:
    """Cotangents [3, m] of the angles of triangles; needles count as a little thicker.

    The scalar products of the sides at each corner [3, m], and the double areas [m], are given.
    """
    triangles = np.arange(len(double_area))
    top = squared_opposite_sides.argmax(axis=0)  # the corner with the widest angle
    longest_squared = squared_opposite_sides[top, triangles]
    thick_area = np.maximum(double_area, _MIN_FLATNESS * longest_squared)
    cotangent = products / np.maximum(thick_area, _TINY)
    # the top of a needle stands higher then; cot a cot b + cot b cot c + cot c cot a = 1
    second = cotangent[(top + 1) % 3, triangles]
    third = cotangent[(top + 2) % 3, triangles]
    cotangent[top, triangles] = (1.0 - second * third) / np.maximum(second + third, _TINY)
    return cotangent


def total_energy(seamless: SeamlessMap, reference: Reference) -> float:
    """Energy of the whole map; infinite if a triangle is folded."""
    return energy_of(seamless, reference, np.arange(len(seamless.F)))


@kernel
def energy_of(seamless: SeamlessMap, reference: Reference, triangles: Ints) -> float:
    """Energy of some triangles [k]; infinite if one of them is folded."""
    total = 0.0
    for f in triangles:
        density = _density_at(seamless, reference, f)
        if not density < np.inf:
            return np.inf
        total += reference.area[f] * density
    return total


# inlined: handing over a map takes longer than the work
@kernel(inline="always")
def _density_at(seamless: SeamlessMap, reference: Reference, f: int) -> float:
    """Energy of a triangle over its reference area; infinite if it is folded."""
    cotangent = reference.cotangent
    a = corner_place(seamless, f, 0)
    b = corner_place(seamless, f, 1)
    c = corner_place(seamless, f, 2)
    area = 0.5 * wedge(b - a, c - a)
    if not area > _MIN_AREA:
        return np.inf
    first = 3 * f
    dirichlet = (
        cotangent[first] * square(c - b)
        + cotangent[first + 1] * square(c - a)
        + cotangent[first + 2] * square(b - a)
    )
    return energy_density(dirichlet, reference.area[f] / area, reference.density)


@kernel
def assemble(
    seamless: SeamlessMap,
    reference: Reference,
    edge_of_side: Ints,
    ends: Ints32,
    system: System,
) -> None:
    """Add all triangles to the Newton system; each vertex moves along the axes of its own frame.

    `edge_of_side` [m, 3] are the edges of the sides ab, bc, ca of the triangles, and `ends` [e, 2]
    the vertices of the edges.
    """
    for f in range(len(seamless.F)):
        a = seamless.F[f, 0]
        b = seamless.F[f, 1]
        c = seamless.F[f, 2]
        ab = edge_of_side[f, 0]
        bc = edge_of_side[f, 1]
        ca = edge_of_side[f, 2]
        add_triangle(
            f,
            (a, b, c),
            ((ab, ends[ab, 0] == a), (bc, ends[bc, 0] == b), (ca, ends[ca, 0] == c)),
            (_corner(seamless, f, 0), _corner(seamless, f, 1), _corner(seamless, f, 2)),
            (_axis(seamless, f, 0, 1.0), _axis(seamless, f, 1, 1.0), _axis(seamless, f, 2, 1.0)),
            (_axis(seamless, f, 0, 1j), _axis(seamless, f, 1, 1j), _axis(seamless, f, 2, 1j)),
            reference,
            system,
        )


@kernel
def _corner(seamless: SeamlessMap, f: int, k: int) -> Vector:
    """Corner k of triangle f on the plane z = 1, in the triangle's frame."""
    place = corner_place(seamless, f, k)
    return place.real, place.imag, 1.0


@kernel
def _axis(seamless: SeamlessMap, f: int, k: int, axis: complex) -> Vector:
    """An axis (1 or i) of the frame of corner k's vertex, as triangle f sees it."""
    direction = turned(complex(axis), seamless.turn[f, k])
    return direction.real, direction.imag, 0.0


class Star(NamedTuple):
    """Buffers of `expand_star`, for up to d triangles round a vertex."""

    first: Floats  # the corner after the vertex in each triangle, [d, 3]
    second: Floats  # the corner after that, [d, 3]
    shapes: Floats  # the reference of each triangle, [d, 4]
    terms: Floats  # the expansion, [d, 9]


def star_buffers(seamless: SeamlessMap) -> Star:
    """Buffers that hold the star of any vertex."""
    degree = int(np.diff(seamless.star_start).max())
    return Star(
        first=np.empty((degree, 3)),
        second=np.empty((degree, 3)),
        shapes=np.empty((degree, 4)),
        terms=np.empty((degree, TERMS)),
    )


@kernel
def fill_star(
    seamless: SeamlessMap, reference: Reference, v: int, origin: complex, star: Star
) -> int:
    """Expand the star of vertex v about a place in its frame; return its number of triangles.

    `star` is filled: its corners are seen from `origin`.
    """
    start = seamless.star_start[v]
    degree = seamless.star_start[v + 1] - start
    cotangent = reference.cotangent
    for i in range(degree):
        f = seamless.star[start + i] // 3
        k = seamless.star[start + i] % 3
        following = (k + 1) % 3
        last = (k + 2) % 3
        p = place_seen_from(seamless, f, k, following) - origin
        q = place_seen_from(seamless, f, k, last) - origin
        star.first[i, 0] = p.real
        star.first[i, 1] = p.imag
        star.first[i, 2] = 1.0
        star.second[i, 0] = q.real
        star.second[i, 1] = q.imag
        star.second[i, 2] = 1.0
        star.shapes[i, 0] = reference.area[f]
        star.shapes[i, 1] = cotangent[3 * f + k]
        star.shapes[i, 2] = cotangent[3 * f + following]
        star.shapes[i, 3] = cotangent[3 * f + last]
    expand_star(
        _ORIGIN,
        _COLUMN_DIRECTION,
        _ROW_DIRECTION,
        star.first,
        star.second,
        star.shapes,
        degree,
        star.terms,
    )
    return degree


@kernel
def sweep(
    seamless: SeamlessMap, reference: Reference, vertices: Ints, star: Star, rehome_at_once: bool
) -> float:
    """Move vertices [k], one after the other, by a Newton step inside the star of each.

    Returns by how much the energy falls. A vertex that leaves its chart takes the frame of its new
    chart at once, or the caller calls `rehome`. `star` are buffers for any of the vertices.
    """
    energy_fall = 0.0
    for v in vertices:
        freedom = seamless.freedom[v]
        if freedom == FIXED:
            continue
        place_before = seamless.z[v]
        degree = fill_star(seamless, reference, v, place_before, star)
        fall, move = descend(star.terms, degree, reference.density, 0.0, freedom)
        if fall == 0.0 and freedom == FREE:
            move = _opening_move(star, degree, reference.density)
        energy_fall += fall
        seamless.z[v] = place_before + complex(move[0], move[1])
        if rehome_at_once:
            rehome_vertex(seamless, v, place_before)
    return energy_fall


@kernel
def _opening_move(star: Star, degree: int, density: Density) -> Vector:
    """The move of a star's vertex that gives all triangles an area where round-off left one none.

    The move leads some way to the middle of the star. It is zero if all triangles have areas
    already, and if no trial gives them areas.
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
    """Move every vertex once, and then into its chart; return by how much the energy falls."""
    places_before = seamless.z.copy()
    vertices = np.arange(len(seamless.z))
    if backwards:
        vertices = vertices[::-1].copy()
    fall = sweep(seamless, reference, vertices, star_buffers(seamless), False)
    rehome(seamless, places_before)
    return fall


def relax_all(seamless: SeamlessMap, reference: Reference, least_gain: float) -> None:
    """Lower the energy of a map in place: sweeps first, then Newton steps.

    The steps end when one saves less than the share `least_gain` of the energy. For this a triangle
    counts as strained by `_STRAINED` at most.
    """
    edges = edges_of(seamless.F)
    ends = edges.ends.astype(np.int32)
    triangles = np.arange(len(seamless.F))

    def energy() -> float:
        return _capped_energy(seamless, reference, triangles, _STRAINED)

    def step_all(cg_steps: int) -> tuple[float, float]:
        before = energy()
        _, step = newton_step(seamless, reference, edges.of_side, ends, cg_steps)
        return before - energy(), step

    def sweep_once(backwards: bool) -> float:
        before = energy()
        sweep_all(seamless, reference, backwards)
        return before - energy()

    for i in range(_SWEEPS_BEFORE_NEWTON):
        sweep_all(seamless, reference, i % 2 == 0)
    _ease(seamless, reference)
    stop = (least_gain, 1, _MAX_NEWTON_STEPS)
    descend_by_newton(step_all, sweep_once, energy, stop, _CG_RANGE)


def _ease(seamless: SeamlessMap, reference: Reference) -> None:
    """Sweep over the spots where the map is strained most, until that gains little.

    Newton steps of the whole map would be cut short there, and most of their work wasted.
    """
    buffers = star_buffers(seamless)
    for _ in range(_MAX_EASING_ROUNDS):
        densities = _densities(seamless, reference)
        highest = densities.max(where=densities < np.inf, initial=0.0)
        triangles = np.flatnonzero(densities > max(_STRAINED, _EASED_TOGETHER * highest))
        if not len(triangles):
            break
        vertices = np.unique(seamless.F[triangles])
        energy = _capped_energy(seamless, reference, triangles, highest)
        for _ in range(_SWEEPS_OF_EASING):
            vertices = vertices[::-1].copy()
            sweep(seamless, reference, vertices, buffers, True)
        lower = _capped_energy(seamless, reference, triangles, highest)
        if lower > (1 - _MIN_EASING) * energy:
            break


@kernel
def _densities(seamless: SeamlessMap, reference: Reference) -> Floats:
    """Energy of each triangle over its reference area, [m]."""
    densities = np.empty(len(seamless.F))
    for f in range(len(densities)):
        densities[f] = _density_at(seamless, reference, f)
    return densities


@kernel
def _capped_energy(
    seamless: SeamlessMap, reference: Reference, triangles: Ints, highest: float
) -> float:
    """Energy of some triangles [k], each with a density of at most `highest`."""
    total = 0.0
    for f in triangles:
        total += reference.area[f] * min(_density_at(seamless, reference, f), highest)
    return total


def newton_step(
    seamless: SeamlessMap, reference: Reference, edge_of_side: Ints, ends: Ints32, cg_steps: int
) -> tuple[float, float]:
    """Move the map by one Newton step in place; return the fall of the energy and the step.

    The step is 1 for a whole one, and 0 where the energy is infinite or no step lowers it. For
    `edge_of_side` and `ends` see `assemble`.
    """
    energy = total_energy(seamless, reference)
    if not energy < np.inf:
        return 0.0, 0.0
    system = System.zeros(len(seamless.z), len(ends))
    assemble(seamless, reference, edge_of_side, ends, system)
    _remove_fixed_directions(system, seamless.freedom, ends)
    moves = conjugate_gradients(ends, system, cg_steps, CG_TOLERANCE)
    slope = float((system.gradient * moves).sum())
    if not slope < 0:
        return 0.0, 0.0
    direction = moves @ (1, 1j)
    to_fold = _MAX_SHARE_OF_FOLD * _time_of_first_fold(seamless, direction)
    to_longest = _MAX_STEP / float(np.sqrt(square(direction).max()))
    start = seamless.z.copy()

    def energy_at(t: float) -> float:
        seamless.z[:] = start + t * direction
        return total_energy(seamless, reference)

    t, lower = line_search(energy, slope, min(to_fold, to_longest), energy_at)
    seamless.z[:] = start + t * direction
    rehome(seamless, start)
    return energy - lower, t


def _remove_fixed_directions(system: System, freedom: Ints, ends: Ints32) -> None:
    """Take the directions in which vertices must not move out of a Newton system, in place.

    Their gradient and their off-diagonal entries become 0, and their diagonal entries 1.
    """
    is_free = np.stack([freedom & COLUMN, freedom & ROW], axis=1).astype(bool)  # [n, 2]
    system.gradient[~is_free] = 0.0
    system.diagonal[~is_free[:, 0], 0] = 1.0
    system.diagonal[~is_free[:, 1], 2] = 1.0
    system.diagonal[~is_free.all(axis=1), 1] = 0.0
    edges = np.flatnonzero(~is_free[ends].all(axis=(1, 2)))
    rows, columns = is_free[ends[edges]].transpose(1, 0, 2)
    both_free = (rows[:, :, None] & columns[:, None, :]).reshape(-1, 4)
    system.blocks[edges] = np.where(both_free, system.blocks[edges], 0.0)


@kernel
def _time_of_first_fold(seamless: SeamlessMap, velocity: Complex) -> float:
    """The first time at which a triangle has no area, if vertices move at constant velocities [n].

    The double area of a triangle is a quadratic polynomial of the time.
    """
    first_time = np.inf
    places = np.empty(3, np.complex128)
    velocities = np.empty(3, np.complex128)
    for f in range(len(seamless.F)):
        for k in range(3):
            places[k] = corner_place(seamless, f, k)
            velocities[k] = turned(velocity[seamless.F[f, k]], seamless.turn[f, k])
        u = places[1] - places[0]
        v = places[2] - places[0]
        u_rate = velocities[1] - velocities[0]
        v_rate = velocities[2] - velocities[0]
        constant = wedge(u, v)
        linear = wedge(u, v_rate) + u_rate.real * v.imag - u_rate.imag * v.real
        quadratic = wedge(u_rate, v_rate)
        first_time = min(first_time, _least_positive_root(quadratic, linear, constant))
    return first_time


@kernel
def _least_positive_root(a: float, b: float, c: float) -> float:
    """The least t > 0 with a t^2 + b t + c = 0, for c > 0; infinite if there is none."""
    discriminant = b * b - 4 * a * c
    if discriminant < 0 or (a >= 0 and b >= 0):
        return np.inf
    root = 2 * c / (-b + np.sqrt(discriminant))
    return root if root > 0 else np.inf
