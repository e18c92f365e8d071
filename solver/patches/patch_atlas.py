"""The atlas of any mesh in the patch layout."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.mesh.mesh import Mesh
from ripple_sim.solver.patch_map.layout import CELLS, PatchMap, patch_map
from ripple_sim.solver.patch_map.seamless import corner_places
from ripple_sim.solver.texels.areas import levelled_areas
from ripple_sim.solver.texels.atlas import Atlas
from ripple_sim.solver.texels.glue import glue
from ripple_sim.solver.texels.texel_mesh import TexelMesh

from .located import locate_texels
from .patch_chart_map import PatchChartMap
from .pieces import chart_pieces
from .rims import positions_beyond

_LEAST_TEXELS = 4  # along a chart's side

# Texels of a cell that is worth having: five charts of 7 x 7. A coarse atlas has fewer cells, but not below the least.
_TEXELS_OF_CELL, _LEAST_CELLS = 245, 24


def patch_atlas(mesh: Mesh, resolution: int) -> Atlas:
    """Atlas of about 6 N^2 texels, for a resolution N.

    Raises
    ------
    AtlasError
        If the mesh cannot be laid out.
    """
    cells = int(np.clip(6 * resolution**2 / _TEXELS_OF_CELL, _LEAST_CELLS, CELLS))
    return atlas_from_patch_map(mesh, patch_map(mesh.V, mesh.F, cells), resolution)


def atlas_from_patch_map(mesh: Mesh, patches: PatchMap, resolution: int) -> Atlas:
    """Put texels on a mesh that is laid out on charts."""
    surface, glued = patches.surface, patches.seamless.glued
    n = max(round(resolution * np.sqrt(6 / len(glued))), _LEAST_TEXELS)
    small, weights = locate_texels(patches.seamless, n)
    positions = np.einsum("...k,...kj->...j", weights, surface.V[surface.F[small]])
    triangles = surface.parent[small]
    barycentrics = np.einsum("...k,...kj->...j", weights, surface.inside[small])
    normals = np.einsum("...k,...kj->...j", barycentrics, mesh.vertex_normals[mesh.F[triangles]])
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = np.where(
        length > 1e-9, normals / np.maximum(length, 1e-9), mesh.vertex_normals[mesh.F[triangles][..., 0]]
    )
    topology = glue(glued, n)
    beyond = positions_beyond(patches, topology, positions)
    spanned = TexelMesh.of(topology, positions, normals=normals, beyond=beyond)
    areas = levelled_areas(topology, spanned.areas, _map_ratios(patches)[small] / n**2)
    return Atlas(
        mesh=mesh,
        texels=TexelMesh(topology, positions, normals, areas, beyond),
        chart_map=PatchChartMap(chart_pieces(patches)),
        triangles=triangles,
        barycentrics=barycentrics,
    )


def _map_ratios(patches: PatchMap) -> NDArray[np.float64]:
    """Real area of each triangle for each unit of its area on the charts [m^2], [m]."""
    places = corner_places(patches.seamless)
    u, v = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
    return patches.surface.areas / ((u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2)
