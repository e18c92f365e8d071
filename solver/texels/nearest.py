"""The nearest place of a surface in compiled code, for all layouts: contacts ask at every step."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..kernel import Floats, Ints, kernel, variant
from ..mesh.closest import TriangleTree, closest_point


class MeshPlaces(NamedTuple):
    """What is asked for the nearest places of a mesh: its triangles, and the arrays of its chart map."""

    tree: TriangleTree
    charts: Any


@kernel
def nearest_places(surface: Any, points: Floats) -> tuple[Floats, Ints]:
    """Closest surface points [m], [k, 3], and the flat index of the texel nearest to each in the atlas, [k].

    Parameters
    ----------
    surface : NamedTuple
        See `Atlas.places`.
    points : float64 [k, 3]
        [m].
    """
    closest, texels = np.empty((len(points), 3)), np.empty(len(points), np.int64)
    for i in range(len(points)):
        x, y, z, texels[i] = nearest_place(surface, points[i, 0], points[i, 1], points[i, 2])
        closest[i, 0], closest[i, 1], closest[i, 2] = x, y, z
    return closest, texels


def nearest_place(surface: Any, x: float, y: float, z: float) -> tuple[float, float, float, int]:
    """Closest surface point [m] and the texel nearest to it; every kind of surface has a `variant` of this."""
    raise NotImplementedError


def texel_on(charts: Any, triangle: int, x: float, y: float, z: float) -> int:
    """Texel in which a point of a triangle lies [m]; every chart map has a `variant` of this."""
    raise NotImplementedError


@variant(nearest_place, MeshPlaces)
def _nearest_on_mesh(surface: MeshPlaces, x: float, y: float, z: float) -> tuple[float, float, float, int]:
    triangle, x, y, z = closest_point(surface.tree, x, y, z)
    return x, y, z, texel_on(surface.charts, triangle, x, y, z)
