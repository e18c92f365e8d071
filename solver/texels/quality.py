"""How good a texel mesh is: texel edges, and how much of the surface it covers."""

from __future__ import annotations

import numpy as np

from ripple_sim.solver.mesh.mesh import Mesh

from .links import EAST, NORTH, link_lengths
from .stiffness import lumped_areas
from .texel_mesh import TexelMesh


def texel_quality(texels: TexelMesh, mesh: Mesh) -> dict[str, float]:
    """Longest and shortest texel edge, coverage and spanned area; see `Atlas.quality`."""
    edges = link_lengths(texels.topology, texels.halo_positions)[:, [EAST, NORTH]]
    edges = edges[np.isfinite(edges) & (edges > 0)]
    return {
        "edge_min": float(edges.min()),
        "edge_max": float(edges.max()),
        "coverage": float(texels.areas.sum() / mesh.area),
        "spanned": float(lumped_areas(texels.topology, texels.halo_positions).sum() / mesh.area),
    }
