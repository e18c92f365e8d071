"""The edges of the cube: where they cut triangles, and where directions lie in the charts between them.

A triangle that crosses an edge of the cube is cut along it. One coordinate pair a corner cannot do instead: equiangular
coordinates continue smoothly beyond an edge, but there they leave the neighbour's grid (its rows are not the
continuation of this chart's rows), and at 90 degrees from the chart's middle they end: a long triangle has none.
Cut pieces lie in one chart each, with coordinates in [0, 1] that any cube-map texture or array of six layers can be
sampled at: with a halo round each layer the result is continuous everywhere.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.kernel import Floats, Ints, kernel
from ripple_sim.solver.texels.chart_map import ChartPieces

from .convention import CHART_NORMALS, CHART_U, CHART_V

# Relative to a triangle: what hangs over an edge by less counts as within, and smaller pieces are left out.
_ROUND_OFF = 1e-12
# The four planes through the cube's centre that bound each chart's share of space; inwards is positive.
_SIDES = np.stack(
    [CHART_NORMALS - CHART_U, CHART_NORMALS + CHART_U, CHART_NORMALS - CHART_V, CHART_NORMALS + CHART_V], axis=1
).astype(np.float64)


def split_at_edges(corners: NDArray[np.float64]) -> ChartPieces:
    """Cut triangles with the directions [m, 3, 3] at their corners along the edges of the cube."""
    chart = _chart_of(corners.sum(axis=1))
    inside = (np.einsum("mki,msi->mks", corners, _SIDES[chart]) >= -_ROUND_OFF).all(axis=(1, 2))
    whole, crossing = np.flatnonzero(inside), np.flatnonzero(~inside)
    owner, piece_chart, pieces = _cut(corners[crossing], _SIDES)
    triangle = np.concatenate([whole, crossing[owner]])
    order = np.argsort(triangle, kind="stable")
    barycentrics = np.concatenate([np.tile(np.eye(3), (len(whole), 1, 1)), pieces])[order]
    return ChartPieces(triangle[order], barycentrics, np.concatenate([chart[whole], piece_chart])[order])


def chart_uv(directions: NDArray[np.float64], chart: NDArray[np.int64]) -> NDArray[np.float64]:
    """Equiangular place in charts [k], 0 to 1, of directions [k, ..., 3] that belong to them, [k, ..., 2]."""
    depth = np.einsum("p...i,pi->p...", directions, CHART_NORMALS[chart])
    sides = np.einsum("p...i,pij->p...j", directions, np.stack([CHART_U, CHART_V], axis=-1)[chart])
    return np.clip(0.5 + np.arctan(sides / depth[..., None]) * (2 / np.pi), 0.0, 1.0)


def _chart_of(directions: NDArray[np.float64]) -> NDArray[np.int64]:
    axis = np.argmax(np.abs(directions), axis=1)
    return 2 * axis + (np.take_along_axis(directions, axis[:, None], axis=1)[:, 0] < 0)


@kernel
def _cut(corners: Floats, sides: Floats) -> tuple[Ints, Ints, Floats]:
    """Cut triangles [k, 3, 3] into their parts in each chart: owner, chart, and barycentrics [pieces, 3, 3]."""
    # a triangle that is cut by four planes has seven corners at most, which make five pieces
    owner = np.empty(30 * len(corners), np.int64)
    chart = np.empty(30 * len(corners), np.int64)
    pieces = np.empty((30 * len(corners), 3, 3))
    polygon, clipped = np.empty((8, 3)), np.empty((8, 3))
    count = 0
    for t in range(len(corners)):
        for f in range(6):
            for i in range(3):
                for j in range(3):
                    polygon[i, j] = 1.0 if i == j else 0.0
            size = 3
            for s in range(4):
                size = _clip(polygon, size, corners[t], sides[f, s], clipped)
                polygon, clipped = clipped, polygon
            for k in range(2, size):
                a, b, c = polygon[0], polygon[k - 1], polygon[k]
                area = (
                    a[0] * (b[1] * c[2] - b[2] * c[1])
                    + a[1] * (b[2] * c[0] - b[0] * c[2])
                    + a[2] * (b[0] * c[1] - b[1] * c[0])
                )
                if area > _ROUND_OFF:
                    owner[count] = t
                    chart[count] = f
                    for j in range(3):
                        pieces[count, 0, j] = a[j]
                        pieces[count, 1, j] = b[j]
                        pieces[count, 2, j] = c[j]
                    count += 1
    return owner[:count], chart[:count], pieces[:count]


@kernel
def _clip(polygon: Floats, size: int, corners: Floats, plane: Floats, clipped: Floats) -> int:
    """Keep the part of a convex polygon on the inner side of a plane (Sutherland and Hodgman 1974); return its size."""
    count = 0
    previous = polygon[size - 1]
    p = _distance(previous, corners, plane)
    for i in range(size):
        q = _distance(polygon[i], corners, plane)
        if (p >= 0) != (q >= 0):
            for j in range(3):
                # the same to the last bit from whichever side it is looked at
                clipped[count, j] = (p * polygon[i, j] - q * previous[j]) / (p - q)
            count += 1
        if q >= 0:
            for j in range(3):
                clipped[count, j] = polygon[i, j]
            count += 1
        previous, p = polygon[i], q
    return count


@kernel
def _distance(weights: Floats, corners: Floats, plane: Floats) -> float:
    total = 0.0
    for i in range(3):
        total += weights[i] * (corners[i, 0] * plane[0] + corners[i, 1] * plane[1] + corners[i, 2] * plane[2])
    return total
