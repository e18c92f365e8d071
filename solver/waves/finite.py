"""Where a field is no longer finite."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.texels.atlas import Atlas


def where_not_finite(atlas: Atlas, field: NDArray) -> str | None:
    """Name the place from which NaN or infinity spreads in a field [C, n, n], or None where all is finite."""
    if np.isfinite(field.sum(dtype=np.float64)):
        return None
    bad = ~np.isfinite(field)
    # it spreads by a texel a substep on all sides, so it began in the middle
    places = atlas.positions[bad]
    middle = np.argmin(((places - places.mean(axis=0)) ** 2).sum(axis=1))
    chart, row, column = np.argwhere(bad)[middle]
    x, y, z = places[middle]
    where = f"at chart {chart}, row {row}, column {column}, ({x:.4g}, {y:.4g}, {z:.4g}) m"
    return f"{where} ({bad.sum()} of {bad.size} texels)"
