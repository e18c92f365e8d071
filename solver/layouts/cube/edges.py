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

from ...texels.chart_map import ChartPieces
from .convention import CHART_NORMALS, CHART_U, CHART_V

# Relative to a triangle: what hangs over an edge by less counts as within, and smaller pieces are left out.
_ROUND_OFF = 1e-12
_MOST = 8  # places for a polygon's corners
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


def _cut(
    corners: NDArray[np.float64], sides: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Cut triangles [k, 3, 3] into their parts in each chart: owner, chart, and barycentrics [pieces, 3, 3]."""
    owner, chart = np.divmod(np.arange(6 * len(corners)), 6)
    # a triangle that is cut by four planes has seven corners at most
    polygons, sizes = np.zeros((len(owner), _MOST, 3)), np.full(len(owner), 3)
    polygons[:, :3] = np.eye(3)
    for s in range(4):
        polygons, sizes = _clip(polygons, sizes, corners[owner], sides[chart, s])
        left = sizes > 0
        owner, chart, polygons, sizes = owner[left], chart[left], polygons[left], sizes[left]
    fan, k = np.nonzero(np.arange(2, _MOST) < sizes[:, None])
    pieces = np.stack([polygons[fan, 0], polygons[fan, k + 1], polygons[fan, k + 2]], axis=1)
    a, b, c = pieces.transpose(1, 2, 0)
    area = a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    real = area > _ROUND_OFF
    return owner[fan[real]], chart[fan[real]], pieces[real]


def _clip(
    polygons: NDArray[np.float64], sizes: NDArray[np.int64], corners: NDArray[np.float64], planes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Keep the parts of convex polygons, [p, 8, 3], on the inner sides of planes (Sutherland and Hodgman 1974)."""
    clipped, count, every = np.zeros_like(polygons), np.zeros_like(sizes), np.arange(len(sizes))
    previous = polygons[every, sizes - 1]
    p = _distance(previous, corners, planes)
    for i in range(sizes.max(initial=0)):
        here, there = polygons[:, i], i < sizes
        q = _distance(here, corners, planes)
        crossing = np.flatnonzero(there & ((p >= 0) != (q >= 0)))
        before, after = p[crossing, None], q[crossing, None]
        # the same to the last bit from whichever side it is looked at
        cuts = (before * here[crossing] - after * previous[crossing]) / (before - after)
        clipped[crossing, count[crossing]] = cuts
        count[crossing] += 1
        inside = np.flatnonzero(there & (q >= 0))
        clipped[inside, count[inside]] = here[inside]
        count[inside] += 1
        previous, p = here, q
    return clipped, count


def _distance(
    weights: NDArray[np.float64], corners: NDArray[np.float64], planes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distance [p] of points in triangles, by barycentrics [p, 3] and corners [p, 3, 3], from planes [p, 3]."""
    x, y, z = planes.T
    a, b, c = (corners[:, i, 0] * x + corners[:, i, 1] * y + corners[:, i, 2] * z for i in range(3))
    return weights[:, 0] * a + weights[:, 1] * b + weights[:, 2] * c
