"""The stable time step."""

import numpy as np

from ripple_sim.solver import Atlas, WaveSolver


def test_stable_timestep_is_stable_and_close_to_the_limit(animal: Atlas) -> None:
    waves = WaveSolver(animal, backend="cpu")
    noise = np.random.default_rng(0).standard_normal(waves.height.shape)
    waves.height = noise
    waves._backend.advance(3000, waves.stable_timestep)
    assert np.abs(waves._backend.height()).max() < 1e3
    waves.reset()
    waves.height = noise
    with np.errstate(over="ignore", invalid="ignore"):
        waves._backend.advance(3000, 1.05 * waves.stable_timestep)
    assert not np.abs(waves._backend.height()).max() < 1e3
