"""Sides of triangles that lie on the same edge, and which of them are joined."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .corners import Corners
from .sheets import matched
from .topology import undirected
from .winding import labels, turned

# Joining in a way that the vertices as given do not show is the last choice when windings are made to agree.
_APART = 1e6


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
    middle = V[corners.F].mean(axis=1)
    cost = cost + np.linalg.norm(np.diff(middle[firm // 3], axis=1)[:, 0], axis=1) / np.ptp(V, axis=0).max()
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
        sides = edges.order[np.repeat(edges.size > 2, edges.size)]
        pairs = np.vstack([pairs, matched(V, corners.F, sides[free[sides]], sheet, _most_as_given(flip, sheet))])
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
        key, forward = undirected(F)
        order = np.argsort(key, kind="stable")
        ordered = key[order]
        first = np.flatnonzero(np.append(True, ordered[1:] != ordered[:-1]))
        return cls(order, first, np.diff(np.append(first, len(key))), forward)

    def firm(self, given: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Pairs that belong together without a choice, and what it costs to join them."""
        twos = self.first[self.size == 2]
        pairs = self.order[np.stack([twos, twos + 1], axis=1)]
        key, _ = undirected(given)
        together = key[pairs[:, 0]] == key[pairs[:, 1]]
        cost = np.where(together, 0.0, _APART)
        many = self.order[np.repeat(self.size > 2, self.size)]
        if len(many) == 0:
            return pairs, cost
        by_given = many[np.argsort(key[many], kind="stable")]
        ordered = key[by_given]
        first = np.flatnonzero(np.append(True, ordered[1:] != ordered[:-1]))
        first = first[np.diff(np.append(first, len(by_given))) == 2]
        shared = by_given[np.stack([first, first + 1], axis=1)]
        return np.vstack([pairs, shared]), np.append(cost, np.zeros(len(shared)))


def _most_as_given(flip: NDArray[np.bool_], sheet: NDArray[np.int64]) -> NDArray[np.bool_]:
    """The same agreement of windings, but with most triangles of every sheet as they are."""
    size, flipped = np.bincount(sheet), np.bincount(sheet, weights=flip)
    return flip ^ (2 * flipped > size)[sheet]
