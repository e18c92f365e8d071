"""Chooses the layout of a closed mesh of genus 0: the cube if it is round, patches if it has limbs.

A sphere map has to draw a limb out of the round. At the distance l from the tip of a limb of radius
r, a map that keeps areas makes texels 2 l / r times as long as wide, and none can avoid it. The
cube's grid meets this direction at every angle. At 45 degrees the lines of texels that are a times
as long as wide cross at 2 atan(1 / a): at 16 degrees for a = 7. With such needles the operator is
inexact, and not of second order any more.

The sphere map alone tells how long texels are going to be. Of 44 meshes, round and limbed, those up
to the limit have eigenvalues as exact in the cube layout as on patches: the worst of 20 has 0.7 to
1.6 times the error, with 64 texels along a chart. Above 8 the cube layout has 8 times the error
(median; up to 136). Between 6.6 and 8.0 there was a single mesh, on which both are the same.
"""

from __future__ import annotations

import numpy as np

from ..kernel import Floats
from ..mesh.mesh import Mesh
from ..mesh.vectors import Vector, cross, dot, subtract
from .cube.convention import chart_uv, split_at_edges

# Length over width of the longest texels with which the cube layout is as exact as patches.
LONGEST_TEXEL = 7.0

# Share of the area whose texels may be longer. A limb of less than this has too few texels round it
# for any layout, and single slivers of a CAD mesh say nothing about its limbs.
_NEGLIGIBLE_AREA = 0.005


def texel_length(mesh: Mesh, sphere: Floats) -> float:
    """Length over width of the longest texels of the cube layout.

    Texels on a negligible share of the area are left out.

    `sphere` [vertex_count, 3] is the sphere map.
    """
    directions = sphere[mesh.F]
    triangle, barycentrics, chart = split_at_edges(directions)
    corners = barycentrics @ mesh.V[mesh.F[triangle]]
    places = chart_uv(barycentrics @ directions[triangle], chart)
    lengths = elongation(corners, places)
    areas = mesh.triangle_areas[triangle] * np.abs(np.linalg.det(barycentrics))
    order = np.argsort(lengths, kind="stable")
    covered = np.cumsum(areas[order])
    # the shortest length that all but the negligible share of the area keeps below
    quantile = np.searchsorted(covered, (1 - _NEGLIGIBLE_AREA) * covered[-1])
    return float(lengths[order[quantile]])


def elongation(corners: Floats, places: Floats) -> Floats:
    """Length over width of square texels mapped to triangles; a circle becomes an ellipse.

    `corners` [m, 3, 3] are the corners of the triangles [m], and `places` [m, 3, 2] their places on
    a chart. The ratio of the singular values s1 >= s2 of the map between them follows from (s1^2 +
    s2^2) / 2 s1 s2, which cotangents give. A triangle without area has 1.
    """
    ab, ac, bc = _sides(corners)
    uv, uw, vw = _sides(places)
    real = np.sqrt(_square(cross(ab, ac)))
    flat = np.abs(uv[0] * uw[1] - uv[1] * uw[0])
    # sum over the corners: the cotangent times `real`, times the square of the opposite side on the
    # chart
    stretched = dot(ab, ac) * _square(vw) - dot(ab, bc) * _square(uw) + dot(ac, bc) * _square(uv)
    areas = 2 * real * flat
    has_area = areas > np.finfo(np.float64).tiny
    mean = np.divide(stretched, areas, out=np.ones_like(areas), where=has_area)
    mean = np.maximum(mean, 1.0)  # (s1 / s2 + s2 / s1) / 2
    return mean + np.sqrt(mean * mean - 1)


def _sides(corners: Floats) -> tuple[Vector, Vector, Vector]:
    """Sides of triangles: from corner 0 to corner 1, from 0 to 2, and from 1 to 2."""
    a, b, c = np.pad(corners, ((0, 0), (0, 0), (0, 3 - corners.shape[-1]))).transpose(1, 2, 0)
    return subtract(b, a), subtract(c, a), subtract(c, b)


def _square(vector: Vector) -> Floats:
    return dot(vector, vector)
