"""Steps are split as stability asks."""

import numpy as np
import pytest

from ripple_sim.solver import Material, SolverError, WaveSolver, sphere_atlas


def test_result_does_not_depend_on_how_time_is_cut() -> None:
    atlas = sphere_atlas(1.0, 48)

    def run(pieces: int) -> np.ndarray:
        waves = WaveSolver(atlas, backend="cpu")
        waves.add_impulse([0, 0, 1], 1.0, 0.4)
        for _ in range(pieces):
            waves.step(0.8 / pieces)
        return waves.height

    once = run(1)
    assert np.abs(run(37) - once).max() < 0.01 * np.abs(once).max()


def test_substeps_follow_from_stability_and_too_few_are_refused() -> None:
    waves = WaveSolver(sphere_atlas(1.0, 32), backend="cpu")
    waves.step(10.5 * waves.stable_timestep)
    assert waves.substeps_taken == 11
    with pytest.raises(SolverError, match=r"stable .* use 11 or more"):
        waves.step(10.5 * waves.stable_timestep, substeps=10)


def test_steps_that_would_never_end_are_refused() -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend="cpu")
    with pytest.raises(SolverError, match=r"would take .* substeps"):
        waves.step(1e9)
    with pytest.raises(SolverError, match=r"up to 1e\+12"):
        Material(speed=1e30)
    with pytest.raises(SolverError, match="valid is a number"):
        Material(speed="fast")
