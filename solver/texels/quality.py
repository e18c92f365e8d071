"""How good a texel mesh is: texel edges, and how much of the surface it covers."""

from __future__ import annotations

import numpy as np

from ripple_sim.solver.mesh.mesh import Mesh

from .links import EAST, NORTH, link_lengths
from .softening import softening
from .spectrum import largest_eigenvalue
from .stiffness import lumped_areas
from .texel_mesh import TexelMesh

# Largest eigenvalue of an even grid's stencil times its spacing squared: that of the chessboard pattern.
_EVEN_RATE = 6.4


def texel_quality(texels: TexelMesh, mesh: Mesh) -> dict[str, float]:
    """Longest and shortest texel edge, coverage, spanned area and time step; see `Atlas.quality`."""
    edges = link_lengths(texels.topology, texels.halo_positions)[:, [EAST, NORTH]]
    edges = edges[np.isfinite(edges) & (edges > 0)]
    return {
        "edge_min": float(edges.min()),
        "edge_max": float(edges.max()),
        "coverage": float(texels.areas.sum() / mesh.area),
        "spanned": float(lumped_areas(texels.topology, texels.halo_positions).sum() / mesh.area),
        "timestep": _timestep(texels, mesh.area),
    }


def _timestep(texels: TexelMesh, area: float) -> float:
    """Stable time step of waves of one speed, over that of an endless even grid of as many texels on the same area."""
    stencil = texels.stencil(np.ones(texels.shape), softening(texels))
    bound = float((2 * stencil.absolute_sums() / texels.areas).max())
    rate = largest_eigenvalue(stencil, texels.areas, np.ones(texels.shape, bool), bound)
    return float(np.sqrt(_EVEN_RATE * texels.topology.texel_count / area / rate)) if rate > 0 else np.inf
