"""Areas of a mesh that the texels of charts cover: its triangles, cut exactly along texels."""

from __future__ import annotations

import numpy as np

from ..kernel import Floats, Ints, kernel
from ..mesh.mesh import Mesh
from .chart_map import Parts

# Corners of a part of a triangle that a few lines have cut, at most.
MOST_CORNERS = 12


@kernel(no_cpython_wrapper=True)
def clip(
    corners: Floats,
    count: int,
    ox: float,
    oy: float,
    nx: float,
    ny: float,
    axis: int,
    result: Floats,
) -> int:
    """Clip a convex polygon: keep the part on the side n of a line through o.

    After Sutherland and Hodgman 1974. Returns the number of corners of the `result`. A line across
    an axis, 0 or 1 (else -1), is met to the last bit.
    """
    kept = 0
    for i in range(count):
        j = (i + 1) % count
        a = nx * (corners[i, 0] - ox) + ny * (corners[i, 1] - oy)
        b = nx * (corners[j, 0] - ox) + ny * (corners[j, 1] - oy)
        if a >= 0.0:
            for k in range(corners.shape[1]):  # slices would take ten times as long to compile
                result[kept, k] = corners[i, k]
            kept += 1
        if (a > 0.0 and b < 0.0) or (a < 0.0 and b > 0.0):
            # from the same end for both triangles at an edge
            t = a / (a - b)
            for k in range(corners.shape[1]):
                result[kept, k] = (1.0 - t) * corners[i, k] + t * corners[j, k]
            if axis >= 0:
                result[kept, axis] = oy if axis else ox
            kept += 1
    return kept


def texel_areas(mesh: Mesh, parts: Parts, corners: Floats, lines: Floats, charts: int) -> Floats:
    """Area of a mesh that each texel of some charts covers [m^2], [C, n, n].

    The triangles are cut exactly.

    Parameters
    ----------
    mesh : Mesh
    parts : Parts
        Parts of its triangles, with the chart in which each part lies, [p].
    corners : float64 [p, 3, 3]
        x w, y w and w > 0 of the parts' corners, where x and y are places on the chart; linear in
        each triangle.
    lines : float64 [n + 1]
        Where texels end, along x and along y.
    charts : int
        C.
    """
    triangle, barycentrics, chart = parts
    # barycentrics over w are linear in x and y
    polygons = np.concatenate([corners[..., :2], barycentrics], axis=2) / corners[..., 2:]
    n = len(lines) - 1
    low = polygons[..., :2].min(axis=1)
    high = polygons[..., :2].max(axis=1)
    first = np.searchsorted(lines, low, side="right").clip(1, n) - 1
    last = np.maximum(np.searchsorted(lines, high, side="left").clip(1, n) - 1, first)
    areas = np.zeros((charts, n, n))
    _add_areas(
        polygons, mesh.triangle_areas[triangle], chart.astype(np.int64), first, last, lines, areas
    )
    return areas


@kernel
def _add_areas(
    polygons: Floats,
    triangles: Floats,
    chart: Ints,
    first: Ints,
    last: Ints,
    lines: Floats,
    areas: Floats,
) -> None:
    """Cut parts [p, 3, 5] of triangles along lines, and add the area of each cell to its texel.

    `triangles` [p] are the areas of the triangles [m^2]. `first` and `last` [p, 2] are the columns
    and rows of texels into which a part reaches.
    """
    rest = np.empty((MOST_CORNERS, 5))
    strip = np.empty((MOST_CORNERS, 5))
    cell = np.empty((MOST_CORNERS, 5))
    spare = np.empty((MOST_CORNERS, 5))
    for p in range(len(chart)):
        wide = 3
        for k in range(wide):
            for m in range(5):
                rest[k, m] = polygons[p, k, m]
        for i in range(first[p, 0], last[p, 0] + 1):
            high = wide
            if i == last[p, 0]:
                rest, strip = strip, rest
            else:
                high = clip(rest, wide, lines[i + 1], 0.0, -1.0, 0.0, 0, strip)
                wide = clip(rest, wide, lines[i + 1], 0.0, 1.0, 0.0, 0, spare)
                rest, spare = spare, rest
            if high < 3:
                continue
            bottom = top = strip[0, 1]
            for k in range(1, high):
                bottom = min(bottom, strip[k, 1])
                top = max(top, strip[k, 1])
            for j in range(first[p, 1], last[p, 1] + 1):
                if j < last[p, 1] and lines[j + 1] <= bottom:
                    continue
                if j == last[p, 1] or lines[j + 1] >= top:
                    areas[chart[p], j, i] += triangles[p] * _share(strip, high)
                    break
                corners = clip(strip, high, 0.0, lines[j + 1], 0.0, -1.0, 1, cell)
                high = clip(strip, high, 0.0, lines[j + 1], 0.0, 1.0, 1, spare)
                strip, spare = spare, strip
                areas[chart[p], j, i] += triangles[p] * _share(cell, corners)


@kernel(no_cpython_wrapper=True)
def _share(corners: Floats, count: int) -> float:
    """Area of a polygon over the area of its triangle.

    Its corners have barycentric coordinates up to a factor.
    """
    share = 0.0
    ux = 0.0
    uy = 0.0
    total = corners[0, 2] + corners[0, 3] + corners[0, 4]
    x = corners[0, 2] / total
    y = corners[0, 3] / total
    for i in range(1, count):
        total = corners[i, 2] + corners[i, 3] + corners[i, 4]
        vx = corners[i, 2] / total - x
        vy = corners[i, 3] / total - y
        share += ux * vy - uy * vx
        ux = vx
        uy = vy
    return share
