"""Quick stiffness of moving texels against the assembly from nothing, on every kind of cell."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from ripple_sim.solver import build_atlas, texel_atlas
from ripple_sim.solver.layouts.cube.atlas import sphere_atlas
from ripple_sim.solver.texels.moving import SurfaceRide
from ripple_sim.solver.texels.stiffness import TexelCells
from tests.support.hand_made import disk, polygon, square

SURFACES = {
    "sphere": lambda: sphere_atlas(1.0, 6),
    "three charts round a point": lambda: texel_atlas(polygon(3, 4)),
    "five charts round a point": lambda: texel_atlas(polygon(5, 4)),
    "disk": lambda: texel_atlas(disk(6)),
    "square": lambda: texel_atlas(square(6)),
}


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("fixed", [False, True], ids=["free", "fixed"])
def test_weights_and_areas_are_those_of_the_texels_where_they_are(name, fixed):
    atlas = SURFACES[name]()
    texels = atlas.texels.with_fixed_rim() if fixed else atlas.texels
    rng = np.random.default_rng(4)
    V = atlas.mesh.V @ (np.eye(3) + 0.3 * rng.standard_normal((3, 3))) + 10.0
    around = SurfaceRide(atlas).around(V)
    speeds, soft = rng.uniform(1, 2, (2, *texels.shape)) / [[[[1]]], [[[2]]]]
    cells = texels.cells
    stencil, areas = cells.moved(around, cells.coefficient(speeds, soft, 0.0))
    beside = np.moveaxis(around, 0, -1)
    there = TexelCells(texels.topology, beside)
    exact = there.at_rest(speeds, soft)
    assert_allclose(stencil.weights, exact.weights, atol=3e-6 * np.abs(exact.weights).max())
    if exact.irregular is not None:
        assert_allclose(stencil.irregular.weights, exact.irregular.weights, atol=1e-6)
        assert_allclose(stencil.irregular.others, exact.irregular.others)
    assert_allclose(areas, there.areas, rtol=3e-6)


def test_a_coefficient_follows_a_power_of_the_area():
    atlas = SURFACES["five charts round a point"]()
    cells, ones = atlas.texels.cells, np.ones(atlas.areas.shape)
    twice = SurfaceRide(atlas).around(2 * atlas.mesh.V)
    plain, thinner = (cells.moved(twice, cells.coefficient(ones, ones, power))[0] for power in (0.0, -1.0))
    assert_allclose(thinner.weights, plain.weights / 4, atol=1e-6)
    assert_allclose(thinner.irregular.weights, plain.irregular.weights / 4, atol=1e-6)


def test_crushed_cells_have_finite_weights():
    atlas = SURFACES["disk"]()
    cells, ones = atlas.texels.cells, np.ones(atlas.areas.shape)
    for V in (0 * atlas.mesh.V, atlas.mesh.V * [1, 0, 1]):
        stencil, areas = cells.moved(SurfaceRide(atlas).around(V), cells.coefficient(ones, ones, -1.0))
        assert np.isfinite(stencil.weights).all()
        assert np.isfinite(areas).all()


@pytest.mark.parametrize("kind", ["sphere", "patches"])
def test_texels_keep_their_places_under_any_affine_motion_of_a_mesh(kind):
    atlas = SURFACES["sphere"]()
    if kind == "patches":
        atlas = build_atlas(atlas.mesh, 8, layout="patches")
    M = np.eye(3) + 0.3 * np.random.default_rng(1).standard_normal((3, 3))
    positions, _ = SurfaceRide(atlas).positions(atlas.mesh.V @ M.T + [1, 2, 3])
    assert_allclose(positions, atlas.positions @ M.T + [1, 2, 3], atol=1e-12)
