"""Loads over one step: what they add up to, when they end, and what is refused.

Held forces and pressure: what they add up to, and when they end.
"""

import numpy as np
import pytest

from ripple_sim.solver import Atlas, Load, Material, SolverError, WaveSolver, sphere_atlas
from ripple_sim.solver.waves.footprint import footprint


def test_load_acts_over_its_step_alone_beside_what_is_held(backend: str) -> None:
    waves = WaveSolver(sphere_atlas(1.0, 16), Material(density=2.0), backend=backend, conserve_volume=False)
    waves.add_force([0, 0, 1], 3.0, 0.3)
    waves.step(0.1, load=Load(np.array([5, 9, 5]), np.array([1.0, 0.5, 2.0])))
    assert waves.momentum() == pytest.approx(-0.65, rel=1e-5)
    waves.step(0.1)
    assert waves.momentum() == pytest.approx(-0.95, rel=1e-5)
    assert (waves.pressure * waves.atlas.areas).sum() == pytest.approx(3.0)


def test_load_is_the_same_as_a_held_force_that_is_ended(backend: str) -> None:
    atlas, results = sphere_atlas(1.0, 16), []
    where = footprint(atlas, [1, 0, 0], 0.4)
    shares = where.weights * atlas.areas.reshape(-1)[where.texels]
    for held in (True, False):
        waves = WaveSolver(atlas, Material(speed=0.5), backend=backend)
        if held:
            waves.add_force([1, 0, 0], 2.0, 0.4)
            waves.step(0.2)
            waves.pressure = 0
        else:
            waves.step(0.2, load=Load(where.texels, 2.0 * shares))
        waves.step(0.2)
        results.append(waves.height)
    np.testing.assert_allclose(results[0], results[1], atol=1e-6 * np.abs(results[0]).max())


def test_merging_adds_what_stands_at_the_same_texel() -> None:
    rng = np.random.default_rng(0)
    texels, forces = rng.integers(0, 40, 500), rng.standard_normal(500)
    once = Load(texels, forces).merged(384)
    assert len(np.unique(once.texels)) == len(once.texels)
    np.testing.assert_allclose(
        np.bincount(once.texels, once.forces, 384), np.bincount(texels, forces, 384), rtol=1e-12, atol=1e-14
    )


@pytest.mark.parametrize(
    ("load", "message"),
    [
        (Load(np.array([3, 384]), np.ones(2)), "texels go from 3 to 384; valid are indices from 0 to 383"),
        (Load(np.array([-1]), np.ones(1)), "texels go from -1"),
        (Load(np.array([1]), np.array([np.nan])), "add up to nan N"),
    ],
)
def test_loads_that_cannot_be_are_refused(load: Load, message: str) -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend="cpu")
    with pytest.raises(SolverError, match=message):
        waves.step(0.1, load=load)


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
