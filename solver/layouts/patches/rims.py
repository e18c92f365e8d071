"""The points of a rim beside the texels of charts that end there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...kernel import Floats, Ints, kernel
from ...texels.topology import TexelTopology
from .layout import PatchMap
from .located import corners_in_frame_of
from .seamless import COLUMN, FIXED, SeamlessMap, Transitions, transitions
from .wander import follow


def positions_beyond(patches: PatchMap, topology: TexelTopology, positions: NDArray) -> NDArray[np.float64] | None:
    """Positions with halo [C, n + 2, n + 2, 3] [m]; beyond a rim lies its point opposite to each texel.

    None if there is no rim. At the end of a rim, where that turns, lies its corner.
    """
    if not topology.rim.any():
        return None
    beyond = topology.with_halo(positions)
    beyond[(topology.halo < 0) | topology.rim] = np.nan
    sides = patches.surface.edges.sides[patches.surface.edges.rim, 0]
    seamless = patches.seamless
    _draw_rims(seamless, patches.surface.V, sides, transitions(seamless.glued), beyond)
    n = topology.shape[1]
    for chart, corner in np.argwhere(topology.valence == 0):
        row, column = ((0, 0), (0, n + 1), (n + 1, n + 1), (n + 1, 0))[corner]
        if not topology.rim[chart, row, column]:
            continue
        other, r, c = np.unravel_index(topology.halo[chart, row, column], topology.shape)
        if other != chart:
            out_r, out_c = (0 if x == 0 else n + 1 for x in (r, c))
            along_rows = topology.rim[other, out_r, c + 1]
            beyond[chart, row, column] = beyond[other, out_r, c + 1] if along_rows else beyond[other, r + 1, out_c]
    _place_corners(patches, topology, beyond)
    return beyond


def _place_corners(patches: PatchMap, topology: TexelTopology, beyond: NDArray[np.float64]) -> None:
    """Put the points in which a single chart ends at a rim into the corners of its halo."""
    seamless, surface = patches.seamless, patches.surface
    held = np.zeros(len(surface.V), bool)
    held[surface.edges.ends[surface.edges.rim]] = True
    held &= seamless.freedom == FIXED
    triangle, k = np.nonzero(held[surface.F])
    column, row = seamless.shift[triangle, k].T * (beyond.shape[1] - 1)
    chart = seamless.frame[triangle]
    alone = topology.rim[chart, row, column]
    beyond[chart[alone], row[alone], column[alone]] = surface.V[surface.F[triangle, k]][alone]


@kernel
def _draw_rims(seamless: SeamlessMap, V: Floats, sides: Ints, across: Transitions, beyond: Floats) -> None:
    n = beyond.shape[1] - 2
    p = np.empty((3, 2))
    for h in sides:
        f, k = h // 3, h % 3
        a, b = seamless.F[f, k], seamless.F[f, (k + 1) % 3]
        anchor = k if seamless.freedom[a] != FIXED else (k + 1) % 3
        v = seamless.F[f, anchor]
        corners_in_frame_of(seamless, f, anchor, p)
        axis = 0 if seamless.freedom[v] == COLUMN else 1
        low, high = p[k, axis], p[(k + 1) % 3, axis]
        first = int(np.ceil(min(low, high) * n - 0.5 - 1e-9))
        last = int(np.floor(max(low, high) * n - 0.5 + 1e-9))
        for i in range(first, last + 1):
            along = (i + 0.5) / n
            t = min(max((along - low) / (high - low), 0.0), 1.0)
            qx, qy = (along, p[anchor, 1]) if axis == 0 else (p[anchor, 0], along)
            chart, _, _, _, x, y = follow(seamless.chart[v], p[anchor, 0], p[anchor, 1], qx, qy, seamless.glued, across)
            row, column = int(np.floor(y * n)) + 1, int(np.floor(x * n)) + 1
            if abs(y) < 1e-9:
                row = 0
            elif abs(y - 1) < 1e-9:
                row = n + 1
            elif abs(x) < 1e-9:
                column = 0
            else:
                column = n + 1
            for j in range(3):
                beyond[chart, row, column, j] = (1 - t) * V[a, j] + t * V[b, j]
