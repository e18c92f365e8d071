"""Surfaces cut apart where they touch themselves, so that what is left is manifold.

Of the sides of triangles that lie on the same edge two by two are joined. Where more than two meet,
that says which sheet goes on in which.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .clean import Corners, counted
from .topology import labels, turned, undirected

# Sides on one edge up to which every pair is weighed; beyond, only neighbours round the edge.
_ALL_PAIRS = 12

# Joining in a way that the vertices as given do not show is the last choice when windings are made
# to agree.
_APART = 1e6

# Where a vertex is put into an edge, counted from the lower one: not in the middle, where another
# may lie already.
_BETWEEN = 0.382


def matched(
    V: NDArray[np.float64],
    F: NDArray[np.int64],
    sides: NDArray[np.int64],
    sheet: NDArray[np.int64],
    flip: NDArray[np.bool_],
) -> NDArray[np.int64]:
    """Join sides of crowded edges two by two, the best pairs first, none that would make the surface one-sided.

    Parameters
    ----------
    V, F : [vertex_count, 3], [triangle_count, 3]
    sides : [k]
        Sides that are to be joined, numbered 3 x triangle + side.
    sheet : [triangle_count]
        Sheet to which each triangle belongs so far.
    flip : bool [triangle_count]
        Triangles to be turned for the windings of each sheet to agree.

    Returns
    -------
    int64 [pair_count, 2]
    """
    key, forward = undirected(F)
    forward = forward ^ np.repeat(flip, 3)
    sides = sides[np.argsort(key[sides], kind="stable")]
    angle = _angles(V, F, sides, key[sides])
    order = np.lexsort((angle, key[sides]))
    first, second = _candidates(key[sides])
    first = order[first]
    second = order[second]
    one = sides[first]
    two = sides[second]
    differ = forward[one] == forward[two]
    apart = sheet[one // 3] != sheet[two // 3]
    # a side that runs forward has the inside on the side of smaller angles, the other one on that
    # of larger ones
    inside = np.where(forward[one], angle[first] - angle[second], angle[second] - angle[first]) % (
        2 * np.pi
    )
    # 0 where they go on straight, 1 where one lies on the other; of two equal bends the convex one,
    # so that bodies that touch along an edge stay two
    cost = np.abs(np.pi - inside) / np.pi + 1e-6 * inside + apart + 2.0 * differ
    best = np.argsort(cost, kind="stable")
    return _chosen(np.stack([one, two], axis=1)[best], differ[best], sheet)


def _angles(
    V: NDArray[np.float64], F: NDArray[np.int64], sides: NDArray[np.int64], key: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Angles at which triangles lie round their common edge, counted from the first on it, seen against the edge.

    Sides are sorted by `key`, the number of their edge.
    """
    triangle = sides // 3
    k = sides % 3
    a = F[triangle, k]
    b = F[triangle, (k + 1) % 3]
    axis = V[np.maximum(a, b)] - V[np.minimum(a, b)]
    axis = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), np.finfo(float).tiny)
    across = V[F[triangle, (k + 2) % 3]] - V[a]
    across = across - np.einsum("ij,ij->i", across, axis)[:, None] * axis
    first = across[np.repeat(*_runs(key))]
    turn = np.einsum("ij,ij->i", np.cross(first, across), axis)
    return np.arctan2(turn, np.einsum("ij,ij->i", first, across)) % (2 * np.pi)


def _candidates(key: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of places in a sorted list that have the same key: all, or, of very many, neighbours in turn."""
    starts, sizes = _runs(key)
    first = [np.empty(0, dtype=np.int64)]
    second = [np.empty(0, dtype=np.int64)]
    for size in np.unique(sizes[sizes > 1]).tolist():
        places = np.arange(size)
        i, j = np.triu_indices(size, 1) if size <= _ALL_PAIRS else (places, np.roll(places, -1))
        base = starts[sizes == size][:, None]
        first.append((base + i).ravel())
        second.append((base + j).ravel())
    return np.concatenate(first), np.concatenate(second)


def _runs(ordered: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where each run of equal numbers in a sorted list begins, and how long it is."""
    first = np.flatnonzero(np.append(True, ordered[1:] != ordered[:-1]))
    return first, np.diff(np.append(first, len(ordered)))


def _chosen(
    pairs: NDArray[np.int64], against: NDArray[np.bool_], sheet: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The pairs taken one after the other, as long as their sides are free and windings can still be made to agree."""
    parent = list(range(int(sheet.max()) + 1))
    odd = [False] * len(parent)  # turned against the parent
    size = [1] * len(parent)

    def root(node: int) -> tuple[int, bool]:
        flip = False
        while parent[node] != node:
            flip ^= odd[node]
            node = parent[node]
        return node, flip

    taken: set[int] = set()
    chosen = []
    sheets = sheet[pairs // 3].tolist()
    for (first, second), (one, two), differ in zip(
        pairs.tolist(), sheets, against.tolist(), strict=True
    ):
        if first in taken or second in taken:
            continue
        (a, flip_a) = root(one)
        (b, flip_b) = root(two)
        turn = differ ^ flip_a ^ flip_b
        if a == b and turn:
            continue
        if a != b:
            small, large = (a, b) if size[a] < size[b] else (b, a)
            parent[small] = large
            odd[small] = turn
            size[large] += size[small]
        taken |= {first, second}
        chosen.append((first, second))
    return np.array(chosen, dtype=np.int64).reshape(-1, 2)


def join_sides(
    V: NDArray[np.float64], corners: Corners
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Join the sides that lie on the same edge, two by two, to an orientable surface.

    Two alone on an edge belong together. Where more meet, first those are joined that share both
    vertices as given; then, pair by pair, those whose windings agree, that are parts of one sheet
    already, and between which the surface bends least. What remains single becomes a rim. A
    one-sided surface stays open along a path.

    Returns
    -------
    pairs : int64 [k, 2]
        Sides that are joined, numbered 3 x triangle + side. All others are rims.
    crowded : int64 [j]
        One side of every edge on which more than two lie.
    one_sided : int64 [i]
        Sides of pairs left apart, since joining them would make a one-sided surface.
    """
    key, forward = undirected(corners.F)
    order = np.argsort(key, kind="stable")
    first, size = _runs(key[order])
    of_crowded = order[np.repeat(size > 2, size)]
    # pairs that belong together without a choice, and what it costs to join them
    firm = order[first[size == 2][:, None] + [0, 1]]
    given = undirected(corners.given)[0]
    cost = np.where(given[firm[:, 0]] == given[firm[:, 1]], 0.0, _APART)
    by_given = of_crowded[np.argsort(given[of_crowded], kind="stable")]
    begins, length = _runs(given[by_given])
    shared = by_given[begins[length == 2][:, None] + [0, 1]]
    firm = np.vstack([firm, shared])
    cost = np.append(cost, np.zeros(len(shared)))
    middle = V[corners.F].mean(axis=1)
    cost = (
        cost
        + np.linalg.norm(np.diff(middle[firm // 3], axis=1)[:, 0], axis=1) / np.ptp(V, axis=0).max()
    )
    against = forward[firm[:, 0]] == forward[firm[:, 1]]
    count = len(corners.F)
    flip = turned(firm // 3, against, count, cost)
    apart = against ^ flip[firm[:, 0] // 3] ^ flip[firm[:, 1] // 3]
    pairs = firm[~apart]
    if len(of_crowded):
        free = np.ones(3 * count, dtype=bool)
        free[pairs] = False
        sheet = labels(pairs // 3, count)
        # the same agreement of windings, but with most triangles of every sheet as they are
        flip ^= (2 * np.bincount(sheet, weights=flip) > np.bincount(sheet))[sheet]
        pairs = np.vstack([pairs, matched(V, corners.F, of_crowded[free[of_crowded]], sheet, flip)])
    return pairs, order[first[size > 2]], firm[apart][:, 0]


def cut_apart(
    V: NDArray[np.float64], corners: Corners, first_given: NDArray[np.int64]
) -> tuple[NDArray[np.float64], Corners, list[str]]:
    """Give every sheet vertices of its own where surfaces touch along an edge or at a vertex.

    Parameters
    ----------
    V : [vertex_count, 3]
    first_given : [vertex_count]
        Lowest number under which each vertex was given.

    Returns
    -------
    V, corners
        A manifold, orientable surface. Vertices keep their order, those of a vertex that was cut
        standing together.
    notes : list of str
        What was cut.
    """
    pairs, crowded, one_sided = join_sides(V, corners)
    # the fan of triangles to which each corner belongs: corners are linked over joined sides
    start = corners.F.ravel()
    end = np.roll(corners.F, -1, axis=1).ravel()
    following = np.roll(np.arange(len(start)).reshape(-1, 3), -1, axis=1).ravel()
    (one, two) = pairs.T
    (one_end, two_end) = following[pairs.T]
    same_way = start[one] == start[two]
    ends = np.where(same_way, two, two_end), np.where(same_way, two_end, two)
    fan = labels(np.hstack([(one, ends[0]), (one_end, ends[1])]).T, len(start))
    vertex = np.empty(fan.max() + 1, dtype=np.int64)
    vertex[fan] = start
    whole = np.bincount(vertex, minlength=len(V))[vertex] == 1
    lowest = np.full(len(vertex), corners.given.max() + 1)
    np.minimum.at(lowest, fan, corners.given.ravel())
    order = np.argsort(np.where(whole, first_given[vertex], lowest), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    cut = Corners(rank[fan].reshape(-1, 3), corners.given, corners.uv)
    V, cut = _without_double_edges(V[vertex[order]], cut, pairs)
    notes = []
    if len(crowded):
        notes.append(
            f"cut apart along {counted(len(crowded), 'edge')} where more than two triangles met"
        )
    if len(one_sided):
        notes.append(
            f"cut open along {counted(len(one_sided), 'edge')}: one-sided, like a Moebius band"
        )
    touched = np.append(crowded, one_sided)
    pinched = np.setdiff1d(vertex[~whole], np.append(start[touched], end[touched]))
    if len(pinched):
        notes.append(
            f"cut apart at {counted(len(pinched), 'vertex')} where the surface touched itself"
        )
    return V, cut, notes


def _without_double_edges(
    V: NDArray[np.float64], corners: Corners, pairs: NDArray[np.int64]
) -> tuple[NDArray[np.float64], Corners]:
    """Where two edges have both vertices in common, all but the first get a vertex of their own in between."""
    F = corners.F
    mate = np.arange(F.size)
    mate[pairs[:, 0]] = pairs[:, 1]
    mate[pairs[:, 1]] = pairs[:, 0]
    leader = np.minimum(np.arange(F.size), mate)
    key, forward = undirected(F)
    order = np.lexsort((leader, key))
    lead = leader[order]
    again = order[lead != lead[np.repeat(*_runs(key[order]))]]
    if len(again) == 0:
        return V, corners
    leaders, number = np.unique(leader[again], return_inverse=True)
    point, given = np.full((2, *F.shape), -1)
    point.flat[again] = len(V) + number
    low, high = np.divmod(key[leaders], F.max() + 1)
    between = (1 - _BETWEEN) * V[low] + _BETWEEN * V[high]
    share = np.where(forward, _BETWEEN, 1 - _BETWEEN).reshape(F.shape)
    return np.vstack([V, between]), corners.split(point, given, share)
