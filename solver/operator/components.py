"""The parts of a surface that float freely: each has a mean height of its own that nothing pulls back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from ..texels.links import EAST, NORTH, link_exists
from ..texels.stencil import Stencil
from ..texels.stiffness_matrix import stiffness_matrix
from ..texels.topology import TexelTopology


class Ties(NamedTuple):
    """What joins texels: the links of a stencil; of a texel that bends, with `rigidity` [C, n, n], all neighbours."""

    stencil: Stencil
    rigidity: NDArray[np.float64] | None = None


def floating_parts(
    ties: Sequence[Ties], held: NDArray[np.bool_], movable: NDArray[np.bool_]
) -> NDArray[np.int32] | None:
    """Number of the part to which each texel belongs, [C, n, n]; None where there is one part only.

    Texels belong together where something joins them. Of each of the mesh's own parts, all those that are held count as
    one, however zero wave speeds cut them up: what holds them brings them back to where they were.

    Parameters
    ----------
    ties : sequence of Ties
    held : bool [C, n, n]
        Texels that a spring or a clamp holds.
    movable : bool [C, n, n]
        The others are rigid, and belong to any part.
    """
    topology = ties[0].stencil.topology
    of_chart = _chart_parts(topology)
    if any(_joins_all(tie) for tie in ties):
        charts = of_chart[:, None, None]
        return None if not of_chart.any() else np.ascontiguousarray(np.broadcast_to(charts, topology.shape), np.int32)
    part = connected_components(sum(_graph(tie) for tie in ties), directed=False)[1].astype(np.int64)
    is_held = np.bincount(part, held.reshape(-1)) > 0
    # those that are held bear the number of their part of the mesh, after all others
    of_texel = np.repeat(of_chart, topology.texel_count // len(of_chart))
    part = np.where(is_held[part], part.max() + 1 + of_texel, part)
    moves = movable.reshape(-1)
    names, number = np.unique(part[moves], return_inverse=True)
    if len(names) <= 1:
        return None
    # rigid texels do not break up a chart
    part[:] = -1
    part[moves] = number
    charts = part.reshape(len(of_chart), -1)
    filled = np.where(charts < 0, charts.max(axis=1, keepdims=True).clip(0), charts)
    return filled.astype(np.int32).reshape(topology.shape)


def _chart_parts(topology: TexelTopology) -> NDArray[np.int64]:
    """Part of the mesh to which each chart belongs, [C], from 0."""
    chart, side = np.nonzero(topology.glued[..., 0] >= 0)
    other, count = topology.glued[chart, side, 0], len(topology.glued)
    graph = coo_array((np.ones(len(chart)), (chart, other)), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _joins_all(tie: Ties) -> bool:
    """Whether the sides of all quads are links, so that every part of the mesh is one."""
    stencil, rigidity = tie
    sides = (stencil.weights[:, link][link_exists(stencil.topology, link)] for link in (EAST, NORTH))
    return (rigidity is None or bool((rigidity > 0).all())) and all(side.all() for side in sides)


def _graph(tie: Ties) -> csr_array:
    """Texels that are joined, [C n^2, C n^2]; not symmetric."""
    graph = abs(stiffness_matrix(tie.stencil))
    if tie.rigidity is not None:
        graph = csr_array(graph.multiply((tie.rigidity.reshape(-1, 1) > 0).astype(np.float64)))
    graph.eliminate_zeros()
    return graph
