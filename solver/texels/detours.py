"""How much longer the way over the facets of a mesh is than the straight line between two texels.

A straight line cuts off the edges between facets. The way over the facets is found in two steps. A
plane through both texels, along the mean normal of their facets, cuts the triangles between them.
Then the way through the cut edges is pulled tight: it is the shortest over these triangles. Over
one fold it is the geodesic of the polyhedron, and elsewhere next to it.
"""

from __future__ import annotations

import numpy as np

from ..kernel import Floats, Floats32, Ints, kernel
from ..mesh.mesh import Mesh
from ..mesh.vectors import combine, cross, dot, row, subtract, unit
from .topology import TexelTopology

# Edges that a way crosses, at most.
_MAX_EDGES = 256

# Passes over the points of a way that pull it tight, at most.
_MAX_PULLS = 32

# A way is tight once no point moves by more than this share of its edge.
_MAX_LAST_PULL = 1e-4

# Excess of the squared way over the squared straight line, at least: less is round-off.
_MIN_EXCESS = 1e-9

# Excess, at most: a way twice as long as straight leads round other things than folds.
_MAX_EXCESS = 3.0

# Barycentric coordinates up to this count as 0: the point lies on a side.
_ON_SIDE = 1e-9

# The four links of a place: rows and columns from their first end to the second, and the column of
# the first end, from the place.
_LINKS = ((0, 1, 0), (1, 0, 0), (1, 1, 0), (1, -1, 1))
_NORTH = 1  # the link that does not leave the column


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
    texel_at = np.where(topology.rim, -1, topology.halo)
    detours = np.zeros((4, *texel_at.shape), np.float32)
    _measure(
        texel_at,
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
    texel_at: Ints,
    V: Floats,
    F: Ints,
    beside: Ints,
    triangles: Ints,
    weights: Floats,
    detours: Floats32,
) -> None:
    """Fill in the detours [4, C, n + 2, n + 2] of the links between texels.

    `texel_at` [C, n + 2, n + 2] is the texel at each place, -1 for none. `triangles` [T] and
    `weights` [T, 3] say where in the triangles F [m, 3] the texels lie.
    """
    charts, width, _ = texel_at.shape
    edges = np.empty((_MAX_EDGES, 2), np.int64)
    points = np.empty((_MAX_EDGES, 3))
    for link, (down, right, start_column) in enumerate(_LINKS):
        for chart in range(charts):
            for r in range(width - down):
                for c in range(width if link == _NORTH else width - 1):
                    first = texel_at[chart, r, c + start_column]
                    second = texel_at[chart, r + down, c + start_column + right]
                    a = min(first, second)  # from the same end for all copies
                    b = max(first, second)
                    if a < 0 or a == b or triangles[a] == triangles[b]:
                        continue
                    p = _point(V, F, triangles[a], weights, a)
                    q = _point(V, F, triangles[b], weights, b)
                    straight_squared = dot(subtract(q, p), subtract(q, p))
                    if not straight_squared > 0.0:
                        continue
                    start = (a, triangles[a], p)
                    end = (b, triangles[b], q)
                    count = _cut(V, F, beside, weights, start, end, edges, points)
                    if count == 0:
                        continue
                    length = _pulled(V, edges, points, count, p, q)
                    excess = length * length / straight_squared - 1.0
                    if _MIN_EXCESS < excess < _MAX_EXCESS:
                        detours[link, chart, r, c] = excess


@kernel(no_cpython_wrapper=True)
def _point(
    V: Floats, F: Ints, triangle: int, weights: Floats, i: int
) -> tuple[float, float, float]:
    """The point of texel i: with its weights at the corners of a triangle."""
    first = combine(weights[i, 0], row(V, F[triangle, 0]), weights[i, 1], row(V, F[triangle, 1]))
    return combine(1.0, first, weights[i, 2], row(V, F[triangle, 2]))


@kernel(no_cpython_wrapper=True)
def _holds(F: Ints, triangle: int, other: int, weights: Floats, i: int) -> bool:
    """Whether a triangle holds texel i, which has its weights in the triangle `other`.

    It does if it has all vertices of the other triangle with a weight.
    """
    for k in range(3):
        v = F[other, k]
        is_common = v == F[triangle, 0] or v == F[triangle, 1] or v == F[triangle, 2]
        if weights[i, k] > _ON_SIDE and not is_common:
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
    """Fill in the edges [e, 2] that the plane cuts from start to end, and points on them [e, 3].

    The start and the end are each a texel, its triangle and its point. Returns the number of edges:
    0 where the end is in the same triangle, or is not found.
    """
    a, triangle, p = start
    b, last_triangle, q = end
    if _holds(F, last_triangle, triangle, weights, a) or _holds(
        F, triangle, last_triangle, weights, b
    ):
        return 0
    way = subtract(q, p)
    facet_normals = combine(1.0, _normal(V, F, triangle), 1.0, _normal(V, F, last_triangle))
    plane_normal = cross(way, facet_normals)
    entered_side = -1
    for count in range(_MAX_EDGES):
        # of the sides that the plane cuts, leave by the one farthest along the way
        farthest = -np.inf
        left_side = -1
        for k in range(3):
            v = F[triangle, k]
            w = F[triangle, (k + 1) % 3]
            off_plane_v = dot(plane_normal, subtract(row(V, v), p))
            off_plane_w = dot(plane_normal, subtract(row(V, w), p))
            if k == entered_side or (off_plane_v >= 0.0) == (off_plane_w >= 0.0):
                continue
            t = off_plane_v / (off_plane_v - off_plane_w)
            x = combine(1.0 - t, row(V, v), t, row(V, w))
            along = dot(way, subtract(x, p))
            if along > farthest:
                farthest = along
                left_side = k
                edges[count, 0] = v
                edges[count, 1] = w
                points[count, 0], points[count, 1], points[count, 2] = x
        if left_side < 0 or beside[triangle, left_side] < 0:
            return 0
        triangle = beside[triangle, left_side]
        if _holds(F, triangle, last_triangle, weights, b):
            return count + 1
        entered_side = -1
        for k in range(3):
            if F[triangle, k] == edges[count, 1] and F[triangle, (k + 1) % 3] == edges[count, 0]:
                entered_side = k
    return 0


@kernel(no_cpython_wrapper=True)
def _normal(V: Floats, F: Ints, triangle: int) -> tuple[float, float, float]:
    """Unit normal of a triangle."""
    a = row(V, F[triangle, 0])
    ab = subtract(row(V, F[triangle, 1]), a)
    ac = subtract(row(V, F[triangle, 2]), a)
    return unit(cross(ab, ac))


@kernel(no_cpython_wrapper=True)
def _pulled(V: Floats, edges: Ints, points: Floats, count: int, p: tuple, q: tuple) -> float:
    """Length of the way from p to q through points on edges, once it is pulled tight.

    Each point moves along its edge to where the way is shortest. Laid flat, the two triangles at an
    edge hold a straight line between the points before and after.
    """
    for _ in range(_MAX_PULLS):
        moved_squared = 0.0
        for i in range(count):
            a = row(V, edges[i, 0])
            edge = subtract(row(V, edges[i, 1]), a)
            edge_squared = dot(edge, edge)
            before = subtract(p if i == 0 else row(points, i - 1), a)
            after = subtract(q if i == count - 1 else row(points, i + 1), a)
            # places of both along the edge, in units of it, and their distances from it
            s = dot(before, edge) / edge_squared
            t = dot(after, edge) / edge_squared
            across_before = combine(1.0, before, -s, edge)
            across_after = combine(1.0, after, -t, edge)
            far_before = np.sqrt(dot(across_before, across_before))
            far_after = np.sqrt(dot(across_after, across_after))
            far_both = far_before + far_after
            crossing = min(max((s * far_after + t * far_before) / far_both, 0.0), 1.0)
            if not (edge_squared > 0.0 and far_both > 0.0):
                continue
            x = combine(1.0, a, crossing, edge)
            step = subtract(x, row(points, i))
            moved_squared = max(moved_squared, dot(step, step) / edge_squared)
            points[i, 0], points[i, 1], points[i, 2] = x
        if count == 1 or moved_squared < _MAX_LAST_PULL * _MAX_LAST_PULL:
            break
    length = 0.0
    last = p
    for i in range(count + 1):
        x = q if i == count else row(points, i)
        step = subtract(x, last)
        length = length + np.sqrt(dot(step, step))
        last = x
    return length
