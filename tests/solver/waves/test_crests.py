"""Crests: the greatest height of each texel since the last look, whichever step had it."""

import dataclasses

import numpy as np
import pytest

from ripple_sim.solver import Atlas, Material, WaveSolver, sphere_atlas

PLAIN = Material(speed=1.0, density=3.0)


@pytest.mark.parametrize("material", [PLAIN, dataclasses.replace(PLAIN, yield_height=2e-3)], ids=["elastic", "dents"])
def test_crests_are_the_greatest_height_of_all_steps(animal: Atlas, backend: str, material: Material) -> None:
    waves = WaveSolver(animal, material, backend=backend)
    assert not waves.crests().any()
    for seed in (0, 1):
        waves.add_impulse(animal.positions[seed, 3, 5], 0.02, 0.1)
        expected = np.zeros_like(waves.height)
        for _ in range(7):
            waves.step(0.03)
            expected = np.maximum(expected, np.abs(waves.height))
        np.testing.assert_allclose(waves.crests(), expected, atol=1e-9)
        np.testing.assert_array_equal(waves.crests(), np.abs(waves.height))
    assert (expected > 2 * np.abs(waves.height)).any()


def test_crests_of_deep_water_are_kept_too() -> None:
    waves = WaveSolver(sphere_atlas(0.1, 8), Material.water())
    waves.crests()
    waves.add_impulse([0.1, 0.0, 0.0], 1e-4, 0.05)
    heights = []
    for _ in range(4):
        waves.step(0.02)
        heights.append(np.abs(waves.height))
    np.testing.assert_array_equal(waves.crests(), np.max(heights, axis=0))


def test_crests_leave_the_waves_as_they_are(animal: Atlas, backend: str) -> None:
    heights = []
    for kept in (True, False):
        waves = WaveSolver(animal, PLAIN, backend=backend)
        if kept:
            waves.crests()
        waves.add_impulse(animal.positions[0, 3, 5], 0.02, 0.1)
        for _ in range(5):
            waves.step(0.03)
        heights.append(waves.height)
    np.testing.assert_array_equal(*heights)
