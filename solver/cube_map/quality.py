"""How good a sphere map is: folds, stretch, starved area."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.mesh.mesh import Mesh
from ripple_sim.solver.sphere_map import certify, stretch, stretch_quantiles

QUANTILES = {"q001": 0.001, "q01": 0.01, "q50": 0.5, "q99": 0.99, "q999": 0.999}
STARVED = 4.0


def sphere_map_quality(mesh: Mesh, sphere: NDArray[np.float64]) -> dict[str, float]:
    """Flipped triangles, solid angle, quantiles of the stretch, starved share of the area; see `Atlas.quality`."""
    certificate = certify(mesh.F, sphere)
    quantiles = stretch_quantiles(mesh.V, mesh.F, sphere, list(QUANTILES.values()))
    starved = stretch(mesh.V, mesh.F, sphere) > STARVED
    return {
        "flipped": certificate.flipped,
        "solid_angle": certificate.solid_angle,
        **{name: float(value) for name, value in zip(QUANTILES, quantiles, strict=True)},
        "starved": float(mesh.triangle_areas[starved].sum() / mesh.area),
    }
