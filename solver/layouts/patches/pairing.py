"""Which triangles between cells' middles are joined in pairs to quads.

Where as many quads meet round a cell's middle as its curvature asks for, the map onto the charts is strained least. By
Gauss and Bonnet a cone where v quads meet has the curvature (4 - v) pi / 2; so v should be 4 less the curvature of the
cell in right angles.

Any pairing follows from another by alternating paths: joints are closed and opened in turn (Berge 1957). All short ones
are tried, until none makes the pairing better.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import Ints, kernel
from .alternating_paths import FEWEST, BestPath, Pairing, close_joint, follow, open_joint, search

_SHAPE = 0.5  # what the logarithm of the ratio of a quad's diagonals costs, squared
_LONGEST, _LONGER = 11, 16  # joints that a path closes, at most; where else triangles would be left
_MOST_PASSES = 20
_WORTH = 1e-6


class Joints(NamedTuple):
    """Sides between triangles, over which these may be joined.

    Attributes
    ----------
    triangles : int64 [k, 2]
        On either side; -1 where there lies none, and where the triangle may stay alone.
    middles : int64 [k, 2]
        Cells at the ends.
    shape : float64 [k]
        Logarithm of the ratio of the diagonals of the quad.
    """

    triangles: NDArray[np.int64]
    middles: NDArray[np.int64]
    shape: NDArray[np.float64]


def chosen_joints(
    joints: Joints, triangle_count: int, corners: NDArray[np.int64], wanted: NDArray[np.float64]
) -> NDArray[np.int64] | None:
    """The joints, one of each triangle, that leave about as many quads at each cell's middle as are wanted.

    Parameters
    ----------
    joints : Joints
    triangle_count : int
    corners : int64 [cells]
        How many meet round each cell's middle before any are joined.
    wanted : float64 [cells]
        How many should.

    Returns
    -------
    int64 [l] or None
        At most one with a triangle that stays alone; None if no way is found with three quads round every middle.
    """
    kept = np.flatnonzero((joints.triangles[:, 1] >= 0) | (triangle_count % 2 == 1))
    ends = joints.triangles[kept]
    inner = ends[:, 1] >= 0
    nodes = triangle_count + triangle_count % 2
    ends = np.where(ends < 0, triangle_count, ends)
    order = np.argsort(ends.T.ravel(), kind="stable")
    pairing = Pairing(
        np.searchsorted(ends.T.ravel()[order], np.arange(nodes + 1)),
        order % max(len(kept), 1),
        ends,
        np.where(inner[:, None], joints.middles[kept], -1),
        np.where(inner, _SHAPE * joints.shape[kept] ** 2, 0.0),
        np.full(nodes, -1),
        corners.copy(),
        wanted,
        np.zeros(nodes, bool),
    )
    if not nodes:
        return kept[:0]
    if not _paired(pairing) or pairing.quads.min() < FEWEST:
        return None
    return kept[np.unique(pairing.closed)]


@kernel
def _paired(pairing: Pairing) -> bool:
    """Find a pairing and make it better; whether no triangle is left."""
    best = BestPath(np.zeros(1), np.zeros(1, np.int64), np.zeros(_LONGER, np.int64))
    path = np.zeros(_LONGER, np.int64)
    for most in (1, _LONGEST, _LONGER):
        for node in range(len(pairing.closed)):
            if pairing.closed[node] < 0:
                _augment(pairing, node, most, path, best)
    if (pairing.closed < 0).any():
        return False
    for _ in range(_MOST_PASSES):
        better = False
        for e in range(len(pairing.ends)):
            if pairing.closed[pairing.ends[e, 0]] != e:
                better = _improve(pairing, e, path, best) or better
        if not better:
            break
    return True


@kernel
def _improve(pairing: Pairing, e: int, path: Ints, best: BestPath) -> bool:
    """Close an open joint, and pair what that leaves; whether that is better."""
    a, b = pairing.ends[e]
    f, g = pairing.closed[a], pairing.closed[b]
    cost = open_joint(pairing, f) + open_joint(pairing, g) + close_joint(pairing, e)
    left = pairing.ends[f, 0] + pairing.ends[f, 1] - a
    pairing.passed[a] = pairing.passed[b] = True
    found = search(pairing, left, _LONGEST, path, best)
    pairing.passed[a] = pairing.passed[b] = False
    if found and cost + best.cost[0] < -_WORTH:
        follow(pairing, left, best)
        return True
    open_joint(pairing, e)
    close_joint(pairing, f)
    close_joint(pairing, g)
    return False


@kernel
def _augment(pairing: Pairing, node: int, most: int, path: Ints, best: BestPath) -> None:
    """Pair a triangle, and another one that is left, along the best path between them."""
    if search(pairing, node, most, path, best):
        follow(pairing, node, best)
