"""A connected component of a mesh, cut into cells and these into quads."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .borders import BorderedCells
from .cells import centred_cells, spread_seeds
from .disks import disk_cells
from .distances import Metric
from .quads import Quads, cut_into_large_quads, cut_into_quads
from .refine import refined
from .sizes import cell_sizes
from .surface import Surface

CELLS = 96  # of a mesh, where there are texels enough for them
_LARGE = 1.5  # times as many cells, where quads are large
_CORNERS = 6  # of a cell
_RADIUS = 0.75  # of a cell, over the root of its share of the area
_REACH = 0.5  # of the radius at which a geodesic disk is wrapped round a limb
_SMALLEST = 0.85  # of the radius of cells elsewhere
_TRIANGLES = 2000  # of a mesh of one part, in units of the square of its longest edge


class Part:
    """A connected component, the triangles `faces` [m] of V, F."""

    def __init__(self, V: NDArray[np.float64], F: NDArray[np.int64], faces: NDArray[np.int64]) -> None:
        used, corners = np.unique(F[faces], return_inverse=True)
        self._whole = dataclasses.replace(Surface.of(V[used], corners.reshape(-1, 3)), parent=faces)

    def quads(self, count: int, large: bool) -> Quads:
        """The quads of a count of cells; large ones where they are wanted and possible, else about as many."""
        quads = self.large_quads(count) if large else None
        if quads is not None:
            return quads
        return cut_into_quads(self._cells(max(1, round(count * _LARGE / _CORNERS)) if large else count))

    def large_quads(self, count: int) -> Quads | None:
        """About as many quads as cells, some more of these; None where the surface has none."""
        return cut_into_large_quads(self._cells(round(_LARGE * count)))

    def _cells(self, count: int) -> BorderedCells:
        area = self._whole.areas.sum()
        metric, reach = Metric.of(refined(self._whole, np.sqrt(area / (_TRIANGLES / CELLS * count)))), np.inf
        if count > 1:
            largest = _RADIUS * np.sqrt(area / count)
            metric, reach = metric.in_units(cell_sizes(metric, _REACH, (_SMALLEST * largest, largest))), 1.0
        return disk_cells(metric, centred_cells(metric, spread_seeds(metric, reach)))
