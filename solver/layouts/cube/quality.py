"""How good a sphere map is: folds, stretch, starved area."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...mesh.mesh import Mesh
from ...texels.stretch import stretch_summary
from ..sphere_map import certify, stretch


def sphere_map_quality(mesh: Mesh, sphere: NDArray[np.float64]) -> dict[str, float]:
    """Flipped triangles, solid angle, quantiles of the stretch, starved share of the area; see `Atlas.quality`."""
    certificate = certify(mesh.F, sphere)
    return {
        "flipped": certificate.flipped,
        "solid_angle": certificate.solid_angle,
        **stretch_summary(stretch(mesh.V, mesh.F, sphere), mesh.triangle_areas),
    }
