"""Texel meshes of any topology: rims, irregular vertices, several parts, against what is known of their waves."""

import copy

import numba
import numpy as np
import pytest
from hand_made import eigenvalues, flat_torus, polygon, square

from ripple_sim.solver import Material, TexelMesh, WaveSolver, sphere_atlas, texel_atlas


def mode_error(texels: TexelMesh, mode: np.ndarray, frequency: float) -> float:
    """Relative L2 error of a standing mode after one period."""
    waves = WaveSolver(texel_atlas(texels), Material(speed=1.0), backend="cpu", conserve_volume=False)
    waves.height = mode
    waves.step(2 * np.pi / frequency)
    weight = texels.areas
    return float(np.sqrt((weight * (waves.height - mode) ** 2).sum() / (weight * mode**2).sum()))


def orders(errors: list[float]) -> np.ndarray:
    return np.log2(np.array(errors[:-1]) / errors[1:])


def test_modes_of_a_square_with_free_edges_converge_at_second_order() -> None:
    errors = []
    for n in (12, 24, 48):
        texels = square(n)
        x, y, _ = np.moveaxis(texels.positions, -1, 0)
        errors.append(mode_error(texels, np.cos(np.pi * x) * np.cos(2 * np.pi * y), np.pi * np.sqrt(5)))
    assert (orders(errors) > 1.9).all()
    assert errors[-1] < 0.01


def test_a_surface_may_end_at_its_last_texels() -> None:
    errors = []
    for n in (13, 25, 49):
        place = np.linspace(0, 1, n)
        x, y = np.meshgrid(place, place)
        texels = TexelMesh.of(square(n).topology, np.stack([x, y, 0 * x], axis=-1)[None])
        assert texels.areas.sum() == pytest.approx(1)
        errors.append(mode_error(texels, (np.cos(np.pi * x) * np.cos(2 * np.pi * y))[None], np.pi * np.sqrt(5)))
    assert (orders(errors) > 1.9).all()


def test_plane_waves_on_a_flat_torus_converge_at_second_order() -> None:
    errors = []
    for n in (12, 24, 48):
        texels = flat_torus(n)
        assert texels.areas.sum() == pytest.approx(1)
        x, y, _ = np.moveaxis(texels.positions, -1, 0)
        phase, frequency = 2 * np.pi * (2 * x + y), 2 * np.pi * np.sqrt(5)
        waves = WaveSolver(texel_atlas(texels), Material(speed=1.0), backend="cpu", conserve_volume=False)
        waves.height, waves.velocity = np.cos(phase), frequency * np.sin(phase)
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
def test_stiffness_is_symmetric_and_positive_but_for_the_constant(sides: int) -> None:
    texels = polygon(sides, 6)
    matrix = texels.stiffness()
    assert abs(matrix - matrix.T).max() < 1e-12
    values = np.linalg.eigvalsh(matrix.toarray())
    assert values[0] > -1e-12 and values[1] > 1e-3
    area = sides / 2 * np.sin(2 * np.pi / sides)
    assert texels.areas.sum() == pytest.approx(area, rel=1e-12)


def test_new_positions_keep_the_topology() -> None:
    texels = polygon(5, 6)
    twice = texels.with_positions(2 * texels.positions, beyond=2 * texels.beyond)
    assert twice.topology is texels.topology
    np.testing.assert_allclose(twice.areas, 4 * texels.areas)
    np.testing.assert_allclose(twice.normals, texels.normals, atol=1e-12)
    # in two dimensions the area integral of the gradient's square does not know the scale
    assert abs(twice.stiffness() - texels.stiffness()).max() < 1e-12
    ball = sphere_atlas(1.0, 8).texels
    np.testing.assert_allclose(ball.with_positions(3 * ball.positions, normals=ball.normals).areas, 9 * ball.areas)


def test_momentum_of_an_impulse_on_a_rim_and_an_irregular_vertex() -> None:
    texels = polygon(5, 12)
    for point in ([0.0, 0, 0], texels.positions[2, 4, -1]):
        waves = WaveSolver(texel_atlas(texels), Material(density=3.0), backend="cpu", conserve_volume=False)
        waves.add_impulse(point, 0.7, 0.2)
        waves.step(0.3)
        assert waves.momentum() == pytest.approx(-0.7, rel=1e-5)


def test_no_kernel_is_compiled_anew_for_a_copy() -> None:
    texels = square(4)
    assert numba.typeof(copy.deepcopy(texels).grid) == numba.typeof(texels.grid)
