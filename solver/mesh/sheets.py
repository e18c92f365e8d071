"""Cuts surfaces apart where they touch themselves, so that they become manifold.

The sides of triangles that lie on one edge are joined two by two. Where more than two sides meet,
this decides which sheet goes on in which other one.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .clean import Corners, counted
from .topology import labels, turned, undirected

# Sides on one edge up to which every pair of them is weighed. Of more sides only neighbours round
# the edge are paired.
_MAX_SIDES_ALL_PAIRED = 12

# Cost of joining two sides that do not share their vertices in the user's arrays, in units of the
# mesh's size: the last choice when windings are made to agree.
_COST_OF_OTHER_VERTICES = 1e6

# Place of a vertex that is put into an edge, from 0 at the edge's lower vertex to 1 at the other.
# Not the middle, where another vertex may lie already.
_SPLIT_PLACE = 0.382

# Weight of the bend [1/rad] that decides between two pairs which are bent alike, inwards and
# outwards.
_CONVEX_WEIGHT = 1e-6


def matched(
    V: NDArray[np.float64],
    F: NDArray[np.int64],
    sides: NDArray[np.int64],
    sheet: NDArray[np.int64],
    flip: NDArray[np.bool_],
) -> NDArray[np.int64]:
    """Join sides of crowded edges two by two, the best pairs first.

    No pair is joined that would make the surface one-sided.

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
    edge, forward = undirected(F)
    forward = forward ^ np.repeat(flip, 3)
    sides = sides[np.argsort(edge[sides], kind="stable")]
    angle = _angles(V, F, sides, edge[sides])
    order = np.lexsort((angle, edge[sides]))
    first, second = _candidates(edge[sides])
    first = order[first]
    second = order[second]
    first_side = sides[first]
    second_side = sides[second]
    windings_differ = forward[first_side] == forward[second_side]
    sheets_differ = sheet[first_side // 3] != sheet[second_side // 3]
    # the inside is towards smaller angles at a side that runs forward, else towards larger ones
    difference = angle[first] - angle[second]
    turn = np.where(forward[first_side], difference, -difference)
    inner_angle = turn % (2 * np.pi)
    # 0 where the surface continues straight, 1 where one triangle lies on the other
    bend = np.abs(np.pi - inner_angle) / np.pi
    # of two equal bends the convex one is better: bodies that touch along an edge stay two
    cost = bend + _CONVEX_WEIGHT * inner_angle + sheets_differ + 2.0 * windings_differ
    best = np.argsort(cost, kind="stable")
    pairs = np.stack([first_side, second_side], axis=1)
    return _greedy_pairs(pairs[best], windings_differ[best], sheet)


def _angles(
    V: NDArray[np.float64], F: NDArray[np.int64], sides: NDArray[np.int64], key: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Angles at which triangles lie round their common edge [rad], from 0 at the first one.

    The edge points at the viewer. Sides are sorted by `key`, the number of their edge.
    """
    triangle = sides // 3
    k = sides % 3
    a = F[triangle, k]
    b = F[triangle, (k + 1) % 3]
    axis = V[np.maximum(a, b)] - V[np.minimum(a, b)]
    axis = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), np.finfo(float).tiny)
    # from the edge to the third corner, at right angles to the edge
    across = V[F[triangle, (k + 2) % 3]] - V[a]
    across = across - np.einsum("ij,ij->i", across, axis)[:, None] * axis
    begin, size = _runs(key)
    first = across[np.repeat(begin, size)]
    turn = np.einsum("ij,ij->i", np.cross(first, across), axis)
    return np.arctan2(turn, np.einsum("ij,ij->i", first, across)) % (2 * np.pi)


def _candidates(key: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of places in a sorted list that have the same key.

    Of a few places with one key all pairs, of many places only neighbours in turn.
    """
    starts, sizes = _runs(key)
    first = [np.empty(0, dtype=np.int64)]
    second = [np.empty(0, dtype=np.int64)]
    for size in np.unique(sizes[sizes > 1]).tolist():
        if size <= _MAX_SIDES_ALL_PAIRED:
            i, j = np.triu_indices(size, 1)
        else:
            i = np.arange(size)
            j = np.roll(i, -1)
        base = starts[sizes == size][:, None]
        first.append((base + i).ravel())
        second.append((base + j).ravel())
    return np.concatenate(first), np.concatenate(second)


def _runs(ordered: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where each run of equal numbers in a sorted list begins, and how long it is."""
    begins = np.flatnonzero(np.append(True, ordered[1:] != ordered[:-1]))
    return begins, np.diff(np.append(begins, len(ordered)))


class _OrientedSheets:
    """Sheets that are joined to each other: a union-find structure that knows their windings."""

    def __init__(self, count: int) -> None:
        self._parent = list(range(count))
        self._turned = [False] * count  # wound against the parent
        self._size = [1] * count

    def join(self, first: int, second: int, windings_differ: bool) -> bool:
        """Join two sheets; False if that would make the surface one-sided."""
        first_root, first_turned = self._root(first)
        second_root, second_turned = self._root(second)
        turn = windings_differ ^ first_turned ^ second_turned
        if first_root == second_root:
            return not turn
        if self._size[first_root] < self._size[second_root]:
            small = first_root
            large = second_root
        else:
            small = second_root
            large = first_root
        self._parent[small] = large
        self._turned[small] = turn
        self._size[large] += self._size[small]
        return True

    def _root(self, sheet: int) -> tuple[int, bool]:
        """The root of a sheet, and whether the sheet is wound against it."""
        turned = False
        while self._parent[sheet] != sheet:
            turned ^= self._turned[sheet]
            sheet = self._parent[sheet]
        return sheet, turned


def _greedy_pairs(
    pairs: NDArray[np.int64], windings_differ: NDArray[np.bool_], sheet: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Pairs of sides, taken in order, whose sides are free and whose sheets can still be joined."""
    sheets = _OrientedSheets(int(sheet.max()) + 1)
    paired_sides: set[int] = set()
    chosen = []
    sheet_pairs = sheet[pairs // 3].tolist()
    for (first, second), (first_sheet, second_sheet), differ in zip(
        pairs.tolist(), sheet_pairs, windings_differ.tolist(), strict=True
    ):
        if first in paired_sides or second in paired_sides:
            continue
        if sheets.join(first_sheet, second_sheet, differ):
            paired_sides |= {first, second}
            chosen.append((first, second))
    return np.array(chosen, dtype=np.int64).reshape(-1, 2)


def join_sides(
    V: NDArray[np.float64], corners: Corners
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Join the sides that lie on one edge, two by two, to an orientable surface.

    Two sides alone on an edge belong together. On a crowded edge, with more than two sides, pairs
    of sides with the same two vertices in the user's arrays are joined first. Then other pairs are
    joined, best first: their windings agree, they belong to one sheet already, and the surface
    bends little between them. Sides that stay single become rims. A one-sided surface is left open
    along a path.

    Returns
    -------
    pairs : int64 [k, 2]
        Sides that are joined, numbered 3 x triangle + side. All other sides are rims.
    crowded : int64 [j]
        One side of every crowded edge.
    one_sided : int64 [i]
        Sides that are not joined, since joining them would make a one-sided surface.
    """
    edge, forward = undirected(corners.F)
    order = np.argsort(edge, kind="stable")
    first, size = _runs(edge[order])
    crowded_sides = order[np.repeat(size > 2, size)]
    # pairs that belong together without a choice
    alone = order[first[size == 2][:, None] + [0, 1]]
    user_edge = undirected(corners.user_vertex)[0]
    user_pairs = _alone_on_edge(crowded_sides, user_edge)
    sure = np.vstack([alone, user_pairs])
    # the cost of joining each of them: when windings cannot all agree, expensive pairs stay apart
    has_user_edge = user_edge[alone[:, 0]] == user_edge[alone[:, 1]]
    cost_of_vertices = np.append(
        np.where(has_user_edge, 0.0, _COST_OF_OTHER_VERTICES), np.zeros(len(user_pairs))
    )
    middle = V[corners.F].mean(axis=1)
    distance = np.linalg.norm(np.diff(middle[sure // 3], axis=1)[:, 0], axis=1)
    cost = cost_of_vertices + distance / np.ptp(V, axis=0).max()
    against = forward[sure[:, 0]] == forward[sure[:, 1]]
    triangle_count = len(corners.F)
    flip = turned(sure // 3, against, triangle_count, cost)
    stays_apart = against ^ flip[sure[:, 0] // 3] ^ flip[sure[:, 1] // 3]
    pairs = sure[~stays_apart]
    if len(crowded_sides):
        free = np.ones(3 * triangle_count, dtype=bool)
        free[pairs] = False
        sheet = labels(pairs // 3, triangle_count)
        # windings agree as before, but most triangles of every sheet stay as they are
        mostly_flipped = 2 * np.bincount(sheet, weights=flip) > np.bincount(sheet)
        flip ^= mostly_flipped[sheet]
        free_sides = crowded_sides[free[crowded_sides]]
        pairs = np.vstack([pairs, matched(V, corners.F, free_sides, sheet, flip)])
    return pairs, order[first[size > 2]], sure[stays_apart][:, 0]


def _alone_on_edge(sides: NDArray[np.int64], edge: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pairs [k, 2] of the sides [j] that are alone with each other on an edge.

    `edge` [3 triangle_count] is the number of the edge of every side.
    """
    by_edge = sides[np.argsort(edge[sides], kind="stable")]
    begins, length = _runs(edge[by_edge])
    return by_edge[begins[length == 2][:, None] + [0, 1]]


def cut_apart(
    V: NDArray[np.float64], corners: Corners, first_user_vertex: NDArray[np.int64]
) -> tuple[NDArray[np.float64], Corners, list[str]]:
    """Give every sheet vertices of its own where surfaces touch along an edge or at a vertex.

    Parameters
    ----------
    V : [vertex_count, 3]
    first_user_vertex : [vertex_count]
        Lowest number of each vertex in the user's arrays.

    Returns
    -------
    V, corners
        A manifold, orientable surface. Vertices keep their order; the copies of a vertex that was
        cut stand together.
    notes : list of str
        What was cut.
    """
    pairs, crowded, one_sided = join_sides(V, corners)
    start = corners.F.ravel()
    end = np.roll(corners.F, -1, axis=1).ravel()
    # every fan gets a vertex of its own
    fan = _fans(corners.F, pairs)
    vertex = np.empty(fan.max() + 1, dtype=np.int64)
    vertex[fan] = start
    is_uncut = np.bincount(vertex, minlength=len(V))[vertex] == 1
    lowest_in_fan = np.full(len(vertex), corners.user_vertex.max() + 1)
    np.minimum.at(lowest_in_fan, fan, corners.user_vertex.ravel())
    user_vertex = np.where(is_uncut, first_user_vertex[vertex], lowest_in_fan)
    order = np.argsort(user_vertex, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    cut = dataclasses.replace(corners, F=rank[fan].reshape(-1, 3))
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
    cut_sides = np.append(crowded, one_sided)
    on_cut_edges = np.append(start[cut_sides], end[cut_sides])
    pinched = np.setdiff1d(vertex[~is_uncut], on_cut_edges)
    if len(pinched):
        notes.append(
            f"cut apart at {counted(len(pinched), 'vertex')} where the surface touched itself"
        )
    return V, cut, notes


def _fans(F: NDArray[np.int64], pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """The fan of triangles of each corner [3 m]; joined sides link corners.

    `pairs` [k, 2] are the joined sides, numbered 3 x triangle + side.
    """
    start = F.ravel()
    next_corner = np.roll(np.arange(len(start)).reshape(-1, 3), -1, axis=1).ravel()
    first, second = pairs.T
    first_end, second_end = next_corner[pairs.T]
    same_way = start[first] == start[second]
    meets_first = np.where(same_way, second, second_end)
    meets_first_end = np.where(same_way, second_end, second)
    links = np.hstack([(first, meets_first), (first_end, meets_first_end)]).T
    return labels(links, len(start))


def _without_double_edges(
    V: NDArray[np.float64], corners: Corners, pairs: NDArray[np.int64]
) -> tuple[NDArray[np.float64], Corners]:
    """Give edges that share both vertices a vertex of their own in between, all but the first."""
    F = corners.F
    mate = np.arange(F.size)
    mate[pairs[:, 0]] = pairs[:, 1]
    mate[pairs[:, 1]] = pairs[:, 0]
    # the lower one of an edge's two sides stands for the edge
    leader = np.minimum(np.arange(F.size), mate)
    key, forward = undirected(F)
    order = np.lexsort((leader, key))
    leader_in_order = leader[order]
    begin, size = _runs(key[order])
    doubled = order[leader_in_order != leader_in_order[np.repeat(begin, size)]]
    if len(doubled) == 0:
        return V, corners
    leaders, number = np.unique(leader[doubled], return_inverse=True)
    point = np.full(F.shape, -1)
    user_vertex = np.full(F.shape, -1)
    point.flat[doubled] = len(V) + number
    low, high = np.divmod(key[leaders], F.max() + 1)
    between = (1 - _SPLIT_PLACE) * V[low] + _SPLIT_PLACE * V[high]
    share = np.where(forward, _SPLIT_PLACE, 1 - _SPLIT_PLACE).reshape(F.shape)
    return np.vstack([V, between]), corners.split(point, user_vertex, share)
