"""A connected component of a mesh, cut into cells and these into quads: square charts, laid out."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ...errors import AtlasError
from .cells import BorderedCells, Metric, cell_sizes, centred_cells, spread_seeds
from .charts import (
    Sides,
    chart_sides,
    charts_of,
    cut_polygons,
    glued_sides,
    on_paths,
    square_border,
    with_even_corners,
    with_middles,
)
from .disks import disk_cells, flattened, signed_areas
from .pairing import joined
from .surface import Surface, halved_chords, refined


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


CELLS = 96  # of a mesh, where there are texels enough for them
_LARGE = 1.5  # times as many cells, where quads are large
_CORNERS = 6  # of a cell
_RADIUS = 0.75  # of a cell, over the root of its share of the area
_REACH = 0.5  # of the radius at which a geodesic disk is wrapped round a limb
_SMALLEST = 0.85  # of the radius of cells elsewhere
_TRIANGLES = 2000  # of a mesh of one part, in units of the square of its longest edge


def part_of(V: NDArray[np.float64], F: NDArray[np.int64], faces: NDArray[np.int64]) -> Surface:
    """A connected component, the triangles `faces` [m] of V, F."""
    used, corners = np.unique(F[faces], return_inverse=True)
    return dataclasses.replace(Surface.of(V[used], corners.reshape(-1, 3)), parent=faces)


def quads_of(part: Surface, count: int, large: bool) -> Quads:
    """The quads of a count of cells; large ones where they are wanted and possible, else about as many."""
    quads = large_quads_of(part, count) if large else None
    if quads is not None:
        return quads
    return cut_into_quads(_cells_of(part, max(1, round(count * _LARGE / _CORNERS)) if large else count))


def large_quads_of(part: Surface, count: int) -> Quads | None:
    """About as many quads as cells, some more of these; None where the surface has none."""
    return cut_into_large_quads(_cells_of(part, round(_LARGE * count)))


def _cells_of(part: Surface, count: int) -> BorderedCells:
    area = part.areas.sum()
    metric, reach = Metric.of(refined(part, np.sqrt(area / (_TRIANGLES / CELLS * count)))), np.inf
    if count > 1:
        largest = _RADIUS * np.sqrt(area / count)
        metric, reach = metric.in_units(cell_sizes(metric, _REACH, (_SMALLEST * largest, largest))), 1.0
    return disk_cells(metric, centred_cells(metric, spread_seeds(metric, reach)))
