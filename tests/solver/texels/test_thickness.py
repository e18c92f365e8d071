"""Half the thickness of solids on which it is known."""

import numpy as np
import pytest
import trimesh

from ripple_sim.solver import Mesh, build_atlas, sphere_atlas
from ripple_sim.solver.texels.thickness import half_thickness


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e3])
def test_of_a_sphere_it_is_the_radius_at_any_scale(radius: float) -> None:
    np.testing.assert_allclose(half_thickness(sphere_atlas(radius, 16)), radius, rtol=0.01)


def test_of_a_slab_it_is_half_its_thickness_up_to_the_edges() -> None:
    solid = trimesh.creation.box(extents=(1, 1, 0.2)).subdivide_to_size(0.1)
    atlas = build_atlas(Mesh.from_arrays(solid.vertices, solid.faces), 32, cache=False)
    flat = np.abs(atlas.normals[..., 2]) > 0.99
    away = flat & (np.abs(atlas.positions[..., :2]) < 0.4).all(axis=-1)
    np.testing.assert_allclose(half_thickness(atlas)[away], 0.1, rtol=0.02)
    np.testing.assert_allclose(half_thickness(atlas)[flat], 0.1, atol=0.05)
