"""Figures of merit of a texel mesh, where they are known."""

import dataclasses

import numpy as np
import pytest
from hand_made import disk, flat_charts, flat_torus, square

from ripple_sim.solver import TexelMesh, WaveSolver, sphere_atlas, texel_atlas
from ripple_sim.solver.texels.texel_mesh import texel_quality

RIMS = [[(-1, -1)] * 4]


def test_a_rectangle_is_covered_by_texels_as_long_and_as_wide_as_its_sides_say() -> None:
    texels = flat_charts([[[0, 0, 0], [3, 0, 0], [3, 1, 0], [0, 1, 0]]], RIMS, 5)
    found = texel_quality(texels, texel_atlas(texels).mesh)
    timestep = found.pop("timestep")
    assert found == pytest.approx({"edge_min": 1 / 5, "edge_max": 3 / 5, "folded": 0, "coverage": 1, "spanned": 1})
    # the shorter sides set it
    assert 1 / np.sqrt(3) < timestep < 1


def test_edges_across_a_glued_side_count_too() -> None:
    texels = flat_torus(6)
    beyond = texels.beyond.copy()
    beyond[..., 0] *= 2
    wide = TexelMesh.of(texels.topology, beyond[:, 1:-1, 1:-1], beyond=beyond)
    found = texel_quality(wide, texel_atlas(wide).mesh)
    assert (found["edge_min"], found["edge_max"]) == pytest.approx((1 / 6, 1 / 3))


def test_texels_in_the_same_place_do_not_count_as_the_shortest_edge() -> None:
    texels = square(4)
    positions = texels.positions.copy()
    positions[0, 1, 1] = positions[0, 1, 2]
    crowded = texels.with_positions(positions, beyond=texels.beyond)
    assert texel_quality(crowded, texel_atlas(texels).mesh)["edge_min"] == pytest.approx(1 / 4)


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e3])
def test_edges_grow_with_a_sphere_and_shares_of_its_area_do_not(radius: float) -> None:
    unit, ball = (sphere_atlas(r, 8) for r in (1.0, radius))
    one, other = (texel_quality(atlas.texels, atlas.mesh) for atlas in (unit, ball))
    for name, power in {"edge_min": 1, "edge_max": 1, "coverage": 0, "spanned": 0, "timestep": 0}.items():
        assert other[name] == pytest.approx(one[name] * radius**power)


def test_coverage_follows_the_areas_of_the_texels_and_spanned_their_places() -> None:
    texels = square(4)
    mesh = texel_atlas(texels).mesh
    heavy = dataclasses.replace(texels, areas=3 * texels.areas)
    assert texel_quality(heavy, mesh)["coverage"] == pytest.approx(3)
    assert texel_quality(heavy, mesh)["spanned"] == pytest.approx(1)
    ends = TexelMesh.of(texels.topology, texels.positions)
    assert texel_quality(ends, mesh)["spanned"] == pytest.approx(np.square(3 / 4))


def test_the_time_step_is_that_of_waves_over_an_even_grids() -> None:
    even, uneven = (texel_atlas(each) for each in (flat_torus(12), disk(12)))
    assert even.quality()["timestep"] == pytest.approx(1, rel=5e-3)
    steps = [WaveSolver(atlas, backend="cpu").stable_timestep for atlas in (even, uneven)]
    spacings = [np.sqrt(atlas.mesh.area / atlas.areas.size) for atlas in (even, uneven)]
    expected = steps[1] / spacings[1] / (steps[0] / spacings[0])
    assert uneven.quality()["timestep"] == pytest.approx(expected * even.quality()["timestep"], rel=1e-6)
    assert 0.5 < uneven.quality()["timestep"] < 0.8
