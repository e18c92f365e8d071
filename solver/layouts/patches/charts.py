"""Square charts: one for each corner of a cell, from its middle to the middles of its sides.

Cells are laid out as regular polygons and cut; the corners in which three of them meet are then
moved to the middle between their middles. Sides and corners of charts are numbered as in
`texels.topology`. Corner 0 of a chart lies in the middle of its cell, corner 2 in the corner of the
cell, 1 and 3 in the middles of the cell's sides before and behind that corner.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from ...errors import AtlasError
from ...kernel import Bools, Floats, Ints
from ...mesh.topology import labels
from .cells import BorderedCells
from .disks import Border, along, flattened
from .surface import Flat, TriangleSurface, central_vertices, cut_ray, halved_chords

# The vertices along a line on a surface.
Path = Ints

# The two halves of each arc of a part's border.
Halves = list[tuple[Path, Path]]

# The four sides of a chart, counter-clockwise, from corner 0 to corner 1 and so on.
Sides = tuple[Path, Path, Path, Path]

# The charts round each of some corners.
Fans = list[list[int]]

# column and row of a chart's corners, counter-clockwise
CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def corner_charts(cells: BorderedCells) -> tuple[TriangleSurface, Ints, list[Sides]]:
    """Cut a chart for each corner of each cell.

    Returns the finer surface, the chart of each triangle, and the sides of all charts.
    """
    surface = cells.surface
    # an arc of a single edge gets a vertex in its middle, where it can be cut in half
    single_edges = []
    for cell_arcs in cells.arcs:
        single_edges += [arc for arc in cell_arcs if len(arc) == 2]
    single = np.array(single_edges).reshape(-1, 2)
    key = [len(surface.V), 1]
    chosen = np.isin(surface.edges.ends @ key, np.sort(single, axis=1) @ key)
    finer, middles, origin, _ = surface.subdivided(np.where(chosen, 0.5, np.nan))
    chosen_ends = map(tuple, surface.edges.ends[chosen].tolist())
    middle_of_edge = dict(zip(chosen_ends, middles[chosen].tolist(), strict=True))
    arcs: list[list[Path]] = []
    for cell_arcs in cells.arcs:
        arcs.append([])
        for arc in cell_arcs:
            if len(arc) == 2:
                arc = np.insert(arc, 1, middle_of_edge[min(arc), max(arc)])
            arcs[-1].append(arc)
    cell = cells.cell[origin]
    # no edge joins two points of a border, so that every cell has an inner vertex
    split, origin = halved_chords(finer, cell, on_paths(finer, arcs))
    halves: list[Halves] = []
    for cell_arcs in arcs:
        halves.append([halves_of(split.V, arc) for arc in cell_arcs])
    surface, sides = cut_polygons(split, cell[origin], halves)
    return surface, charts_of(surface, sides), sides


def halves_of(V: Floats, arc: Path) -> tuple[Path, Path]:
    """Cut an arc in two at the vertex nearest to its middle.

    The arc is cut at the same vertex if it is given the other way round.
    """
    flipped = arc[0] > arc[-1] or (arc[0] == arc[-1] and arc[1] > arc[-2])
    way = arc[::-1] if flipped else arc
    middle = 1 + int(np.abs(along(V, [way])[1:-1] - 0.5).argmin())
    first = way[: middle + 1]
    second = way[middle:]
    return (second[::-1], first[::-1]) if flipped else (first, second)


def cut_polygons(
    surface: TriangleSurface, part: Ints, halves: list[Halves]
) -> tuple[TriangleSurface, list[Sides]]:
    """Lay out the first parts as regular polygons and cut them from their middles into charts.

    Only the parts that have `halves` are cut. Returns the finer surface and the sides of the
    charts.
    """
    on_border = on_paths(surface, list(itertools.chain.from_iterable(halves)))
    chosen = part < len(halves)
    places = np.full((len(part), 3, 2), np.nan)
    some = TriangleSurface(
        surface.V, surface.F[chosen], surface.parent[chosen], surface.inside[chosen]
    )
    places[chosen] = flattened(some, part[chosen], _polygon_border(surface, halves))
    centre = central_vertices(Flat(some, part[chosen], places[chosen]), on_border)
    count = int(part.max()) + 1
    flat = Flat(surface, part, places)
    paths: list[list[Path]] = [[] for _ in halves]
    for i in range(max(map(len, halves))):
        start = np.full(count, -1)
        end = np.full(count, -1)
        for number, arcs in enumerate(halves):
            if len(arcs) > i:
                start[number] = centre[number]
                end[number] = arcs[i][0][-1]  # the middle of the arc
        border = np.pad(on_border, (0, len(flat.surface.V) - len(on_border)))
        flat, lines = cut_ray(flat, start, end, border)
        for path, line in zip(paths, lines, strict=False):
            if len(line):
                path.append(line)
    # a chart lies at each corner of each part, its sides counter-clockwise
    sides: list[Sides] = []
    for arcs, rays in zip(halves, paths, strict=True):
        for i in range(len(arcs)):
            sides.append((rays[i - 1], arcs[i - 1][1], arcs[i][0], rays[i][::-1]))
    return flat.surface, sides


def _polygon_border(surface: TriangleSurface, halves: list[Halves]) -> Border:
    """Cells as regular polygons: corners on the unit circle, arcs along the sides."""
    paths = []
    cells = []
    ends = []
    for cell, arcs in enumerate(halves):
        tips = np.exp(2j * np.pi * np.arange(len(arcs) + 1) / len(arcs))
        middles = (tips[:-1] + tips[1:]) / 2
        for i, (first, second) in enumerate(arcs):
            paths += [first, second]
            cells += [cell, cell]
            ends += [(tips[i], middles[i]), (middles[i], tips[i + 1])]
    lengths = [len(path) for path in paths]
    a, b = np.repeat(np.array(ends), lengths, axis=0).T
    z = a + (b - a) * along(surface.V, paths)
    return np.repeat(cells, lengths), np.concatenate(paths), np.stack([z.real, z.imag], axis=1)


def charts_of(surface: TriangleSurface, sides: list[Sides]) -> Ints:
    """The chart of each triangle: those not parted by a side of a chart hang together."""
    vertex_count = len(surface.V)
    paths = itertools.chain.from_iterable(sides)
    walls = np.concatenate([np.stack([path[:-1], path[1:]], axis=1) for path in paths])
    key = [vertex_count, 1]
    is_wall = np.isin(surface.edges.ends @ key, np.sort(walls, axis=1) @ key)
    part = labels(surface.edges.sides[~is_wall] // 3, len(surface.F))
    number = int(part.max()) + 1
    if number != len(sides):
        raise AtlasError(
            f"{len(sides)} charts came out as {number}: triangles of the surface are too thin"
        )
    # the triangle on the inner side of the first edge of a chart's second side
    side_keys = (surface.F * vertex_count + np.roll(surface.F, -1, axis=1)).ravel()
    order = np.argsort(side_keys)
    wanted = np.array([second[0] * vertex_count + second[1] for _, second, _, _ in sides])
    owner = order[np.searchsorted(side_keys, wanted, sorter=order)] // 3
    chart = np.full(number, -1)
    chart[part[owner]] = np.arange(len(sides))
    return chart[part]


def square_border(surface: TriangleSurface, sides: list[Sides]) -> Border:
    """Charts as squares."""
    paths = list(itertools.chain.from_iterable(sides))
    lengths = [len(path) for path in paths]
    side = np.repeat(np.arange(len(paths)), lengths)
    a = CORNERS[side % 4]
    b = CORNERS[(side + 1) % 4]
    return side // 4, np.concatenate(paths), a + (b - a) * along(surface.V, paths)[:, None]


def on_paths(surface: TriangleSurface, sides: Sequence[Sequence[Path]]) -> Bools:
    """Vertices that lie on a path, such as a side of a chart, [n]."""
    on_path = np.zeros(len(surface.V), bool)
    on_path[np.concatenate(list(itertools.chain.from_iterable(sides)))] = True
    return on_path


def glued_sides(sides: list[Sides]) -> Ints:
    """Chart and side beyond each side of each chart [C, 4, 2]; -1 at a rim.

    Two charts have their common side in opposite directions: it ends with the edge with which the
    other chart's side begins.
    """
    table = np.full((len(sides), 4, 2), -1)
    by_first_edge: dict[tuple[int, int], tuple[int, int]] = {}
    for chart, chart_sides in enumerate(sides):
        for side, path in enumerate(chart_sides):
            by_first_edge[int(path[0]), int(path[1])] = chart, side
    for chart, chart_sides in enumerate(sides):
        for side, path in enumerate(chart_sides):
            beyond = by_first_edge.get((int(path[-1]), int(path[-2])))
            if beyond is not None:
                table[chart, side] = beyond
    return table


def fans_of(sides: list[Sides], glued: Ints) -> tuple[Fans, list[int]]:
    """Charts round corners where three cells meet, counter-clockwise, and all other charts."""
    fans: Fans = []
    used = np.zeros(len(sides), bool)
    for a in range(len(sides)):
        b = int(glued[a, 1, 0])
        c = int(glued[b, 1, 0]) if b >= 0 else -1
        if not used[a] and c >= 0 and glued[c, 1, 0] == a and len({a, b, c}) == 3:
            fans.append([a, b, c])
            used[[a, b, c]] = True
    return fans, np.flatnonzero(~used).tolist()


def with_even_corners(
    surface: TriangleSurface, chart: Ints, sides: list[Sides]
) -> tuple[TriangleSurface, list[Sides]]:
    """Move the corners where three cells meet to the middle between the cells' middles.

    Voronoi cells often have very short sides, along which texels would be tiny. So the three charts
    round a corner, a triangle between three cells' middles, are joined and cut anew as the cells
    were.
    """
    glued = glued_sides(sides)
    fans, rest = fans_of(sides, glued)
    if not fans:
        return surface, sides
    part = np.empty(len(sides), np.int64)
    for number, fan in enumerate([*fans, *([each] for each in rest)]):
        part[fan] = number
    inner = part < len(fans)
    halves: list[Halves] = []
    for fan in fans:
        halves.append([])
        for a, b in zip(fan, [*fan[1:], fan[0]], strict=True):
            first = sides[a][0]
            second = sides[b][3]
            # else the middle stays, as the charts beyond do
            if inner[glued[a, 0, 0]] and inner[glued[b, 3, 0]]:
                first, second = halves_of(surface.V, np.concatenate([first, second[1:]]))
            halves[-1].append((first, second))
    split, origin = halved_chords(surface, part[chart], on_paths(surface, sides))
    finer, new = cut_polygons(split, part[chart[origin]], halves)
    return finer, [*new, *(sides[each] for each in rest)]
