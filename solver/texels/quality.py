"""How good an atlas is: folds, stretch, starved area, texel edges, coverage."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ripple_sim.solver.sphere_map import certify, stretch, stretch_quantiles

from .stencil import EAST, NORTH, link_lengths, lumped_areas

if TYPE_CHECKING:
    from .atlas import Atlas

QUANTILES = {"q001": 0.001, "q01": 0.01, "q50": 0.5, "q99": 0.99, "q999": 0.999}
STARVED = 4.0


def atlas_quality(atlas: Atlas) -> dict[str, float]:
    """See `Atlas.quality`."""
    mesh = atlas.mesh
    certificate = certify(mesh.F, atlas.sphere)
    quantiles = stretch_quantiles(mesh.V, mesh.F, atlas.sphere, list(QUANTILES.values()))
    starved = stretch(mesh.V, mesh.F, atlas.sphere) > STARVED
    edges = link_lengths(atlas.positions)[:, [EAST, NORTH]]
    edges = edges[np.isfinite(edges) & (edges > 0)]
    return {
        "flipped": certificate.flipped,
        "solid_angle": certificate.solid_angle,
        **{name: float(value) for name, value in zip(QUANTILES, quantiles, strict=True)},
        "starved": float(mesh.face_areas[starved].sum() / mesh.area),
        "edge_min": float(edges.min()),
        "edge_max": float(edges.max()),
        "coverage": float(atlas.areas.sum() / mesh.area),
        "spanned": float(lumped_areas(atlas.positions).sum() / mesh.area),
    }
