"""Cells laid out as regular polygons, and cut from their middles to the middles of their sides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .borders import BorderedCells
from .flatten import Border, along, flattened
from .rays import Flat, central_vertices, cut_ray
from .refine import halved, halved_chords
from .surface import Surface

Path = NDArray[np.int64]
Halves = list[tuple[Path, Path]]  # of each arc of a part's border


def with_middles(cells: BorderedCells) -> tuple[Surface, NDArray[np.int64], list[Halves]]:
    """Cells [m] with a vertex in the middle of each arc, at which it is cut in half, and with inner vertices."""
    surface = cells.surface
    single = np.array([arc for each in cells.arcs for arc in each if len(arc) == 2]).reshape(-1, 2)
    size = len(surface.V)
    low_high = surface.edges.ends @ [size, 1]
    chosen = np.isin(low_high, np.sort(single, axis=1) @ [size, 1])
    finer = halved(surface, chosen)
    middle = dict(zip(map(tuple, surface.edges.ends[chosen].tolist()), finer.middles[chosen].tolist(), strict=True))
    arcs = [
        [arc if len(arc) > 2 else np.insert(arc, 1, middle[min(arc), max(arc)]) for arc in each] for each in cells.arcs
    ]
    on_border = np.zeros(len(finer.surface.V), bool)
    on_border[np.concatenate([arc for each in arcs for arc in each])] = True
    cell = cells.cell[finer.origin]
    split = halved_chords(finer.surface, cell, on_border)
    halves = [[halves_of(split.surface.V, arc) for arc in each] for each in arcs]
    return split.surface, cell[split.origin], halves


def halves_of(V: NDArray[np.float64], arc: Path) -> tuple[Path, Path]:
    """Cut an arc in two at the vertex nearest to its middle; the same from either side."""
    flipped = arc[0] > arc[-1] or (arc[0] == arc[-1] and arc[1] > arc[-2])
    way = arc[::-1] if flipped else arc
    at = 1 + int(np.abs(along(V, [way])[1:-1] - 0.5).argmin())
    return (way[: at + 1], way[at:]) if not flipped else (way[at:][::-1], way[: at + 1][::-1])


def cut_polygons(surface: Surface, part: NDArray[np.int64], halves: list[Halves]) -> tuple[Flat, list[list[Path]]]:
    """Lay out the first parts as regular polygons and cut them from their middles; return the paths of the cuts.

    Parts beyond those that have a border are left alone.
    """
    on_border = np.zeros(len(surface.V), bool)
    on_border[np.concatenate([half for each in halves for arc in each for half in arc])] = True
    chosen = part < len(halves)
    places = np.full((len(part), 3, 2), np.nan)
    some = Surface(surface.V, surface.F[chosen], surface.parent[chosen], surface.inside[chosen])
    places[chosen] = flattened(some, part[chosen], _polygon_border(surface, halves))
    centre = central_vertices(Flat(some, part[chosen], places[chosen]), on_border)
    count = int(part.max()) + 1
    flat = Flat(surface, part, places)
    paths: list[list[Path]] = [[] for _ in halves]
    for i in range(max(map(len, halves), default=0)):
        start, end = np.full(count, -1), np.full(count, -1)
        for number, each in enumerate(halves):
            if len(each) > i:
                start[number], end[number] = centre[number], each[i][0][-1]
        border = np.zeros(len(flat.surface.V), bool)
        border[: len(on_border)] = on_border
        flat, lines = cut_ray(flat, start, end, border)
        for path, line in zip(paths, lines, strict=False):
            if len(line):
                path.append(line)
    return flat, paths


def _polygon_border(surface: Surface, halves: list[Halves]) -> Border:
    """Cells as regular polygons: corners on the unit circle, arcs along the sides."""
    paths, cells, ends = [], [], []
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
    return Border(np.repeat(cells, lengths), np.concatenate(paths), np.stack([z.real, z.imag], axis=1))
