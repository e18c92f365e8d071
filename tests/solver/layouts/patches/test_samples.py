"""Texels that move so that none is folded: on a blade, whose edge lies between them, and round the tips of cones."""

import numpy as np
import pytest
from surfaces import sphere

from ripple_sim.solver import Atlas, Mesh, glue
from ripple_sim.solver.layouts.patches.atlas import atlas_from_patch_map
from ripple_sim.solver.layouts.patches.layout import patch_map
from ripple_sim.solver.layouts.patches.samples import centres
from ripple_sim.solver.texels.texel_mesh import TexelMesh, folded_texels

N = 24


def blade() -> Mesh:
    ball = sphere(3)
    return Mesh.from_arrays(ball.V * [1.0, 0.6, 0.03], ball.F)


@pytest.fixture(scope="module")
def atlases() -> tuple[TexelMesh, Atlas]:
    """Texels at the centres of their squares, and the atlas."""
    mesh = blade()
    patches = patch_map(mesh.V, mesh.F, 24)
    atlas = atlas_from_patch_map(mesh, patches, N)
    samples = centres(mesh, patches, atlas.texels.resolution)
    topology = glue(patches.seamless.glued, atlas.texels.resolution)
    return TexelMesh.of(topology, samples.positions, normals=samples.normals), atlas


def test_texels_astride_of_a_knife_edge_are_put_in_order(atlases: tuple[TexelMesh, Atlas]) -> None:
    centred, atlas = atlases
    assert folded_texels(centred) > 8
    assert atlas.quality()["folded"] == 0
    away = (centred.positions != atlas.positions).any(axis=-1)
    assert 0 < away.mean() < 0.3


def test_a_moved_texel_is_found_where_it_lies_and_no_triangle_is_folded(atlases: tuple[TexelMesh, Atlas]) -> None:
    atlas = atlases[1]
    assert atlas.quality()["flipped"] == 0
    place = np.stack(atlas.locate(atlas.positions.reshape(-1, 3))).reshape(3, *atlas.areas.shape)
    np.testing.assert_allclose(place, np.indices(atlas.areas.shape), atol=1e-6)
    pieces = atlas.chart_map.pieces
    share = np.abs(np.linalg.det(pieces.barycentrics))
    np.testing.assert_allclose(np.bincount(pieces.triangle, share, len(atlas.mesh.F)), 1.0, atol=1e-9)
