"""Modes: the matrix, closed forms on spheres and squares, copies, decay, refusals."""

import numpy as np
import pytest
from hand_made import flat_charts, polygon, square, square_eigenvalues
from modes import swing

from ripple_sim.solver import (
    Atlas,
    Material,
    SolverError,
    WaveSolver,
    build_operator,
    modes,
    sphere_atlas,
    texel_atlas,
)
from ripple_sim.solver.operator import decay_time, elastic_matrix, frequency

RADIUS = 0.5


@pytest.fixture(scope="module")
def ball() -> Atlas:
    return sphere_atlas(RADIUS, 16)


@pytest.mark.parametrize("rim", ["free", "fixed"])
def test_the_elastic_matrix_is_the_force_of_the_operator(ball: Atlas, rim: str) -> None:
    random = np.random.default_rng(0)
    for atlas in (ball, texel_atlas(polygon(5, 8))):
        speed, bending, stiffness, height = random.uniform(0.5, 2, (4, *atlas.areas.shape))
        material = Material(speed=speed, bending=1e-3 * bending, stiffness=stiffness)
        operator = build_operator(atlas, material, "fem", rim)
        force = operator.elastic_force(height).ravel()
        error = elastic_matrix(operator) @ height.ravel() + force
        assert np.abs(error).max() < 1e-12 * np.abs(force).max()


@pytest.mark.parametrize(
    "material",
    [
        Material(speed=2.0, damping=0.3, viscosity=0.01),
        Material(speed=1.0, damping=0.1, stiffness=40.0, viscosity=0.01),
        Material.plate(damping=0.2),
        Material.water(viscosity=1e-3),
    ],
    ids=["membrane", "springs", "plate", "water"],
)
def test_a_sphere_rings_in_each_of_its_harmonics(ball: Atlas, material: Material) -> None:
    degrees = np.repeat([0, 1, 2, 3], [1, 3, 5, 7])
    if material.deep or not material.stiffness:  # nothing pulls the constant back
        degrees = degrees[1:]
    found = modes(ball, material, len(degrees))
    numbers = np.maximum(np.sqrt(degrees * (degrees + 1)) / RADIUS, 1e-9)
    exact = [frequency(material, q) / (2 * np.pi) for q in numbers]
    np.testing.assert_allclose(found.frequencies, exact, rtol=0.012)
    np.testing.assert_allclose(
        found.decay_times, [decay_time(material, q) for q in numbers], rtol=0.015
    )
    linear = found.shapes[degrees == 1].reshape(3, -1).T
    axes = ball.positions.reshape(-1, 3)
    assert np.abs(axes @ np.linalg.lstsq(axes, linear)[0] - linear).max() < 0.005
    assert (np.abs(found.shapes).max(axis=(1, 2, 3)) == 1).all()


@pytest.mark.parametrize("rim", ["free", "fixed"])
def test_six_squares_have_every_mode_six_times(rim: str) -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    six = flat_charts([corners + np.array([0, 0, k]) for k in range(6)], [[(-1, -1)] * 4] * 6, 16)
    exact = 3.0 / (2 * np.pi) * np.sqrt(square_eigenvalues(rim))
    found = modes(texel_atlas(six), Material(speed=3.0), 36, rim=rim).frequencies
    np.testing.assert_allclose(found, np.repeat(exact[exact > 0], 6)[:36], rtol=0.02)


@pytest.mark.parametrize("rim", ["free", "fixed"])
@pytest.mark.parametrize("law", ["membrane", "plate", "layer"])
def test_in_time_a_mode_rings_down_at_its_frequency_and_decay(law: str, rim: str) -> None:
    atlas = texel_atlas(square(16))
    x = atlas.positions[..., 0]
    material = {
        "membrane": Material(speed=1 + 0.5 * x, damping=0.4, viscosity=0.01),
        "plate": Material(speed=0.2 * x, bending=0.01, damping=0.2),
        "layer": Material.layer(1000.0, 2.0, thickness=0.2 + 0.1 * x),
    }[law]
    found = modes(atlas, material, 5, rim=rim)
    waves = WaveSolver(atlas, material, backend="cpu", rim=rim, conserve_volume=False)
    angular, rate = swing(waves, 1e-3 * found.shapes[4], 0.02 / found.frequencies[4], 120)
    assert angular / (2 * np.pi) == pytest.approx(found.frequencies[4], rel=0.005)
    assert 1 / rate == pytest.approx(found.decay_times[4], rel=0.01)


@pytest.mark.parametrize("texels", [1.3, 3.0])
def test_a_layer_of_few_texels_rings_at_its_frequency_at_the_longest_substeps(
    texels: float,
) -> None:
    """All its modes swing nearly as fast as stability allows: they were up to 9 % too high."""
    atlas = texel_atlas(square(16))
    material = Material.layer(1000.0, 0.0, thickness=texels / 16)
    found = modes(atlas, material, 1)
    waves = WaveSolver(atlas, material, backend="cpu", conserve_volume=False)
    angular, _ = swing(waves, 1e-3 * found.shapes[0], waves.stable_timestep, 120)
    assert angular / (2 * np.pi) == pytest.approx(found.frequencies[0], rel=0.005)


def test_modes_of_one_frequency_are_not_mixed_by_uneven_damping(ball: Atlas) -> None:
    uneven = 1 + (ball.positions[..., 0] / RADIUS) ** 2
    found = modes(ball, Material(speed=1.0, damping=0.1 * uneven), 3)
    # means of x^4 over x^2, and of x^2 y^2 over y^2: 3/5 and 1/5
    np.testing.assert_allclose(
        np.sort(found.decay_times), [20 / 1.6, 20 / 1.2, 20 / 1.2], rtol=0.005
    )


def test_an_overdamped_mode_has_no_frequency_and_its_slow_decay_time(ball: Atlas) -> None:
    found = modes(ball, Material(speed=1.0, damping=40.0), 3)
    assert not found.frequencies.any()
    np.testing.assert_allclose(
        found.decay_times, 1 / (20 - np.sqrt(400 - 2 / RADIUS**2)), rtol=0.005
    )


def test_modes_are_0_on_fixed_texels(ball: Atlas) -> None:
    right = ball.positions[..., 0] > 0.2
    left = ball.positions[..., 0] < -0.2
    found = modes(ball, Material(speed=np.where(left, 0.0, 1.0), fixed=right), 5)
    assert not found.shapes[:, right].any()
    assert (found.frequencies > 0).all()


@pytest.mark.parametrize("count", [0, -1, 1.5, 10**6, None])
def test_a_wrong_count_is_refused_with_the_range(ball: Atlas, count: object) -> None:
    with pytest.raises(
        SolverError, match=r"count of modes must be a whole number from 1 to 134, got"
    ):
        modes(ball, Material(speed=1.0), count)  # type: ignore[arg-type]


def test_deep_fluid_is_refused_where_its_modes_are_not_known(ball: Atlas) -> None:
    water = Material.water()
    held = Material(
        water.speed, stiffness=water.stiffness, deep=water.deep, fixed=ball.positions[..., 2] > 0.4
    )
    with pytest.raises(SolverError, match="deep fluid"):
        modes(ball, held, 3)
