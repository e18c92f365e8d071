"""Corners in which three cells meet, moved to the middle between the cells' middles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .charts import Sides, chart_sides, charts_of, fans_of, glued_sides, on_paths
from .polygons import cut_polygons, halves_of
from .refine import halved_chords
from .surface import Surface


def with_even_corners(
    surface: Surface, chart: NDArray[np.int64], sides: list[Sides]
) -> tuple[Surface, NDArray[np.int64], list[Sides]]:
    """Move the corners in which three cells meet to the middle between the cells' middles.

    Voronoi cells often have very short sides, along which texels would be tiny. So the three charts round a corner,
    a triangle between three cells' middles, are joined and cut anew as the cells were.
    """
    glued = glued_sides(sides)
    fans, rest = fans_of(sides, glued)
    if not fans:
        return surface, chart, sides
    part = np.empty(len(sides), np.int64)
    for number, fan in enumerate([*fans, *([each] for each in rest)]):
        part[fan] = number
    inner = np.zeros(len(sides), bool)
    inner[[each for fan in fans for each in fan]] = True
    halves = []
    for fan in fans:
        following = [*fan[1:], fan[0]]
        whole = [(sides[a][0], sides[b][3]) for a, b in zip(fan, following, strict=True)]
        # the middle stays where the charts beyond do
        shared = [inner[glued[a, 0, 0]] and inner[glued[b, 3, 0]] for a, b in zip(fan, following, strict=True)]
        halves.append(
            [
                halves_of(surface.V, np.concatenate([first, second[1:]])) if both else (first, second)
                for (first, second), both in zip(whole, shared, strict=True)
            ]
        )
    on_border = on_paths(surface, sides)
    split = halved_chords(surface, part[chart], on_border)
    old = chart[split.origin]
    flat, paths = cut_polygons(split.surface, part[old], halves)
    new_sides = [*chart_sides(halves, paths), *(sides[each] for each in rest)]
    surface, chart = charts_of(flat.surface, new_sides)
    return surface, chart, new_sides
