"""The state of the waves: copies, energy, momentum, volume."""

import numpy as np
import pytest

from ripple_sim.bench import energy_drift
from ripple_sim.solver import Atlas, Material, WaveSolver, sphere_atlas


def test_energy_momentum_and_volume_stay_without_damping(animal: Atlas, backend: str) -> None:
    waves = WaveSolver(animal, Material(speed=0.5, density=2.0), backend=backend)
    waves.add_impulse(animal.mesh.V[100], 1.0, 0.06)
    step = waves.stable_timestep
    waves.step(10 * step)
    energy = waves.energy()
    drift = []
    for _ in range(20):
        waves.step(100 * step if backend == "cpu" else 10 * step)
        drift.append(waves.energy() / energy - 1)
    assert np.abs(drift).max() < 1e-5
    # 1 N s was put in and its mean taken out
    assert abs(waves.momentum()) < 1e-5
    scale = (animal.areas * np.abs(waves.height)).sum()
    assert abs(waves.volume()) < 1e-5 * scale


def test_energy_has_no_trend_over_ten_thousand_steps() -> None:
    drift = energy_drift(resolution=24, steps=10_000)
    assert drift["largest"] < 1e-5
    assert abs(drift["trend"]) < 1e-6


def test_net_impulse_moves_the_surface_as_a_whole_when_volume_is_not_conserved() -> None:
    atlas = sphere_atlas(1.0, 16)
    waves = WaveSolver(atlas, Material(density=5.0), backend="cpu", conserve_volume=False)
    waves.add_impulse([0, 0, 1], 2.0, 0.5)
    assert waves.momentum() == pytest.approx(-2.0, rel=1e-6)
    waves.step(3.0)
    assert waves.momentum() == pytest.approx(-2.0, rel=1e-5)
    assert waves.volume() == pytest.approx(-2.0 / 5.0 * 3.0, rel=1e-5)


def test_energy_never_rises_with_damping_and_viscosity(animal: Atlas) -> None:
    waves = WaveSolver(animal, Material(speed=0.5, damping=0.3, viscosity=1e-4), backend="cpu")
    waves.add_impulse(animal.mesh.V[100], 1.0, 0.06)
    energies = []
    for _ in range(30):
        waves.step(10 * waves.stable_timestep)
        energies.append(waves.energy())
    assert (np.diff(energies) < 0).all()


def test_height_and_velocity_are_copies_and_assignable(backend: str) -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend=backend)
    waves.height[0, 0, 0] = 1
    assert not waves.height.any()
    waves.height = np.ones((6, 8, 8))
    waves.height += 2 * np.ones((6, 8, 8))
    waves.velocity = 2.0
    assert (waves.height == 3).all()
    assert (waves.velocity == 2).all()
    waves.reset()
    assert not waves.height.any()
    assert not waves.velocity.any()
