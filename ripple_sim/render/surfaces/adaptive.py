"""Adaptive tessellation: for each frame, triangles are split at the edges from which the waves depart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.kernel import Bools, Floats, Floats32, Ints32, kernel
from ripple_sim.solver.texels.texel_atlas import ChartPage

from .spline_heights import spline_heights, spline_samples
from .tessellation import Edges


class AdaptiveTessellation:
    """Splits the edges of a mesh at their midpoints where a height map bends too much between their ends.

    Whether an edge is split depends only on its length and the heights at its ends and midpoint, so that the triangles
    on both sides of it agree, across seams and creases, too: no gap opens.

    Parameters
    ----------
    F : array, shape [m, 3]
        Triangles.
    edges : Edges
        Of the triangles, k of them.
    positions : array, shape [n + k, 3]
        Of the vertices, followed by the edges' midpoints [m].
    places : array, shape [n + k, 2]
        Where the height map is looked up, on the page of charts [texels].
    page : ChartPage
    tolerance : float
        How far the height at a midpoint may differ from the mean of those at the ends [m].
    min_length : float
        Shorter edges stay whole [m].

    Attributes
    ----------
    base_count : int
        Number n of vertices, without midpoints.
    faces, sides : int32 [m, 3]
        Triangles, and their edges.
    length : float64 [k]
        Of the edges [m].
    long : int32 [l]
        Edges that may be split.
    ends : int32 [l, 2]
        Lookups of their ends; those of their midpoints are the last l.
    texel, offset : int32 and float32, [..., 3] and [..., 2]
        Of each lookup: chart, row and column of the first of the 3 x 3 texels about it, in a chart with its halo, and
        how far it is off their centre, in rows and columns.
    """

    def __init__(
        self,
        F: NDArray,
        edges: Edges,
        positions: NDArray,
        places: NDArray,
        page: ChartPage,
        tolerance: float,
        min_length: float,
    ) -> None:
        self.base_count = len(positions) - len(edges.ends)
        self.faces, self.sides = np.asarray(F, np.int32), np.asarray(edges.of_side, np.int32)
        self.length = np.linalg.norm(positions[edges.ends[:, 1]] - positions[edges.ends[:, 0]], axis=1)
        self.tolerance = np.float32(tolerance)
        # heights are looked up at the ends of the edges that may be split, and then at these edges' midpoints
        self.long = np.flatnonzero(self.length >= min_length).astype(np.int32)
        ends, index = np.unique(edges.ends[self.long], return_inverse=True)
        self.ends = index.reshape(-1, 2).astype(np.int32)
        self.texel, self.offset = spline_samples(page, places[np.concatenate([ends, self.base_count + self.long])])

    def __call__(self, height_map: NDArray[np.float32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangles [t, 3] for a height map [C, n + 2, n + 2, 4], and the midpoints [s], as vertices, that they use.

        Where no edge is split, the triangles are the same array each time.
        """
        whole = self.faces, np.empty(0, np.int32)
        if not len(self.long) or not height_map[..., 3].any():
            return whole
        split = self.long[_departing(spline_heights(height_map, self.texel, self.offset), self.ends, self.tolerance)]
        if not len(split):
            return whole
        midpoint = np.full(len(self.length), -1, np.int32)
        midpoint[split] = used = np.int32(self.base_count) + split
        return _triangles(self.faces, self.sides, midpoint, self.length), used


@kernel
def _departing(height: Floats32, ends: Ints32, tolerance: np.float32) -> Bools:
    """Which edges' midpoints, the last k of the heights, are off the mean of their ends [k, 2]."""
    departing = np.empty(len(ends), np.bool_)
    first = len(height) - len(ends)
    for i in range(len(ends)):
        mean = np.float32(0.5) * (height[ends[i, 0]] + height[ends[i, 1]])
        departing[i] = abs(height[first + i] - mean) > tolerance
    return departing


@kernel
def _triangles(faces: Ints32, sides: Ints32, midpoint: Ints32, length: Floats) -> Ints32:
    """Cut every triangle [m, 3] into 1 to 4 by the midpoints of its sides [m, 3], -1: none; lengths are the edges'."""
    triangles = np.empty((4 * len(faces), 3), np.int32)
    count = 0
    for face in range(len(faces)):
        splits = 0
        for k in range(3):
            splits += midpoint[sides[face, k]] >= 0
        # turn the triangle so that its only split side, or its only whole one, is side 0
        first = 0
        if splits == 1 or splits == 2:
            while (midpoint[sides[face, first]] >= 0) != (splits == 1):
                first += 1
        second, third = (first + 1) % 3, (first + 2) % 3
        a, b, c = faces[face, first], faces[face, second], faces[face, third]
        ab, bc, ca = sides[face, first], sides[face, second], sides[face, third]
        m, n, o = midpoint[ab], midpoint[bc], midpoint[ca]
        if splits == 0:
            triangles[count] = a, b, c
        elif splits == 1:
            triangles[count] = a, m, c
            triangles[count + 1] = m, b, c
        elif splits == 2:
            triangles[count] = o, n, c
            # the median to the longer side is the shorter diagonal of the rest
            if length[bc] >= length[ca]:
                triangles[count + 1] = a, b, n
                triangles[count + 2] = a, n, o
            else:
                triangles[count + 1] = a, b, o
                triangles[count + 2] = b, n, o
        else:
            triangles[count] = a, m, o
            triangles[count + 1] = b, n, m
            triangles[count + 2] = c, o, n
            triangles[count + 3] = m, n, o
        count += splits + 1
    return triangles[:count]
