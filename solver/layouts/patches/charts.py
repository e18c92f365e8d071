"""Square charts: one for each corner of a cell, from its middle to the middles of its sides.

Cells are laid out as regular polygons and cut; the corners in which three of them meet are then
moved to the middle between their middles. Sides and corners of charts are numbered as in
`texels.topology`. Corner 0 of a chart lies in the middle of its cell, corner 2 in the corner of the
cell, 1 and 3 in the middles of the cell's sides before and behind that corner.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import AtlasError
from ...kernel import Bools, Floats, Ints
from ...mesh.topology import labels
from .cells import BorderedCells
from .disks import Border, along, flattened
from .surface import Flat, TriangleSurface, central_vertices, cut_ray, halved_chords

Path = Ints
Halves = list[tuple[Path, Path]]  # of each arc of a part's border

# column and row of a chart's corners, counter-clockwise
CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def corner_charts(cells: BorderedCells) -> tuple[TriangleSurface, Ints, list[Sides]]:
    """Cut a chart for each corner of each cell.

    Returns the finer surface, the chart of each triangle, and the sides of all charts.
    """
    surface = cells.surface
    # arcs of a single edge get a vertex in its middle, at which they are cut in half, and all cells
    # inner vertices
    single = np.array([arc for each in cells.arcs for arc in each if len(arc) == 2]).reshape(-1, 2)
    key = [len(surface.V), 1]
    chosen = np.isin(surface.edges.ends @ key, np.sort(single, axis=1) @ key)
    finer, middles, origin, _ = surface.subdivided(np.where(chosen, 0.5, np.nan))
    middle = dict(
        zip(map(tuple, surface.edges.ends[chosen].tolist()), middles[chosen].tolist(), strict=True)
    )
    arcs = [
        [arc if len(arc) > 2 else np.insert(arc, 1, middle[min(arc), max(arc)]) for arc in each]
        for each in cells.arcs
    ]
    cell = cells.cell[origin]
    split, origin = halved_chords(finer, cell, on_paths(finer, arcs))
    surface, sides = cut_polygons(
        split, cell[origin], [[halves_of(split.V, arc) for arc in each] for each in arcs]
    )
    return surface, charts_of(surface, sides), sides


def halves_of(V: Floats, arc: Path) -> tuple[Path, Path]:
    """Cut an arc in two at the vertex nearest to its middle; the same from either side."""
    flipped = arc[0] > arc[-1] or (arc[0] == arc[-1] and arc[1] > arc[-2])
    way = arc[::-1] if flipped else arc
    at = 1 + int(np.abs(along(V, [way])[1:-1] - 0.5).argmin())
    return (way[: at + 1], way[at:]) if not flipped else (way[at:][::-1], way[: at + 1][::-1])


def cut_polygons(
    surface: TriangleSurface, part: Ints, halves: list[Halves]
) -> tuple[TriangleSurface, list[Sides]]:
    """Lay out the first parts as regular polygons and cut them from their middles into charts.

    Returns the finer surface and the sides of the charts.

    Parts beyond those that have a border are left alone.
    """
    on_border = on_paths(surface, [arc for each in halves for arc in each])
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
        for number, each in enumerate(halves):
            if len(each) > i:
                start[number] = centre[number]
                end[number] = each[i][0][-1]
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


Sides = tuple[Path, Path, Path, Path]
Fans = list[list[int]]  # charts round a corner


def charts_of(surface: TriangleSurface, sides: list[Sides]) -> Ints:
    """The chart of each triangle: those not parted by a side of a chart hang together."""
    size = len(surface.V)
    walls = np.concatenate(
        [np.stack([path[:-1], path[1:]], axis=1) for each in sides for path in each]
    )
    wall = np.isin(surface.edges.ends @ [size, 1], np.sort(walls, axis=1) @ [size, 1])
    part = labels(surface.edges.sides[~wall] // 3, len(surface.F))
    number = int(part.max()) + 1
    if number != len(sides):
        raise AtlasError(
            f"{len(sides)} charts came out as {number}: triangles of the surface are too thin"
        )
    # the triangle on the inner side of the first edge of a chart's second side
    key = (surface.F * size + np.roll(surface.F, -1, axis=1)).ravel()
    order = np.argsort(key)
    wanted = np.array([each[1][0] * size + each[1][1] for each in sides])
    owner = order[np.searchsorted(key, wanted, sorter=order)] // 3
    chart = np.full(number, -1)
    chart[part[owner]] = np.arange(len(sides))
    return chart[part]


def square_border(surface: TriangleSurface, sides: list[Sides]) -> Border:
    """Charts as squares."""
    paths = [path for each in sides for path in each]
    lengths = [len(path) for path in paths]
    side = np.repeat(np.arange(len(paths)), lengths)
    a = CORNERS[side % 4]
    b = CORNERS[(side + 1) % 4]
    return side // 4, np.concatenate(paths), a + (b - a) * along(surface.V, paths)[:, None]


def on_paths(surface: TriangleSurface, sides: Sequence[Sequence[Path]]) -> Bools:
    """Vertices that lie on a path, such as a side of a chart, [n]."""
    on_path = np.zeros(len(surface.V), bool)
    on_path[np.concatenate([path for each in sides for path in each])] = True
    return on_path


def glued_sides(sides: list[Sides]) -> Ints:
    """Charts that share a side have its first edge the other way round."""
    table = np.full((len(sides), 4, 2), -1)
    seen = {
        (int(path[0]), int(path[1])): (chart, s)
        for chart, each in enumerate(sides)
        for s, path in enumerate(each)
    }
    for chart, each in enumerate(sides):
        for s, path in enumerate(each):
            other = seen.get((int(path[-1]), int(path[-2])))
            if other is not None:
                table[chart, s] = other
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
    """Move the corners in which three cells meet to the middle between the cells' middles.

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
