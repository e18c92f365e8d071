"""What special cells add where their corners lie: one compiled loop for all cells of a kind."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..kernel import Floats, Ints, kernel
from .cells import quad, quad_area, strip, triangle
from .polygon_cell import polygon


class Added(NamedTuple):
    """What cells add: geometric weights of their links [k, l], shares of the area [k, j] and areas [k] [m^2]."""

    links: Floats
    shares: Floats
    areas: Floats


@kernel
def fill_quads(places: Floats, corners: Ints, added: Added) -> None:
    """Whole quads: six links, and a quarter of the area each."""
    for i in range(len(corners)):
        a, b, c, d = _quad(places, corners[i])
        south, north, west, east, rising, falling, area = quad(a, b, c, d)
        links = added.links[i]
        links[0], links[1], links[2], links[3], links[4], links[5] = south, north, west, east, rising, falling
        added.shares[i] = area / 4
        added.areas[i] = area


@kernel
def fill_areas(places: Floats, corners: Ints, added: Added) -> None:
    """Quads without links."""
    for i in range(len(corners)):
        a, b, c, d = _quad(places, corners[i])
        area = quad_area(a, b, c, d)
        added.shares[i] = area / 4
        added.areas[i] = area


@kernel
def fill_strips(places: Floats, corners: Ints, added: Added) -> None:
    """Strips: the link of their first two corners."""
    for i in range(len(corners)):
        a, b, c, d = _quad(places, corners[i])
        added.links[i, 0] = strip(a, b, c, d)
        added.areas[i] = quad_area(a, b, c, d)


@kernel
def fill_triangles(places: Floats, corners: Ints, added: Added) -> None:
    """Triangles, as their first corner's chart sees them: two links, and its share."""
    for i in range(len(corners)):
        a, b, c = _at(places, corners[i, 0]), _at(places, corners[i, 1]), _at(places, corners[i, 2])
        _, added.links[i, 0], added.links[i, 1], area = triangle(a, b, c)
        added.shares[i, 0] = area / 3
        added.areas[i] = area


@kernel
def fill_polygons(places: Floats, corners: Ints, added: Added) -> None:
    """Polygons: the links between all pairs of corners."""
    count = corners.shape[1]
    points = np.empty((count, 3))
    for i in range(len(corners)):
        for j in range(count):
            for k in range(3):
                points[j, k] = places[k, corners[i, j]]
        weights, shares = polygon(points)
        link = 0
        for a in range(count):
            for b in range(a + 1, count):
                added.links[i, link] = weights[a, b]
                link += 1
        added.shares[i] = shares
        added.areas[i] = shares.sum()


@kernel
def _at(places: Floats, i: int) -> tuple[float, float, float]:
    """A place among coordinates [3, p]."""
    return places[0, i], places[1, i], places[2, i]


@kernel
def _quad(places: Floats, corners: Ints) -> tuple[Any, Any, Any, Any]:
    """The four corners of a quad."""
    return _at(places, corners[0]), _at(places, corners[1]), _at(places, corners[2]), _at(places, corners[3])
