"""The progressive sphere map: collapse to a tetrahedron, put it on the sphere, bring the vertices back level by level.

In the family of Praun and Hoppe (2003) and of Hu, Fu and Liu (2017). What is new here is the carried area (`level`),
and a triple-product barrier with Newton steps on every level (`energy`, `newton`).

Each vertex comes back inside the kernel of its star, so that no triangle ever folds. Next to the vertex v it was merged
with, the kernel is the wedge between the great circles through v and the two neighbours they share, left and right. The
bisector of that wedge always leads into it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import SphereMapError
from ...kernel import Floats, Ints32, kernel
from ...mesh.vectors import combine, cross, dot, row, subtract, unit
from ..energy import TERMS, Density, Reference, expand_star, star_energy
from .certificate import align, areas, certify
from .decimation import CornerTable, corner_table, decimate, following, gather_star, preceding, undo_collapse
from .level import RealSurface, build_level, carry, update_level, update_load, update_triangle
from .relaxation import SPHERE, relax_level, relax_vertex, tangent_frame

TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
GRID = 2.0**32  # the normalised mesh is rounded to multiples of 1 / GRID
EQUAL_UNTIL, REAL_FROM = 12, 100  # vertices of a level: equal equilateral references until, real shapes from
COARSE_SLIVER, FINE_SLIVER = 0.5, 0.15  # shape quality below which a reference is pulled towards equilateral
SLOW_GROWTH, FAST_GROWTH = 1.25, 2.0  # from one level to the next, below and above CAREFUL_UNTIL vertices
CAREFUL_UNTIL = 30
TRUST_LADDER = (1.0, 0.6, 0.3, 0.0)  # in the real triangles, each tried when the one before gave no certified map


def progressive_sphere_map(V: NDArray[np.float64], F: NDArray[np.integer]) -> NDArray[np.float64]:
    """Map a closed triangle mesh of genus 0 one-to-one onto the unit sphere, its area spread evenly.

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
    normal_V = _normalise(np.asarray(V, dtype=np.float64), F)
    order = _morton_order(normal_V)
    number = np.empty(len(V), dtype=np.int64)
    number[order] = np.arange(len(V))
    triangles = number[F]
    triangles = triangles[np.argsort(triangles.min(axis=1), kind="stable")]
    for trust in TRUST_LADDER:
        S = _map_by_levels(normal_V[order], triangles, trust)[number]
        certificate = certify(F, S)
        if certificate.valid:
            turned = align(normal_V, F, S)
            return turned if certify(F, turned).valid else S  # round-off can fold the tiniest triangles
    raise SphereMapError(
        f"no fold-free sphere map was found: {certificate.flipped} of {len(F)} triangles are folded, the solid angle "
        f"is {certificate.solid_angle:.6g} instead of 4 pi; simplify or remesh the mesh, and remove its slivers"
    )


def _normalise(V: Floats, F: NDArray[np.integer]) -> Floats:
    """Centre the mesh, scale its area to 4 pi, and round it, so that its place and size do not change the map.

    Without rounding, the last bits would decide between the many equivalent ways out of a symmetric coarse level.
    """
    V = V - V.mean(axis=0)
    return np.rint(V * np.sqrt(4 * np.pi / np.sum(areas(V, F))) * GRID) / GRID


def _map_by_levels(V: Floats, F: NDArray[np.integer], trust: float) -> Floats:
    n = len(V)
    carried = np.full(n, 1e-3 * 4 * np.pi / n)  # every vertex gets some room, even if its triangles have no area
    carried += np.bincount(F.ravel(), np.repeat(areas(V, F) / 3, 3), n)
    table = corner_table(F, n)
    log = decimate(table, V)
    removed, kept = table.tail[log], table.tail[table.twin[log]]
    carry(removed, kept, carried)
    # how many vertices the first level has that shows a vertex or a triangle
    vertex_since, triangle_since = np.full(n, 4), np.full(len(F), 4)
    arrival = n - np.arange(len(log))
    vertex_since[removed] = triangle_since[log // 3] = triangle_since[table.twin[log] // 3] = arrival

    S = np.zeros((n, 3))
    S[_tetrahedron(table, np.flatnonzero(vertex_since == 4))] = TETRAHEDRON
    reference = Reference(np.zeros(len(F)), np.zeros(3 * len(F)), SPHERE)
    load = np.ones(n)
    count = 4
    for size in _level_sizes(n):
        shape_trust = trust * min(max(np.log(size / EQUAL_UNTIL) / np.log(REAL_FROM / EQUAL_UNTIL), 0.0), 1.0)
        sliver = COARSE_SLIVER if size < n / 4 else FINE_SLIVER
        surface = RealSurface(V, carried, load, shape_trust, sliver, 4 * np.pi / (2 * size - 4))

        vertices, triangles = np.flatnonzero(vertex_since <= count), np.flatnonzero(triangle_since <= count)
        update_level(vertices, triangles, table, surface, reference)
        insert_vertices(log[n - size : n - count], table, surface, S, reference)
        count = size

        vertices, triangles = np.flatnonzero(vertex_since <= count), np.flatnonzero(triangle_since <= count)
        update_level(vertices, triangles, table, surface, reference)
        corners = (3 * triangles[:, None] + np.arange(3)).ravel()
        level_S = S[vertices]
        shown = Reference(reference.area[triangles], reference.cotangent[corners], SPHERE)
        relax_level(build_level(table, vertices, triangles), level_S, shown)
        S[vertices] = level_S
    return S


def _tetrahedron(table: CornerTable, vertices: NDArray[np.integer]) -> list[int]:
    """Order the last four vertices so that placing them at TETRAHEDRON leaves no triangle inside out."""
    a = int(vertices[0])
    h = int(table.leaving[a])
    b, c = int(table.tail[following(h)]), int(table.tail[preceding(h)])
    (d,) = {int(v) for v in vertices} - {a, b, c}
    return [a, b, c, d]


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


def _morton_order(V: NDArray[np.float64]) -> NDArray[np.int64]:
    """Vertices along a Morton curve: neighbours in space come close together in memory."""
    cells = ((V - V.min(axis=0)) / max(float(np.ptp(V, axis=0).max()), 1e-300) * 1023.999).astype(np.int64)
    code = np.zeros(len(V), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


CROWDED = 64  # neighbours of a new vertex with more triangles than this wait for the sweeps


@kernel
def _gather(
    neighbours: Ints32, degree: int, tail: Ints32, S: Floats, reference: Reference, ring: Floats, shapes: Floats
) -> None:
    """Fill in what `expand_star` asks for, from the half-edges to the neighbours."""
    cotangent = reference.cotangent
    for i in range(degree):
        h = neighbours[i]
        ring[i, 0], ring[i, 1], ring[i, 2] = row(S, tail[following(h)])
        shapes[i, 0], shapes[i, 1] = reference.area[h // 3], cotangent[h]
        shapes[i, 2], shapes[i, 3] = cotangent[following(h)], cotangent[preceding(h)]


@kernel
def _place(
    u: int,
    v: int,
    left: int,
    right: int,
    S: Floats,
    ring: Floats,
    shapes: Floats,
    degree: int,
    density: Density,
    terms: Floats,
) -> None:
    """Put u where its star's energy is least among trial points on the ways from v."""
    start = row(S, v)
    x, y = tangent_frame(start)
    expand_star(start, x, y, ring, shapes, degree, terms)
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
            energy = star_energy(terms, degree, density, (dot(move, x), dot(move, y), dot(move, start)))
            if energy < least:
                least = energy
                best = p
            elif least < np.inf:
                break
            t *= share
        if least < np.inf:
            break
    S[u, 0], S[u, 1], S[u, 2] = best


@kernel
def insert_vertices(log: Ints32, table: CornerTable, surface: RealSurface, S: Floats, reference: Reference) -> None:
    """Undo the collapses in `log`, latest first, and relax round every new vertex.

    A vertex that finds no place leaves a fold behind, which the certificate will find.
    """
    tail, density = table.tail, reference.density
    neighbours, others = np.empty(len(S), np.int32), np.empty(len(S), np.int32)
    ring, shapes, terms = np.empty((len(S), 3)), np.empty((len(S), 4)), np.empty((len(S), TERMS))
    other_ring, other_shapes = np.empty((CROWDED, 3)), np.empty((CROWDED, 4))
    for h in log[::-1]:
        u, v = tail[h], tail[table.twin[h]]
        undo_collapse(table, h)
        surface.carried[v] -= surface.carried[u]
        for w in (v, u):
            update_load(w, neighbours, gather_star(table, w, neighbours), tail, surface)
        for w in (v, u):
            degree = gather_star(table, w, neighbours)
            for i in range(degree):
                update_triangle(neighbours[i] // 3, tail, surface, reference)
        _gather(neighbours, degree, tail, S, reference, ring, shapes)
        _place(u, v, tail[preceding(h)], tail[preceding(table.twin[h])], S, ring, shapes, degree, density, terms)
        relax_vertex(u, S, ring, shapes, degree, density, terms)
        for i in range(degree):
            w = tail[following(neighbours[i])]
            other_degree = gather_star(table, w, others)
            if other_degree <= CROWDED:
                _gather(others, other_degree, tail, S, reference, other_ring, other_shapes)
                relax_vertex(w, S, other_ring, other_shapes, other_degree, density, terms)
            ring[i, 0], ring[i, 1], ring[i, 2] = row(S, w)
