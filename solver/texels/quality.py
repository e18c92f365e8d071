"""How good a texel mesh is: texel edges, and how much of the surface it covers."""

from __future__ import annotations

import numpy as np

from ..mesh.mesh import Mesh
from .links import EAST, NORTH, link_lengths
from .softening import softening
from .spectrum import EVEN_RATE, largest_eigenvalue
from .stiffness import lumped_areas
from .texel_mesh import TexelMesh


def texel_quality(texels: TexelMesh, mesh: Mesh) -> dict[str, float]:
    """Longest and shortest texel edge, folded texels, coverage, spanned area and time step; see `Atlas.quality`."""
    edges = link_lengths(texels.topology, texels.halo_positions)[:, [EAST, NORTH]]
    edges = edges[np.isfinite(edges) & (edges > 0)]
    return {
        "edge_min": float(edges.min()),
        "edge_max": float(edges.max()),
        "folded": folded_texels(texels),
        "coverage": float(texels.areas.sum() / mesh.area),
        "spanned": float(lumped_areas(texels.topology, texels.halo_positions).sum() / mesh.area),
        "timestep": _timestep(texels, mesh.area),
    }


def folded_texels(texels: TexelMesh) -> int:
    """Number of texels of which a corner between two neighbours faces away from the surface's normal."""
    around, normals = texels.halo_positions, texels.normals
    own = around[:, 1:-1, 1:-1]
    beside = [around[:, 1:-1, 2:], around[:, 2:, 1:-1], around[:, 1:-1, :-2], around[:, :-2, 1:-1]]
    folded = np.zeros(own.shape[:3], bool)
    for k in range(4):
        # NaN, where there is no neighbour, is not below 0
        facing = np.cross(beside[k] - own, beside[(k + 1) % 4] - own)
        folded |= np.einsum("...k,...k->...", facing, normals) < 0
    return int(folded.sum())


def _timestep(texels: TexelMesh, area: float) -> float:
    """Stable time step of waves of one speed, over that of an endless even grid of as many texels on the same area."""
    stencil = texels.stencil(np.ones(texels.shape), softening(texels))
    bound = float((2 * stencil.absolute_sums() / texels.areas).max())
    rate = largest_eigenvalue(stencil, texels.areas, np.ones(texels.shape, bool), bound)
    return float(np.sqrt(EVEN_RATE * texels.topology.texel_count / area / rate)) if rate > 0 else np.inf
