"""Square charts: one for each corner of a polygon, from its middle to the middles of its sides.

Sides and corners of charts are numbered as in `texels.topology`. Corner 0 of a chart lies in the middle of its cell,
corner 2 in the corner of the cell, 1 and 3 in the middles of the cell's sides before and behind that corner.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...errors import AtlasError
from .flatten import Border, along
from .polygons import Halves, Path
from .surface import Surface

# column and row of a chart's corners, counter-clockwise
CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])

Sides = tuple[Path, Path, Path, Path]
Fans = list[list[int]]  # charts round a corner


def chart_sides(halves: list[Halves], paths: list[list[Path]]) -> list[Sides]:
    """The four sides of each chart, counter-clockwise; a chart lies at each corner of each part."""
    sides = []
    for arcs, rays in zip(halves, paths, strict=True):
        for i in range(len(arcs)):
            sides.append((rays[i - 1], arcs[i - 1][1], arcs[i][0], rays[i][::-1]))
    return sides


def charts_of(surface: Surface, sides: list[Sides]) -> tuple[Surface, NDArray[np.int64]]:
    """The chart of each triangle: those not parted by a side of a chart hang together."""
    size = len(surface.V)
    walls = np.concatenate([np.stack([path[:-1], path[1:]], axis=1) for each in sides for path in each])
    wall = np.isin(surface.edges.ends @ [size, 1], np.sort(walls, axis=1) @ [size, 1])
    beside = surface.edges.sides[~wall] // 3
    links = coo_array((np.ones(len(beside)), tuple(beside.T)), shape=(len(surface.F),) * 2)
    number, part = connected_components(links, directed=False)
    if number != len(sides):
        raise AtlasError(f"{len(sides)} charts came out as {number}: triangles of the surface are too thin")
    # the triangle on the inner side of the first edge of a chart's second side
    triangle, k = np.divmod(surface.edges.sides.ravel(), 3)
    tail, head = surface.F[triangle, k], surface.F[triangle, (k + 1) % 3]
    key = np.where(surface.edges.sides.ravel() >= 0, tail * size + head, -1)
    order = np.argsort(key)
    wanted = np.array([each[1][0] * size + each[1][1] for each in sides])
    owner = triangle[order[np.searchsorted(key[order], wanted)]]
    chart = np.full(number, -1)
    chart[part[owner]] = np.arange(len(sides))
    return surface, chart[part]


def square_border(surface: Surface, sides: list[Sides]) -> Border:
    """Charts as squares."""
    paths = [path for each in sides for path in each]
    lengths = [len(path) for path in paths]
    side = np.repeat(np.arange(len(paths)), lengths)
    a, b = CORNERS[side % 4], CORNERS[(side + 1) % 4]
    return Border(side // 4, np.concatenate(paths), a + (b - a) * along(surface.V, paths)[:, None])


def on_paths(surface: Surface, sides: list[Sides]) -> NDArray[np.bool_]:
    """Vertices that lie on a side of a chart, [n]."""
    on_path = np.zeros(len(surface.V), bool)
    on_path[np.concatenate([path for each in sides for path in each])] = True
    return on_path


def glued_sides(sides: list[Sides]) -> NDArray[np.int64]:
    """Charts that share a side have its first edge the other way round."""
    table = np.full((len(sides), 4, 2), -1)
    seen = {(int(path[0]), int(path[1])): (chart, s) for chart, each in enumerate(sides) for s, path in enumerate(each)}
    for chart, each in enumerate(sides):
        for s, path in enumerate(each):
            other = seen.get((int(path[-1]), int(path[-2])))
            if other is not None:
                table[chart, s] = other
    return table


def fans_of(sides: list[Sides], glued: NDArray[np.int64]) -> tuple[Fans, list[int]]:
    """The three charts round each corner where three cells meet, counter-clockwise, and all other charts."""
    fans: Fans = []
    used = np.zeros(len(sides), bool)
    for a in range(len(sides)):
        b = int(glued[a, 1, 0])
        c = int(glued[b, 1, 0]) if b >= 0 else -1
        if not used[a] and c >= 0 and glued[c, 1, 0] == a and len({a, b, c}) == 3:
            fans.append([a, b, c])
            used[[a, b, c]] = True
    return fans, np.flatnonzero(~used).tolist()
