"""Cells cut into square charts, and these laid out."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ...errors import AtlasError
from .borders import BorderedCells
from .charts import Sides, chart_sides, charts_of, glued_sides, on_paths, square_border
from .even_corners import with_even_corners
from .flatten import flattened, signed_areas
from .joined import joined
from .polygons import cut_polygons, with_middles
from .refine import halved_chords
from .surface import Surface


@dataclasses.dataclass(frozen=True, eq=False)
class Quads:
    """A surface laid out on charts, without a fold.

    Attributes
    ----------
    surface : Surface
    chart : int64 [m]
        On which each triangle lies.
    places : float64 [m, 3, 2]
        Column and row of its corners, from 0 to 1 across the chart.
    glued : int64 [C, 4, 2]
        Chart and side beyond each side; -1 at a rim.
    cut : bool [n]
        Vertices that were not there before the surface was cut.
    """

    surface: Surface
    chart: NDArray[np.int64]
    places: NDArray[np.float64]
    glued: NDArray[np.int64]
    cut: NDArray[np.bool_]


def cut_into_quads(cells: BorderedCells) -> Quads:
    """Cut cells into quads, as many as they have corners; even these out, and lay out each of them as a square.

    Raises
    ------
    AtlasError
        If round-off folds a triangle: they are too thin.
    """
    return _laid_out(cells, *with_even_corners(*_cut(cells)))


def cut_into_large_quads(cells: BorderedCells) -> Quads | None:
    """The same with about as many quads as cells; None if there are none, as where two cells go all round a limb.

    Raises
    ------
    AtlasError
        If round-off folds a triangle: they are too thin.
    """
    large = joined(*_cut(cells))
    return None if large is None else _laid_out(cells, *large)


def _cut(cells: BorderedCells) -> tuple[Surface, NDArray[np.int64], list[Sides]]:
    """A chart for each corner of each cell, with the chart of each triangle, and the sides of the charts."""
    surface, cell, halves = with_middles(cells)
    flat, paths = cut_polygons(surface, cell, halves)
    sides = chart_sides(halves, paths)
    return *charts_of(flat.surface, sides), sides


def _laid_out(cells: BorderedCells, surface: Surface, chart: NDArray[np.int64], sides: list[Sides]) -> Quads:
    finer = halved_chords(surface, chart, on_paths(surface, sides))
    surface, chart = finer.surface, chart[finer.origin]
    places = flattened(surface, chart, square_border(surface, sides))
    folded = int((signed_areas(places) <= 0).sum())
    if folded:
        raise AtlasError(f"{folded} triangles of the surface are too thin to be laid out flat")
    return Quads(surface, chart, places, glued_sides(sides), np.arange(len(surface.V)) >= cells.uncut)
