"""Sources: fields, impulses and held forces, their totals, and what is said when a wave is no longer finite."""

import re

import numpy as np
import pytest

from ripple_sim.solver import Atlas, Material, SolverError, WaveSolver, sphere_atlas


def test_fields_add_up_and_the_mean_is_taken_out(backend: str) -> None:
    atlas = sphere_atlas(1.0, 16)
    bump = np.exp(-8 * (1 - atlas.positions[..., 2]))
    waves = WaveSolver(atlas, Material(density=3.0), backend=backend)
    waves.add_height(bump)
    waves.add_height(bump)
    waves.add_velocity(-2 * bump)
    mean = (atlas.areas * bump).sum() / atlas.areas.sum()
    np.testing.assert_allclose(waves.height, 2 * (bump - mean), atol=1e-6)
    np.testing.assert_allclose(waves.velocity, -2 * (bump - mean), atol=1e-6)
    assert abs(waves.volume()) < 1e-6
    assert abs(waves.momentum()) < 1e-5


def test_fields_enter_as_they_are_when_volume_is_not_conserved() -> None:
    atlas = sphere_atlas(1.0, 8)
    waves = WaveSolver(atlas, backend="cpu", conserve_volume=False)
    waves.add_height(np.full((6, 8, 8), 0.25))
    waves.add_velocity(np.full((6, 8, 8), -1.0))
    assert (waves.height == 0.25).all()
    assert (waves.velocity == -1.0).all()


@pytest.mark.parametrize("conserve", [True, False])
def test_held_force_changes_momentum_by_force_times_time(animal: Atlas, backend: str, conserve: bool) -> None:
    waves = WaveSolver(animal, Material(speed=0.3, density=2.0), backend=backend, conserve_volume=conserve)
    waves.add_force(animal.mesh.V[100], 3.0, 0.06)
    waves.add_force(animal.mesh.V[105], 1.0, 0.06)
    waves.step(0.11)
    waves.step(0.07)
    expected = 0.0 if conserve else -4.0 * 0.18
    assert waves.momentum() == pytest.approx(expected, rel=1e-4, abs=1e-5)
    assert (waves.pressure * animal.areas).sum() == pytest.approx(4.0)
    waves.pressure = 0
    before = waves.momentum()
    waves.step(0.1)
    assert waves.momentum() == pytest.approx(before, rel=1e-4, abs=1e-5)


def test_static_deflection_under_pressure_is_pressure_over_spring(backend: str) -> None:
    atlas = sphere_atlas(1.0, 16)
    material = Material(speed=0.5, stiffness=40.0, damping=12.0, density=5.0)
    waves = WaveSolver(atlas, material, backend=backend, conserve_volume=False)
    y20 = (3 * atlas.positions[..., 2] ** 2 - 1) / 2
    waves.pressure = 7.0 + 2.0 * y20
    waves.step(6.0)
    expected = -7.0 / (5.0 * 40.0) - 2.0 * y20 / (5.0 * (40.0 + 0.25 * 6))
    np.testing.assert_allclose(waves.height, expected, atol=2e-3 * 7 / 200)


def test_force_held_over_a_step_equals_many_small_impulses(animal: Atlas) -> None:
    point, results = animal.mesh.V[700], []
    for pieces in (0, 400):
        waves = WaveSolver(animal, Material(speed=0.4), backend="cpu")
        if pieces:
            for _ in range(pieces):
                waves.add_impulse(point, 2.0 * 0.4 / pieces, 0.08)
                waves.step(0.4 / pieces)
        else:
            waves.add_force(point, 2.0, 0.08)
            waves.step(0.4)
        results.append(waves.height)
    assert np.abs(results[0] - results[1]).max() < 0.01 * np.abs(results[0]).max()


def test_impulses_on_the_same_texels_add_up(backend: str) -> None:
    atlas = sphere_atlas(1.0, 16)
    once, twice = (WaveSolver(atlas, backend=backend) for _ in range(2))
    once.add_impulse([0, 0, 1], 3.0, 0.4)
    for _ in range(3):
        twice.add_impulse([0, 0, 1], 1.0, 0.4)
    np.testing.assert_allclose(once.velocity, twice.velocity, rtol=1e-5, atol=1e-6)


def test_pressure_is_read_as_it_was_assigned() -> None:
    atlas = sphere_atlas(1.0, 8)
    waves = WaveSolver(atlas, backend="cpu")
    field = np.random.default_rng(0).standard_normal((6, 8, 8))
    waves.pressure = field
    np.testing.assert_allclose(waves.pressure, field, rtol=1e-6)
    waves.add_pressure(1.5)
    np.testing.assert_allclose(waves.pressure, field + 1.5, atol=1e-6)
    waves.reset()
    assert not waves.pressure.any()


def test_what_is_not_finite_is_reported_with_place_and_time(backend: str) -> None:
    atlas = sphere_atlas(1.0, 16)
    waves = WaveSolver(atlas, backend=backend)
    waves.step(0.5)
    height = np.zeros((6, 16, 16), np.float32)
    height[2, 5, 9] = np.nan
    waves._backend.set_height(height)
    place = atlas.positions[2, 5, 9]
    expected = rf"chart 2, row 5, column 9, \({place[0]:.4g}, {place[1]:.4g}, {place[2]:.4g}\) m .* time 0\.6 s"
    with pytest.raises(SolverError, match=expected):
        waves.step(0.1)
        _ = waves.height
    waves.reset()
    waves.step(0.1)
    assert not waves.height.any()


def test_overflow_is_reported(backend: str) -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend=backend)
    with pytest.raises(SolverError, match="no longer finite"):
        for _ in range(50):
            waves.add_impulse([0, 0, 1], 1e38, 0.5)
            waves.step(1.0)
            _ = waves.height


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda w: w.add_force([0, 0, 1], np.nan, 0.1), "force is nan N"),
        (lambda w: w.add_pressure(np.inf), "pressure holds 384 values that are NaN or infinite"),
        (lambda w: w.add_height(np.zeros((6, 4, 4))), "height has shape (6, 4, 4); valid is (6, 8, 8)"),
        (lambda w: w.add_velocity(np.full((6, 8, 8), np.nan)), "velocity holds 384 values"),
    ],
)
def test_bad_sources_are_named(call, message: str) -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend="cpu")
    with pytest.raises(SolverError, match=re.escape(message)):
        call(waves)
