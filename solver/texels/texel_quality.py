"""Figures of how good a texel mesh is."""

from __future__ import annotations

import numpy as np

from ..mesh.mesh import Mesh
from .stencil import EVEN_RATE, largest_eigenvalue, link_lengths
from .texel_mesh import TexelMesh


def texel_quality(texels: TexelMesh, mesh: Mesh) -> dict[str, float]:
    """Figures of how good a texel mesh is; see `Atlas.quality`."""
    lengths = link_lengths(texels.topology, texels.halo_positions)
    edges = lengths[~texels.topology.still, :2]  # not the diagonals
    edges = edges[np.isfinite(edges) & (edges > 0)]
    stencil = texels.stencil(np.ones(texels.shape), texels.softening())
    rate = largest_eigenvalue(
        stencil, texels.areas, np.ones(texels.shape, bool), stencil.fastest(texels.areas)
    )
    # of an endless even grid of as many texels on the same area
    even_rate = EVEN_RATE * texels.topology.texel_count / mesh.area
    step = np.sqrt(even_rate / rate) if rate > 0 else np.inf
    return {
        "edge_min": float(edges.min()),
        "edge_max": float(edges.max()),
        "folded": folded_texels(texels),
        "coverage": float(texels.areas.sum() / mesh.area),
        "spanned": float(texels.cells.areas.sum() / mesh.area),
        "timestep": float(step),
    }


def folded_texels(texels: TexelMesh) -> int:
    """Number of texels with a corner, between two neighbours, that faces away from the normal."""
    around = texels.halo_positions
    own = texels.positions
    beside = [around[:, 1:-1, 2:], around[:, 2:, 1:-1], around[:, 1:-1, :-2], around[:, :-2, 1:-1]]
    folded = np.zeros(own.shape[:3], bool)
    for k in range(4):
        # NaN, where there is no neighbour, is not below 0
        facing = np.cross(beside[k] - own, beside[(k + 1) % 4] - own)
        folded |= np.einsum("...k,...k->...", facing, texels.normals) < 0
    return int(folded[~texels.topology.still].sum())
