"""How evenly a map onto charts spreads area."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...mesh.mesh import Mesh
from ...texels.stretch import stretch_summary
from .pieces import Pieces


def map_quality(mesh: Mesh, pieces: Pieces) -> dict[str, float]:
    """Flipped pieces, quantiles of the stretch, starved share of the area; see `Atlas.quality`."""
    u, v = pieces.places[:, 1] - pieces.places[:, 0], pieces.places[:, 2] - pieces.places[:, 0]
    flat = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
    real = mesh.triangle_areas[pieces.triangle] * _shares(pieces.barycentrics)
    even = flat * mesh.area / (int(pieces.chart.max()) + 1)
    stretch = np.sqrt(real / np.maximum(even, np.finfo(np.float64).tiny))
    return {"flipped": int((flat <= 0).sum()), **stretch_summary(stretch, real)}


def _shares(barycentrics: NDArray[np.float64]) -> NDArray[np.float64]:
    """Share of its triangle that each piece has."""
    return np.abs(np.linalg.det(barycentrics))
