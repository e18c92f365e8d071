"""The progressive sphere map: collapse to a tetrahedron, put it on the sphere, bring the vertices back level by level.

In the family of Praun and Hoppe (2003) and of Hu, Fu and Liu (2017). What is new here is the carried area
(`reference`), and a triple-product barrier with Newton steps on every level (`energy`, `newton`).

Bringing one level to the minimum of its energy: sweeps first, then Newton steps.

Far from the minimum a Newton step is cut short by the steepest of the energy's walls, wherever it stands, and an exact
direction is wasted. So conjugate gradients start with few steps, and get more once whole Newton steps succeed, and
after a step cut short a sweep clears the spots that were in the way.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import SphereMapError
from ...kernel import Floats
from .certificate import align, certify
from .decimation import CornerTable, corner_table, decimate, following, preceding
from .energy import Reference, total_energy
from .hessian import newton_step
from .level import Level, Source, build_level, carry, star_shapes, update_level
from .relaxation import insert_vertices, sweep

MOST_SWEEPS, TIRED_SWEEP = 5, 0.1  # stop when a sweep lowers the energy by less than this share
MOST_NEWTON_STEPS, TIRED_NEWTON = 20, 5e-3  # stop when two steps in a row do
LARGE, TIRED_LARGE = 8000, 1.5e-2  # vertices of a level that is content with less
LEAST_CG_STEPS, MOST_CG_STEPS = 10, 60
SHORT_STEP = 0.3  # a Newton step cut to less than this asks for fewer steps of conjugate gradients
EXPLODED = 1e5 * 4 * np.pi  # energy of a level that is stuck: start over from the sweeps
MOST_ROUNDS = 4


def relax_level(level: Level, S: Floats, reference: Reference) -> None:
    """Lower the energy of a level in place: sweeps until they tire, then Newton steps."""
    shapes = star_shapes(level.star, reference)
    for _ in range(MOST_ROUNDS):
        _sweep_until_tired(level, S, reference, shapes)
        _newton_until_tired(level, S, reference, shapes)
        if total_energy(level.tail, S, reference) < EXPLODED:
            return


def _sweep_until_tired(level: Level, S: Floats, reference: Reference, shapes: Floats) -> None:
    for i in range(MOST_SWEEPS):
        fall = sweep(level, S, shapes, i % 2 == 0)
        if fall < TIRED_SWEEP * total_energy(level.tail, S, reference):
            return


def _newton_until_tired(level: Level, S: Floats, reference: Reference, shapes: Floats) -> None:
    tired = TIRED_NEWTON if len(S) < LARGE else TIRED_LARGE
    cg_steps, slow = LEAST_CG_STEPS, 0
    for i in range(MOST_NEWTON_STEPS):
        fall, step = newton_step(level, S, reference, cg_steps)
        if step < 1.0:
            fall += sweep(level, S, shapes, i % 2 == 0)
        slow = slow + 1 if fall < tired * total_energy(level.tail, S, reference) else 0
        if slow == 2:
            return
        if step >= 1.0:
            cg_steps = min(2 * cg_steps, MOST_CG_STEPS)
        elif step < SHORT_STEP:
            cg_steps = max(cg_steps // 2, LEAST_CG_STEPS)


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
    return np.rint(V * np.sqrt(4 * np.pi / np.sum(_areas(V, F))) * GRID) / GRID


def _areas(V: Floats, F: NDArray[np.integer]) -> Floats:
    return 0.5 * np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1)


def _map_by_levels(V: Floats, F: NDArray[np.integer], trust: float) -> Floats:
    n = len(V)
    carried = np.full(n, 1e-3 * 4 * np.pi / n)  # every vertex gets some room, even if its triangles have no area
    carried += np.bincount(F.ravel(), np.repeat(_areas(V, F) / 3, 3), n)
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
    reference = Reference(np.zeros(len(F)), np.zeros(3 * len(F)))
    load = np.ones(n)
    count = 4
    for size in _level_sizes(n):
        shape_trust = trust * min(max(np.log(size / EQUAL_UNTIL) / np.log(REAL_FROM / EQUAL_UNTIL), 0.0), 1.0)
        sliver = COARSE_SLIVER if size < n / 4 else FINE_SLIVER
        source = Source(V, carried, load, shape_trust, sliver, 4 * np.pi / (2 * size - 4))

        vertices, triangles = np.flatnonzero(vertex_since <= count), np.flatnonzero(triangle_since <= count)
        update_level(vertices, triangles, table, source, reference)
        insert_vertices(log[n - size : n - count], table, source, S, reference)
        count = size

        vertices, triangles = np.flatnonzero(vertex_since <= count), np.flatnonzero(triangle_since <= count)
        update_level(vertices, triangles, table, source, reference)
        corners = (3 * triangles[:, None] + np.arange(3)).ravel()
        level_S = S[vertices]
        shown = Reference(reference.area[triangles], reference.cotangent[corners])
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
