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

from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel

_FEWEST, _TOO_FEW = 3, 100.0  # quads round a middle, and what each costs that is missing
_EXTRA = 2.0  # what one costs by which there are too many or too few, beyond the first
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


class _Pairing(NamedTuple):
    """Triangles, and a node beyond all rims where their number is odd, with the joints that are closed."""

    start: Ints  # [t + 1], where the joints of each begin
    joint: Ints  # by triangle
    ends: Ints  # [k, 2], triangles on either side of each joint
    middles: Ints  # [k, 2], cells of which a closed joint takes a quad each; -1: none
    cost: Floats  # [k], of a closed joint
    closed: Ints  # [t], joint; -1
    quads: Ints  # [cells], round each middle
    wanted: Floats  # [cells]
    passed: Bools  # [t], by the path that is tried


class _Best(NamedTuple):
    """The best path yet."""

    cost: Floats  # [1]
    length: Ints  # [1]
    path: Ints  # joints that are closed


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
    pairing = _Pairing(
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
    if not _paired(pairing) or pairing.quads.min() < _FEWEST:
        return None
    return kept[np.unique(pairing.closed)]


@kernel
def _paired(pairing: _Pairing) -> bool:
    """Find a pairing and make it better; whether no triangle is left."""
    best = _Best(np.zeros(1), np.zeros(1, np.int64), np.zeros(_LONGER, np.int64))
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
def _improve(pairing: _Pairing, e: int, path: Ints, best: _Best) -> bool:
    """Close an open joint, and pair what that leaves; whether that is better."""
    a, b = pairing.ends[e]
    f, g = pairing.closed[a], pairing.closed[b]
    cost = _open(pairing, f) + _open(pairing, g) + _close(pairing, e)
    left = pairing.ends[f, 0] + pairing.ends[f, 1] - a
    pairing.passed[a] = pairing.passed[b] = True
    found = _search_from(pairing, left, _LONGEST, path, best)
    pairing.passed[a] = pairing.passed[b] = False
    if found and cost + best.cost[0] < -_WORTH:
        _follow(pairing, left, best)
        return True
    _open(pairing, e)
    _close(pairing, f)
    _close(pairing, g)
    return False


@kernel
def _augment(pairing: _Pairing, node: int, most: int, path: Ints, best: _Best) -> None:
    """Pair a triangle, and another one that is left, along the best path between them."""
    if _search_from(pairing, node, most, path, best):
        _follow(pairing, node, best)


@kernel
def _search_from(pairing: _Pairing, node: int, most: int, path: Ints, best: _Best) -> bool:
    best.cost[0], best.length[0] = np.inf, 0
    pairing.passed[node] = True
    _search(pairing, node, path[:most], best)
    pairing.passed[node] = False
    return best.length[0] > 0


@kernel
def _search(pairing: _Pairing, node: int, path: Ints, best: _Best) -> None:
    """Try all alternating paths from a triangle that is left to another one, depth first."""
    nodes, following, cost = np.empty_like(path), np.empty_like(path), np.zeros(len(path))
    nodes[0], following[0], length = node, pairing.start[node], 0
    while length >= 0:
        if following[length] == pairing.start[nodes[length] + 1]:
            length -= 1
            if length >= 0:
                _undo(pairing, path[length], nodes[length], nodes[length + 1])
            continue
        e = pairing.joint[following[length]]
        following[length] += 1
        other = pairing.ends[e, 0] + pairing.ends[e, 1] - nodes[length]
        if pairing.passed[other]:
            continue
        f = pairing.closed[other]
        path[length] = e
        if f < 0:
            total = cost[length] + _change(pairing, e, -1)
            _change(pairing, e, 1)
            if total < best.cost[0]:
                best.cost[0], best.length[0] = total, length + 1
                best.path[: length + 1] = path[: length + 1]
        elif length + 1 < len(path):
            beyond = pairing.ends[f, 0] + pairing.ends[f, 1] - other
            pairing.passed[other] = pairing.passed[beyond] = True
            cost[length + 1] = cost[length] + _change(pairing, f, 1) + _change(pairing, e, -1)
            length += 1
            nodes[length], following[length] = beyond, pairing.start[beyond]


@kernel
def _undo(pairing: _Pairing, e: int, node: int, beyond: int) -> None:
    """Go back from a triangle to the one from which the search came over an open joint and a closed one."""
    other = pairing.ends[e, 0] + pairing.ends[e, 1] - node
    _change(pairing, e, 1)
    _change(pairing, pairing.closed[other], -1)
    pairing.passed[other] = pairing.passed[beyond] = False


@kernel
def _follow(pairing: _Pairing, node: int, best: _Best) -> None:
    """Close the joints of the best path, and open those between."""
    for i in range(best.length[0]):
        e = best.path[i]
        other = pairing.ends[e, 0] + pairing.ends[e, 1] - node
        f = pairing.closed[other]
        if f >= 0:
            node = pairing.ends[f, 0] + pairing.ends[f, 1] - other
            _open(pairing, f)
        _close(pairing, e)


@kernel
def _close(pairing: _Pairing, e: int) -> float:
    pairing.closed[pairing.ends[e, 0]] = pairing.closed[pairing.ends[e, 1]] = e
    return _change(pairing, e, -1)


@kernel
def _open(pairing: _Pairing, e: int) -> float:
    pairing.closed[pairing.ends[e, 0]] = pairing.closed[pairing.ends[e, 1]] = -1
    return _change(pairing, e, 1)


@kernel
def _change(pairing: _Pairing, e: int, quads: int) -> float:
    """Quads more or fewer round the middles at a joint; return what that costs."""
    cost = -quads * pairing.cost[e]
    for k in range(2):
        v = pairing.middles[e, k]
        if v >= 0:
            cost -= _strain(pairing.quads[v], pairing.wanted[v])
            pairing.quads[v] += quads
            cost += _strain(pairing.quads[v], pairing.wanted[v])
    return cost


@kernel
def _strain(quads: int, wanted: float) -> float:
    """What it costs that so many quads meet round a middle."""
    off = abs(quads - wanted)
    return off + _EXTRA * max(off - 1.0, 0.0) + _TOO_FEW * max(_FEWEST - quads, 0)
