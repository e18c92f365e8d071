"""Loads over one step: what they add up to, when they end, and what is refused."""

import numpy as np
import pytest

from ripple_sim.solver import Load, Material, SolverError, WaveSolver, sphere_atlas
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
