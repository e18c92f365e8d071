"""Which layout a closed mesh of genus 0 gets where none is named: the cube on round bodies, patches on limbed ones.

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

# Times as long as wide: the longest texels with which the cube layout is as exact as patches.
LONGEST_TEXEL = 7.0

# Share of the area whose texels may be longer. A limb of less than this has too few texels round it
# for any layout, and single slivers of a CAD mesh say nothing about its limbs.
_NEGLIGIBLE = 0.005


def texel_length(mesh: Mesh, sphere: Floats) -> float:
    """How many times as long as wide texels of the cube layout are, at most, on all but a negligible share of the area.

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
    return float(lengths[order[np.searchsorted(covered, (1 - _NEGLIGIBLE) * covered[-1])]])


def elongation(corners: Floats, places: Floats) -> Floats:
    """How many times as long as wide square texels become on triangles [m], by the ellipse that a circle becomes.

    `corners` [m, 3, 3] are those of the triangles [m], and `places` [m, 3, 2] where these lie on a
    chart. The ratio of the singular values s1 >= s2 of the map between them follows from (s1^2 +
    s2^2) / 2 s1 s2, which cotangents give. A triangle without area has 1.
    """
    ab, ac, bc = _sides(corners)
    uv, uw, vw = _sides(places)
    real = np.sqrt(_square(cross(ab, ac)))
    flat = np.abs(uv[0] * uw[1] - uv[1] * uw[0])
    # the cotangent of each corner times `real`, and the square of the side opposite to it on the
    # chart
    stretched = dot(ab, ac) * _square(vw) - dot(ab, bc) * _square(uw) + dot(ac, bc) * _square(uv)
    areas = 2 * real * flat
    sound = areas > np.finfo(np.float64).tiny
    ratio = np.maximum(np.divide(stretched, areas, out=np.ones_like(areas), where=sound), 1.0)
    return ratio + np.sqrt(ratio * ratio - 1)


def _sides(corners: Floats) -> tuple[Vector, Vector, Vector]:
    """Sides of triangles from the first corner to the second, to the third, and from the second to the third."""
    a, b, c = np.pad(corners, ((0, 0), (0, 0), (0, 3 - corners.shape[-1]))).transpose(1, 2, 0)
    return subtract(b, a), subtract(c, a), subtract(c, b)


def _square(vector: Vector) -> Floats:
    return dot(vector, vector)
