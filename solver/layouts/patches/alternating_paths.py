"""Alternating paths through triangles that are joined in pairs, and what a pairing costs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Bools, Floats, Ints, kernel

FEWEST = 3  # quads round a middle
_TOO_FEW = 100.0  # what each costs that is missing
_EXTRA = 2.0  # what one costs by which there are too many or too few, beyond the first


class Pairing(NamedTuple):
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


class BestPath(NamedTuple):
    """The best path yet."""

    cost: Floats  # [1]
    length: Ints  # [1]
    path: Ints  # joints that are closed


@kernel
def search(pairing: Pairing, node: int, most: int, path: Ints, best: BestPath) -> bool:
    """Look for the best path from a triangle that is left to another one; whether there is any."""
    best.cost[0], best.length[0] = np.inf, 0
    pairing.passed[node] = True
    _search_all(pairing, node, path[:most], best)
    pairing.passed[node] = False
    return best.length[0] > 0


@kernel
def _search_all(pairing: Pairing, node: int, path: Ints, best: BestPath) -> None:
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
def _undo(pairing: Pairing, e: int, node: int, beyond: int) -> None:
    """Go back from a triangle to the one from which the search came over an open joint and a closed one."""
    other = pairing.ends[e, 0] + pairing.ends[e, 1] - node
    _change(pairing, e, 1)
    _change(pairing, pairing.closed[other], -1)
    pairing.passed[other] = pairing.passed[beyond] = False


@kernel
def follow(pairing: Pairing, node: int, best: BestPath) -> None:
    """Close the joints of the best path, and open those between."""
    for i in range(best.length[0]):
        e = best.path[i]
        other = pairing.ends[e, 0] + pairing.ends[e, 1] - node
        f = pairing.closed[other]
        if f >= 0:
            node = pairing.ends[f, 0] + pairing.ends[f, 1] - other
            open_joint(pairing, f)
        close_joint(pairing, e)


@kernel
def close_joint(pairing: Pairing, e: int) -> float:
    """Join the triangles at a joint; return what that costs."""
    pairing.closed[pairing.ends[e, 0]] = pairing.closed[pairing.ends[e, 1]] = e
    return _change(pairing, e, -1)


@kernel
def open_joint(pairing: Pairing, e: int) -> float:
    """Part the triangles at a joint; return what that costs."""
    pairing.closed[pairing.ends[e, 0]] = pairing.closed[pairing.ends[e, 1]] = -1
    return _change(pairing, e, 1)


@kernel
def _change(pairing: Pairing, e: int, quads: int) -> float:
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
    return off + _EXTRA * max(off - 1.0, 0.0) + _TOO_FEW * max(FEWEST - quads, 0)
