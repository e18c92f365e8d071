"""Sides of triangles that lie on the same edge, and which of them to join where there are more than two."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
from numpy.typing import NDArray

from .corners import Corners
from .winding import labels, turned

# Joining in a way that the vertices as given do not show is the last choice when windings are made to agree.
_APART = 1e6
# Sides on one edge up to which every pair is weighed; beyond, only neighbours round the edge.
_ALL_PAIRS = 16


@dataclasses.dataclass(frozen=True)
class Joints:
    """Which sides of triangles are joined.

    Attributes
    ----------
    pairs : int64 [k, 2]
        Sides that are joined, numbered 3 x triangle + side. All others are rims.
    crowded : int64 [j]
        One side of every edge on which more than two lie.
    one_sided : int64 [i]
        Sides of pairs left apart, since joining them would make a one-sided surface.
    """

    pairs: NDArray[np.int64]
    crowded: NDArray[np.int64]
    one_sided: NDArray[np.int64]


def join_sides(V: NDArray[np.float64], corners: Corners) -> Joints:
    """Join the sides that lie on the same edge, two by two, to an orientable surface.

    Two alone on an edge belong together. Where more meet, first those are joined that share both vertices as given;
    then, pair by pair, those whose windings agree, that are parts of one sheet already, and between which the surface
    bends least. What remains single becomes a rim. A one-sided surface stays open along a path.
    """
    edges = _Edges.of(corners.F)
    firm, cost = edges.firm(corners.given)
    against = edges.forward[firm[:, 0]] == edges.forward[firm[:, 1]]
    count = len(corners.F)
    flip = turned(firm // 3, against, count, cost)
    apart = against ^ flip[firm[:, 0] // 3] ^ flip[firm[:, 1] // 3]
    pairs = firm[~apart]
    crowded = np.flatnonzero(edges.size > 2)
    if len(crowded):
        free = np.ones(3 * count, dtype=bool)
        free[pairs] = False
        sheet = labels(pairs // 3, count)
        flip = _most_as_given(flip, sheet)
        groups = [group for group in edges.groups(crowded) if free[group].sum() > 1]
        pairs = np.vstack([pairs, _matched(V, corners.F, [g[free[g]] for g in groups], sheet, flip)])
    return Joints(pairs, edges.order[edges.first[crowded]], firm[apart][:, 0])


@dataclasses.dataclass(frozen=True)
class _Edges:
    """Sides sorted by edge: `order[first[e] : first[e] + size[e]]` lie on e; `forward` ones run up in number."""

    order: NDArray[np.int64]
    first: NDArray[np.int64]
    size: NDArray[np.int64]
    forward: NDArray[np.bool_]

    @classmethod
    def of(cls, F: NDArray[np.int64]) -> _Edges:
        key, forward = _undirected(F)
        order = np.argsort(key, kind="stable")
        ordered = key[order]
        first = np.flatnonzero(np.append(True, ordered[1:] != ordered[:-1]))
        return cls(order, first, np.diff(np.append(first, len(key))), forward)

    def groups(self, edges: NDArray[np.int64]) -> list[NDArray[np.int64]]:
        return [self.order[self.first[e] : self.first[e] + self.size[e]] for e in edges]

    def firm(self, given: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Pairs that belong together without a choice, and what they cost as a way from triangle to triangle."""
        twos = self.first[self.size == 2]
        pairs = self.order[np.stack([twos, twos + 1], axis=1)]
        key, _ = _undirected(given)
        together = key[pairs[:, 0]] == key[pairs[:, 1]]
        cost = np.where(together, 1.0, _APART)
        many = self.order[np.repeat(self.size > 2, self.size)]
        if len(many) == 0:
            return pairs, cost
        by_given = many[np.argsort(key[many], kind="stable")]
        ordered = key[by_given]
        first = np.flatnonzero(np.append(True, ordered[1:] != ordered[:-1]))
        first = first[np.diff(np.append(first, len(by_given))) == 2]
        shared = by_given[np.stack([first, first + 1], axis=1)]
        return np.vstack([pairs, shared]), np.append(cost, np.ones(len(shared)))


def _undirected(F: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    a, b = F.ravel(), np.roll(F, -1, axis=1).ravel()
    return np.minimum(a, b) * (F.max() + 1) + np.maximum(a, b), a < b


def _most_as_given(flip: NDArray[np.bool_], sheet: NDArray[np.int64]) -> NDArray[np.bool_]:
    """The same agreement of windings, but with most triangles of every sheet as they are."""
    size, flipped = np.bincount(sheet), np.bincount(sheet, weights=flip)
    return flip ^ (2 * flipped > size)[sheet]


def _matched(
    V: NDArray[np.float64],
    F: NDArray[np.int64],
    groups: list[NDArray[np.int64]],
    sheet: NDArray[np.int64],
    flip: NDArray[np.bool_],
) -> NDArray[np.int64]:
    """Pairs of sides on crowded edges, the best first, none that would make the surface one-sided."""
    candidates = []
    for group in groups:
        angle = _angles(V, F, group)
        order = np.argsort(angle, kind="stable")
        group, angle = group[order], angle[order]
        n = len(group)
        near = itertools.combinations(range(n), 2) if n <= _ALL_PAIRS else ((i, (i + 1) % n) for i in range(n))
        i, j = np.array(list(near)).T
        ends = F.ravel()[group], np.roll(F, -1, axis=1).ravel()[group]
        forward = (ends[0] < ends[1]) ^ flip[group // 3]
        cost = _costs(forward[i], forward[j], angle[i], angle[j]) + (sheet[group[i] // 3] != sheet[group[j] // 3])
        candidates.append(np.column_stack([cost, group[i], group[j], forward[i] == forward[j]]))
    if not candidates:
        return np.empty((0, 2), dtype=np.int64)
    table = np.concatenate(candidates)
    table = table[np.argsort(table[:, 0], kind="stable")]
    return _chosen(table[:, 1:3].astype(np.int64), table[:, 3] > 0, sheet)


def _costs(
    forward: NDArray[np.bool_], other: NDArray[np.bool_], angle: NDArray[np.float64], other_angle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """How badly two sides fit: 0 where they go on straight, 1 where one lies on the other, and 2 for their windings."""
    # a side that runs forward has the inside on the side of smaller angles, the other one on that of larger ones
    inside = np.where(forward, angle - other_angle, other_angle - angle) % (2 * np.pi)
    # of two equal bends the convex one: bodies that touch along an edge stay two
    return np.abs(np.pi - inside) / np.pi + 1e-6 * inside + 2.0 * (forward == other)


def _angles(V: NDArray[np.float64], F: NDArray[np.int64], group: NDArray[np.int64]) -> NDArray[np.float64]:
    """Angles round their common edge at which triangles lie, counted from the first, seen against the edge."""
    triangle, k = group // 3, group % 3
    a, b = sorted((F[triangle[0], k[0]], F[triangle[0], (k[0] + 1) % 3]))
    axis = (V[b] - V[a]) / np.linalg.norm(V[b] - V[a])
    across = V[F[triangle, (k + 2) % 3]] - V[a]
    across = across - np.outer(across @ axis, axis)
    return np.arctan2(np.cross(across[0], across) @ axis, across @ across[0]) % (2 * np.pi)


def _chosen(pairs: NDArray[np.int64], against: NDArray[np.bool_], sheet: NDArray[np.int64]) -> NDArray[np.int64]:
    """The pairs taken one after the other, as long as their sides are free and windings can still be made to agree."""
    parent = list(range(int(sheet.max()) + 1))
    odd = [False] * len(parent)  # turned against the parent

    def root(node: int) -> tuple[int, bool]:
        flip = False
        while parent[node] != node:
            flip ^= odd[node]
            node = parent[node]
        return node, flip

    taken: set[int] = set()
    chosen = []
    sheets = sheet[pairs // 3].tolist()
    for (first, second), (one, two), differ in zip(pairs.tolist(), sheets, against.tolist(), strict=True):
        if first in taken or second in taken:
            continue
        (a, flip_a), (b, flip_b) = root(one), root(two)
        turn = differ ^ flip_a ^ flip_b
        if a == b and turn:
            continue
        if a != b:
            parent[max(a, b)] = min(a, b)
            odd[max(a, b)] = turn
        taken |= {first, second}
        chosen.append((first, second))
    return np.array(chosen, dtype=np.int64).reshape(-1, 2)
