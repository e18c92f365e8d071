"""The atlas of any mesh in the patch layout."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from ...mesh.mesh import Mesh
from ...texels.areas import levelled_areas
from ...texels.atlas import Atlas
from ...texels.glue import glue
from ...texels.texel_mesh import TexelMesh
from .atlas import PatchChartMap
from .layout import PatchMap, patch_map
from .part import CELLS
from .pieces import chart_pieces
from .rims import positions_beyond
from .samples import Sampler
from .seamless import corner_places
from .untangled import untangled
from .warp import warped

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
    start = time.perf_counter()
    patches = patch_map(mesh.V, mesh.F, cells_for(resolution))
    mapped = time.perf_counter()
    atlas = atlas_from_patch_map(mesh, patches, resolution)
    atlas.timings.update(patch_map=mapped - start, texels=time.perf_counter() - mapped)
    return atlas


def cells_for(resolution: int) -> int:
    """How many cells a mesh is cut into."""
    return int(np.clip(6 * resolution**2 / _TEXELS_OF_CELL, _LEAST_CELLS, CELLS))


def atlas_from_patch_map(mesh: Mesh, patches: PatchMap, resolution: int) -> Atlas:
    """Put texels on a mesh that is laid out on charts."""
    glued = patches.seamless.glued
    n = max(round(resolution * np.sqrt(6 / len(glued))), _LEAST_TEXELS)
    sampler = Sampler(mesh, patches)
    samples = sampler.everywhere(n)
    topology = glue(glued, n)
    beyond = positions_beyond(patches, topology, samples.positions)
    samples, offsets = untangled(sampler, topology, samples, beyond)
    pieces = chart_pieces(patches)
    if offsets.any():
        pieces, beyond = warped(pieces, offsets), positions_beyond(patches, topology, samples.positions)
    spanned = TexelMesh.of(topology, samples.positions, normals=samples.normals, beyond=beyond)
    areas = levelled_areas(topology, spanned.areas, _map_ratios(patches)[samples.small] / n**2)
    return Atlas(
        mesh=mesh,
        texels=TexelMesh(topology, samples.positions, samples.normals, areas, beyond),
        chart_map=PatchChartMap(pieces),
        triangles=samples.triangles,
        barycentrics=samples.barycentrics,
    )


def _map_ratios(patches: PatchMap) -> NDArray[np.float64]:
    """Real area of each triangle for each unit of its area on the charts [m^2], [m]."""
    places = corner_places(patches.seamless)
    u, v = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
    return patches.surface.areas / ((u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2)
