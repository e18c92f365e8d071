"""How much longer the way over the facets of a mesh is than the straight line between two texels.

Straight lines cut the edges between facets short. The way is the shortest over those triangles that
a plane through both texels, and along the mean normal of their facets, cuts between them: drawn
where the plane cuts them, then pulled tight. In one fold that is the geodesic of the polyhedron,
elsewhere next to it.
"""

from __future__ import annotations

import numpy as np

from ..kernel import Floats, Floats32, Ints, kernel
from ..mesh.mesh import Mesh
from ..mesh.vectors import combine, cross, dot, row, subtract, unit
from .topology import TexelTopology

# Edges that a way crosses, at most.
_MOST_EDGES = 256

# Passes over the points of a way that pull it tight, at most.
_MOST_PULLS = 32

# A way is tight where no point moves by more than this share of its edge.
_TIGHT = 1e-4

# Least excess of the square of a way over that of the straight line: less is round-off.
_LEAST_EXCESS = 1e-9

# Greatest excess: a way twice as long as straight leads round other things than folds.
_MOST_EXCESS = 3.0

# Barycentric coordinates below this count as 0: the point lies on a side.
_ON_SIDE = 1e-9


def link_detours(
    mesh: Mesh, topology: TexelTopology, triangles: Ints, barycentrics: Floats
) -> Floats32:
    """Detour of each link: squared way over the facets over the squared straight line, less 1.

    Parameters
    ----------
    mesh : Mesh
    topology : TexelTopology
    triangles, barycentrics : int64 [C, n, n], float64 [C, n, n, 3]
        Where in the mesh's triangles the texels lie.

    Returns
    -------
    float32 [4, C, n + 2, n + 2]
        Of the links of each place with halo to the east, north, north-east, and of its other
        diagonal, as in a stencil; 0 where there is no link, or no way was found. All copies of a
        link agree to the last bit.
    """
    there = np.where(topology.rim, -1, topology.halo)
    detours = np.zeros((4, *there.shape), np.float32)
    _measure(
        there,
        mesh.V,
        mesh.F,
        mesh.beside,
        triangles.reshape(-1),
        barycentrics.reshape(-1, 3),
        detours,
    )
    return detours


@kernel
def _measure(
    there: Ints, V: Floats, F: Ints, beside: Ints, triangles: Ints, weights: Floats, out: Floats32
) -> None:
    """Fill in the detours between texels at places [C, n + 2, n + 2], -1 for none."""
    charts, width, _ = there.shape
    edges = np.empty((_MOST_EDGES, 2), np.int64)
    points = np.empty((_MOST_EDGES, 3))
    for link, (dr, dc, shift) in enumerate(((0, 1, 0), (1, 0, 0), (1, 1, 0), (1, -1, 1))):
        for chart in range(charts):
            for r in range(width - dr):
                for c in range(width - 1 if link != 1 else width):
                    first = there[chart, r, c + shift]
                    second = there[chart, r + dr, c + shift + dc]
                    a = min(first, second)  # from the same end for all copies
                    b = max(first, second)
                    if a < 0 or a == b or triangles[a] == triangles[b]:
                        continue
                    p = _point(V, F, triangles[a], weights, a)
                    q = _point(V, F, triangles[b], weights, b)
                    square = dot(subtract(q, p), subtract(q, p))
                    if not square > 0.0:
                        continue
                    start = (a, triangles[a], p)
                    end = (b, triangles[b], q)
                    count = _cut(V, F, beside, weights, start, end, edges, points)
                    if count > 0:
                        length = _pulled(V, edges, points, count, p, q)
                        excess = length * length / square - 1.0
                        if _LEAST_EXCESS < excess < _MOST_EXCESS:
                            out[link, chart, r, c] = excess


@kernel(no_cpython_wrapper=True)
def _point(
    V: Floats, F: Ints, triangle: int, weights: Floats, i: int
) -> tuple[float, float, float]:
    """The point with weights [i] at the corners of a triangle."""
    first = combine(weights[i, 0], row(V, F[triangle, 0]), weights[i, 1], row(V, F[triangle, 1]))
    return combine(1.0, first, weights[i, 2], row(V, F[triangle, 2]))


@kernel(no_cpython_wrapper=True)
def _holds(F: Ints, triangle: int, other: int, weights: Floats, i: int) -> bool:
    """Whether a triangle holds the point that has weights [i] in another."""
    for k in range(3):
        v = F[other, k]
        if (
            weights[i, k] > _ON_SIDE
            and v != F[triangle, 0]
            and v != F[triangle, 1]
            and v != F[triangle, 2]
        ):
            return False
    return True


@kernel(no_cpython_wrapper=True)
def _cut(
    V: Floats,
    F: Ints,
    beside: Ints,
    weights: Floats,
    start: tuple,
    end: tuple,
    edges: Ints,
    points: Floats,
) -> int:
    """Fill in the edges that the plane cuts from start to end, and the points on them.

    The start and the end are each a texel, its triangle and its point. Returns the number of edges:
    0 where the end is in the same triangle, or is not found.
    """
    (a, here, p) = start
    (b, target, q) = end
    if _holds(F, target, here, weights, a) or _holds(F, here, target, weights, b):
        return 0
    way = subtract(q, p)
    normal = cross(way, combine(1.0, _normal(V, F, here), 1.0, _normal(V, F, target)))
    entered = -1
    for count in range(_MOST_EDGES):
        best = -np.inf
        leaving = -1
        for k in range(3):
            v = F[here, k]
            w = F[here, (k + 1) % 3]
            side_v = dot(normal, subtract(row(V, v), p))
            side_w = dot(normal, subtract(row(V, w), p))
            if k == entered or (side_v >= 0.0) == (side_w >= 0.0):
                continue
            t = side_v / (side_v - side_w)
            x = combine(1.0 - t, row(V, v), t, row(V, w))
            along = dot(way, subtract(x, p))
            if along > best:
                best = along
                leaving = k
                edges[count, 0] = v
                edges[count, 1] = w
                points[count, 0], points[count, 1], points[count, 2] = x
        if leaving < 0 or beside[here, leaving] < 0:
            return 0
        here = beside[here, leaving]
        if _holds(F, here, target, weights, b):
            return count + 1
        entered = -1
        for k in range(3):
            if F[here, k] == edges[count, 1] and F[here, (k + 1) % 3] == edges[count, 0]:
                entered = k
    return 0


@kernel(no_cpython_wrapper=True)
def _normal(V: Floats, F: Ints, triangle: int) -> tuple[float, float, float]:
    """Unit normal of a triangle."""
    a = row(V, F[triangle, 0])
    return unit(cross(subtract(row(V, F[triangle, 1]), a), subtract(row(V, F[triangle, 2]), a)))


@kernel(no_cpython_wrapper=True)
def _pulled(V: Floats, edges: Ints, points: Floats, count: int, p: tuple, q: tuple) -> float:
    """Length of the way from p to q through points on edges, once it is pulled tight.

    Each point moves along its edge to where the way is shortest. Laid flat, the two triangles at an
    edge hold a straight line between the points before and after.
    """
    for _ in range(_MOST_PULLS):
        moved = 0.0
        for i in range(count):
            a = row(V, edges[i, 0])
            edge = subtract(row(V, edges[i, 1]), a)
            square = dot(edge, edge)
            before = subtract(p if i == 0 else row(points, i - 1), a)
            after = subtract(q if i == count - 1 else row(points, i + 1), a)
            s = dot(before, edge) / square
            t = dot(after, edge) / square
            off_s = combine(1.0, before, -s, edge)
            off_t = combine(1.0, after, -t, edge)
            far_s = np.sqrt(dot(off_s, off_s))
            far_t = np.sqrt(dot(off_t, off_t))
            place = min(max((s * far_t + t * far_s) / (far_s + far_t), 0.0), 1.0)
            if not (square > 0.0 and far_s + far_t > 0.0):
                continue
            x = combine(1.0, a, place, edge)
            step = subtract(x, row(points, i))
            moved = max(moved, dot(step, step) / square)
            points[i, 0], points[i, 1], points[i, 2] = x
        if count == 1 or moved < _TIGHT * _TIGHT:
            break
    length = 0.0
    last = p
    for i in range(count + 1):
        x = q if i == count else row(points, i)
        step = subtract(x, last)
        length = length + np.sqrt(dot(step, step))
        last = x
    return length
