"""Where texels lie on a surface: the triangles of a seamless map, drawn on the charts as on a screen."""

from __future__ import annotations

import numpy as np

from ...errors import AtlasError
from ...kernel import Bools, Floats, Ints, kernel
from .frames import turned
from .seamless import FIXED, SeamlessMap, Transitions, corner_place, transitions
from .wander import follow

_ROUND_OFF = 1e-7  # barycentric coordinates of a texel outside of all triangles may be so far below 0
_REACH = 2  # of triangles, in charts beyond that in which they begin


def locate_texels(seamless: SeamlessMap, n: int) -> tuple[Ints, Floats]:
    """Triangle [C, n, n] of each of the n x n texels of a chart, and barycentric coordinates in it, [C, n, n, 3].

    Raises
    ------
    AtlasError
        If a texel lies in no triangle, which a map without a fold rules out.
    """
    triangles, barycentrics = locate_in_charts(seamless, n, np.arange(len(seamless.glued)))
    missed = int((triangles < 0).sum())
    if missed:
        raise AtlasError(f"{missed} texels lie in no triangle of the map onto the charts")
    return triangles, barycentrics


def locate_in_charts(seamless: SeamlessMap, n: int, charts: Ints) -> tuple[Ints, Floats]:
    """The same in some charts [k] alone; -1 where a triangle may be missed that reaches far over other charts."""
    number = np.full(len(seamless.glued), -1)
    number[charts] = np.arange(len(charts))
    near, beside = number >= 0, seamless.glued[..., 0]
    for _ in range(_REACH):
        near |= (near[beside] & (beside >= 0)).any(axis=1)
    triangles, barycentrics = np.full((len(charts), n, n), -1), np.zeros((len(charts), n, n, 3))
    best = np.full((len(charts), n, n), -np.inf)
    _draw(seamless, transitions(seamless.glued), n, number, near, triangles, barycentrics, best)
    triangles[best < -_ROUND_OFF] = -1
    return triangles, barycentrics


@kernel
def corners_in_frame_of(seamless: SeamlessMap, f: int, k: int, places: Floats) -> None:
    """Fill in the places [3, 2] of a triangle's corners in the frame of the chart in which corner k lies."""
    back = (4 - seamless.turn[f, k]) % 4
    sx, sy = seamless.shift[f, k, 0], seamless.shift[f, k, 1]
    for j in range(3):
        x, y = corner_place(seamless, f, j)
        places[j, 0], places[j, 1] = turned(x - sx, y - sy, back)


@kernel
def anchor(seamless: SeamlessMap, f: int) -> int:
    """The first corner of a triangle that does not sit on the tip of a cone: it knows in which chart it lies."""
    k = 0
    while seamless.freedom[seamless.F[f, k]] == FIXED and k < 2:
        k += 1
    return k


@kernel
def _draw(
    seamless: SeamlessMap,
    across: Transitions,
    n: int,
    number: Ints,
    near: Bools,
    triangles: Ints,
    barycentrics: Floats,
    best: Floats,
) -> None:
    p = np.empty((3, 2))
    slack = 1e-9
    for f in range(len(seamless.F)):
        k = anchor(seamless, f)
        home = seamless.chart[seamless.F[f, k]]
        if not near[home]:
            continue
        corners_in_frame_of(seamless, f, k, p)
        ux, uy, vx, vy = p[1, 0] - p[0, 0], p[1, 1] - p[0, 1], p[2, 0] - p[0, 0], p[2, 1] - p[0, 1]
        area = ux * vy - uy * vx
        first = int(np.ceil((min(p[0, 1], p[1, 1], p[2, 1]) - slack) * n - 0.5))
        last = int(np.floor((max(p[0, 1], p[1, 1], p[2, 1]) + slack) * n - 0.5))
        left = int(np.ceil((min(p[0, 0], p[1, 0], p[2, 0]) - slack) * n - 0.5))
        right = int(np.floor((max(p[0, 0], p[1, 0], p[2, 0]) + slack) * n - 0.5))
        for i in range(first, last + 1):
            y = (i + 0.5) / n
            for j in range(left, right + 1):
                x = (j + 0.5) / n
                s = ((x - p[0, 0]) * vy - (y - p[0, 1]) * vx) / area
                t = (ux * (y - p[0, 1]) - uy * (x - p[0, 0])) / area
                least = min(s, t, 1 - s - t)
                if least < -1e-6:
                    continue
                found, _, _, _, u, v = follow(home, p[k, 0], p[k, 1], x, y, seamless.glued, across)
                chart, row, column = number[found], int(np.floor(v * n)), int(np.floor(u * n))
                if chart < 0 or not (0 <= row < n and 0 <= column < n) or least <= best[chart, row, column]:
                    continue
                best[chart, row, column] = least
                triangles[chart, row, column] = f
                barycentrics[chart, row, column, 0] = 1 - s - t
                barycentrics[chart, row, column, 1] = s
                barycentrics[chart, row, column, 2] = t
