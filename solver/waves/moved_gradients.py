"""Gradients of the height on a surface that has moved, from those on the surface at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Floats32, kernel
from ..texels.atlas import Atlas
from ..texels.halo import fill_halo
from ..texels.riding import SurfaceRide
from .height_map import mirror_at_rim


class MovedGradients:
    """Turns a height map of the surface at rest into that of the moved one.

    Heights stay with the texels, so that their differences along rows and columns stay, while the ways there change.

    Parameters
    ----------
    rest : Atlas
    """

    def __init__(self, rest: Atlas) -> None:
        self._texels, self._ride = rest.texels, SurfaceRide(rest)
        self._rest = _tangents(rest.texels.halo_positions)

    def __call__(self, height_map: NDArray[np.float32], V: NDArray[np.float64]) -> NDArray[np.float32]:
        """Height map [C, n + 2, n + 2, 4], see `HeightMap`, where the vertices are at V [vertex_count, 3] [m]."""
        moved = np.array(height_map, np.float32)
        _carry(self._rest, _tangents(np.moveaxis(self._ride.around(V), 0, -1)), moved)
        fill_halo(self._texels.topology, moved)
        mirror_at_rim(self._texels.topology, moved)
        return moved


def _tangents(around: NDArray[np.float64]) -> NDArray[np.float64]:
    """Differences of positions along rows and columns, [C, n, n, 2, 3], one-sided at a rim without positions."""
    own = around[:, 1:-1, 1:-1]
    beside = (around[:, 1:-1, 2:], around[:, 1:-1, :-2], around[:, 2:, 1:-1], around[:, :-2, 1:-1])
    east, west, north, south = (np.where(np.isfinite(each), each, own) for each in beside)
    return np.stack([east - west, north - south], axis=3)


@kernel
def _carry(rest: Floats, moved: Floats, height_map: Floats32) -> None:
    """Replace gradients: those of the same differences along the moved tangents."""
    charts, n = rest.shape[:2]
    for chart in range(charts):
        for r in range(n):
            for c in range(n):
                g, t, m = height_map[chart, r + 1, c + 1], rest[chart, r, c], moved[chart, r, c]
                a = t[0, 0] * g[0] + t[0, 1] * g[1] + t[0, 2] * g[2]
                b = t[1, 0] * g[0] + t[1, 1] * g[1] + t[1, 2] * g[2]
                uu = m[0, 0] ** 2 + m[0, 1] ** 2 + m[0, 2] ** 2
                vv = m[1, 0] ** 2 + m[1, 1] ** 2 + m[1, 2] ** 2
                uv = m[0, 0] * m[1, 0] + m[0, 1] * m[1, 1] + m[0, 2] * m[1, 2]
                area = max(uu * vv - uv * uv, 1e-6 * uu * vv)
                along, across = (vv * a - uv * b), (uu * b - uv * a)
                for k in range(3):
                    g[k] = (along * m[0, k] + across * m[1, k]) / area if area > 0 else 0.0
