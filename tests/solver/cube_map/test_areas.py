"""Areas of the texels: all of the surface, where the texel mesh cuts corners as well, but no limb that it misses."""

import numpy as np
import pytest
import trimesh

from ripple_sim.solver import Atlas, Mesh, build_atlas, sphere_atlas
from ripple_sim.solver.layouts.cube.convention import cube_rotations, permute_texels, solid_angles
from ripple_sim.solver.texels.texel_mesh import TexelMesh


def spanned_areas(atlas: Atlas) -> np.ndarray:
    return TexelMesh.of(atlas.texels.topology, atlas.positions).areas


@pytest.fixture(scope="module")
def creased() -> Atlas:
    """A long box: all its curvature is in its edges, which lie anywhere between the texels."""
    box = trimesh.creation.box(extents=[1.0, 0.6, 0.35]).subdivide().subdivide().subdivide()
    return build_atlas(Mesh.from_arrays(box.vertices, box.faces), 48, cache=False)


def test_solid_angles_fill_the_sphere() -> None:
    for n in (4, 7, 64):
        assert 6 * solid_angles(n).sum() == pytest.approx(4 * np.pi, rel=1e-12)
        assert (solid_angles(n) > 0).all()


def test_areas_sum_to_that_of_a_creased_surface(creased: Atlas) -> None:
    area = creased.mesh.area
    # the texel mesh alone cuts the box's edges off
    assert spanned_areas(creased).sum() < 0.993 * area
    assert creased.areas.sum() == pytest.approx(area, rel=1.5e-3)
    assert creased.quality()["coverage"] == pytest.approx(1, abs=1.5e-3)


def test_areas_are_those_of_the_texel_mesh_where_it_follows_the_surface(ball_mesh: Mesh) -> None:
    atlas = build_atlas(ball_mesh, 48, cache=False)
    np.testing.assert_allclose(atlas.areas, spanned_areas(atlas), rtol=0.03)
    assert atlas.areas.sum() == pytest.approx(ball_mesh.area, rel=1e-3)


def test_limbs_that_fall_between_the_texels_are_not_covered(animal: Atlas) -> None:
    conformal = build_atlas(animal.mesh, 64, "conformal", cache=False)
    spanned = spanned_areas(conformal).sum() / animal.mesh.area
    assert spanned < 0.97
    assert conformal.quality()["coverage"] < (1 + spanned) / 2
    assert animal.quality()["coverage"] == pytest.approx(1, abs=3e-3)


def test_areas_of_the_sphere_have_the_symmetries_of_the_cube() -> None:
    areas = sphere_atlas(2.0, 12).areas
    for rotation in cube_rotations():
        np.testing.assert_allclose(permute_texels(areas, rotation), areas, rtol=1e-12)
