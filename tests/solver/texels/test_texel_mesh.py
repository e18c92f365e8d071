"""Texel meshes of any topology: waves, figures of merit, and smoothing."""

import dataclasses

import numpy as np
import pytest
from cube_symmetry import cube_rotations, permute_texels
from hand_made import RIM, disk, eigenvalues, flat_charts, flat_torus, polygon, square
from modes import orders

from ripple_sim.solver import Material, TexelMesh, WaveSolver, sphere_atlas, texel_atlas
from ripple_sim.solver.layouts.cube import cube_topology
from ripple_sim.solver.texels import smoothed, texel_quality


def test_plane_waves_on_a_flat_torus_converge_at_second_order() -> None:
    errors = []
    for n in (12, 24, 48):
        texels = flat_torus(n)
        assert texels.areas.sum() == pytest.approx(1)
        x, y, _ = np.moveaxis(texels.positions, -1, 0)
        phase = 2 * np.pi * (2 * x + y)
        frequency = 2 * np.pi * np.sqrt(5)
        waves = WaveSolver(
            texel_atlas(texels), Material(speed=1.0), backend="cpu", conserve_volume=False
        )
        waves.height = np.cos(phase)
        waves.velocity = frequency * np.sin(phase)
        waves.step(0.6)
        # the wave has travelled, not stood
        expected = np.cos(phase - 0.6 * frequency)
        errors.append(float(np.sqrt(np.mean((waves.height - expected) ** 2))))
    assert (orders(errors) > 1.9).all()


@pytest.mark.parametrize("sides", [3, 5, 6])
def test_irregular_vertices_converge_to_a_fine_mesh_at_second_order(sides: int) -> None:
    *coarse, fine = (eigenvalues(polygon(sides, n), 9)[1:] for n in (8, 16, 48))
    extrapolated = fine + (fine - coarse[1]) / (3**2 - 1)
    errors = [np.sqrt(np.mean((values / extrapolated - 1) ** 2)) for values in coarse]
    assert errors[1] < 5e-3
    assert errors[0] / errors[1] > 2**1.9


@pytest.mark.parametrize("sides", [3, 4, 5, 6, 7])
def test_charts_round_a_point_have_the_area_of_a_polygon(sides: int) -> None:
    area = sides / 2 * np.sin(2 * np.pi / sides)
    assert polygon(sides, 6).areas.sum() == pytest.approx(area, rel=1e-12)


def test_new_positions_keep_the_topology() -> None:
    texels = polygon(5, 6)
    twice = texels.with_positions(2 * texels.positions, beyond=2 * texels.beyond)
    assert twice.topology is texels.topology
    np.testing.assert_allclose(twice.areas, 4 * texels.areas)
    np.testing.assert_allclose(twice.normals, texels.normals, atol=1e-12)
    # in two dimensions the area integral of the gradient's square does not know the scale
    assert abs(twice.stiffness() - texels.stiffness()).max() < 1e-12
    ball = sphere_atlas(1.0, 8).texels
    np.testing.assert_allclose(
        ball.with_positions(3 * ball.positions, normals=ball.normals).areas, 9 * ball.areas
    )


def test_impulses_at_a_rim_and_at_an_irregular_vertex_keep_their_momentum() -> None:
    texels = polygon(5, 12)
    for point in ([0.0, 0, 0], texels.positions[2, 4, -1]):
        waves = WaveSolver(
            texel_atlas(texels), Material(density=3.0), backend="cpu", conserve_volume=False
        )
        waves.add_impulse(point, 0.7, 0.2)
        waves.step(0.3)
        assert waves.momentum() == pytest.approx(-0.7, rel=1e-5)


def test_a_rectangle_is_covered_by_texels_as_long_and_as_wide_as_its_sides_say() -> None:
    texels = flat_charts([[[0, 0, 0], [3, 0, 0], [3, 1, 0], [0, 1, 0]]], [[RIM] * 4], 5)
    found = texel_quality(texels, texel_atlas(texels).mesh)
    timestep = found.pop("timestep")
    assert found == pytest.approx(
        {"edge_min": 1 / 5, "edge_max": 3 / 5, "folded": 0, "coverage": 1, "spanned": 1}
    )
    # the shorter sides set it
    assert 1 / np.sqrt(3) < timestep < 1


def test_coverage_depends_on_texel_areas_and_spanned_on_texel_positions() -> None:
    texels = square(4)
    mesh = texel_atlas(texels).mesh
    heavy = dataclasses.replace(texels, areas=3 * texels.areas)
    assert texel_quality(heavy, mesh)["coverage"] == pytest.approx(3)
    assert texel_quality(heavy, mesh)["spanned"] == pytest.approx(1)
    ends = TexelMesh.of(texels.topology, texels.positions)
    assert texel_quality(ends, mesh)["spanned"] == pytest.approx(np.square(3 / 4))


def test_the_quality_timestep_is_relative_to_an_even_grid() -> None:
    even, uneven = (texel_atlas(each) for each in (flat_torus(12), disk(12)))
    assert even.quality()["timestep"] == pytest.approx(1, rel=5e-3)
    steps = [WaveSolver(atlas, backend="cpu").stable_timestep for atlas in (even, uneven)]
    spacings = [np.sqrt(atlas.mesh.area / atlas.areas.size) for atlas in (even, uneven)]
    expected = steps[1] / spacings[1] / (steps[0] / spacings[0])
    assert uneven.quality()["timestep"] == pytest.approx(
        expected * even.quality()["timestep"], rel=1e-6
    )
    assert 0.5 < uneven.quality()["timestep"] < 0.8


@pytest.mark.parametrize(("k", "m"), [(0, 0), (1, 0), (2, 3), (6, 6)])
def test_smoothing_damps_waves_on_a_torus_by_the_exact_factor(k: int, m: int) -> None:
    n = 12
    row, column = np.indices((n, n))
    wave = np.cos(2 * np.pi * (k * column + m * row) / n)[None]
    # one pass of 1 2 1 over 4 is cos^2 of half the phase from texel to texel
    response = (np.cos(np.pi * k / n) * np.cos(np.pi * m / n)) ** 8
    np.testing.assert_allclose(smoothed(flat_torus(n).topology, wave), response * wave, atol=1e-12)


@pytest.mark.parametrize(
    "topology",
    [cube_topology(4), square(4).topology, polygon(3, 4).topology, polygon(5, 4).topology],
)
def test_constants_stay_and_nothing_leaves_its_range(topology) -> None:
    np.testing.assert_allclose(smoothed(topology, np.full(topology.shape, 7.0)), 7)
    field = np.random.default_rng(0).uniform(-1, 2, topology.shape)
    before = field.copy()
    found = smoothed(topology, field)
    np.testing.assert_array_equal(field, before)
    assert field.min() < found.min() < found.max() < field.max()


def test_smoothing_does_not_know_how_the_cube_is_turned() -> None:
    topology = cube_topology(6)
    field = np.random.default_rng(1).standard_normal((6, 6, 6))
    found = smoothed(topology, field)
    for rotation in cube_rotations():
        turned = smoothed(topology, permute_texels(field, rotation))
        np.testing.assert_allclose(turned, permute_texels(found, rotation), atol=1e-14)
