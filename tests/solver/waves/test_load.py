"""Loads over one step: what they add up to, when they end, and what is refused."""

import warnings

import numpy as np
import pytest

from ripple_sim.solver import Atlas, Load, Material, SolverError, WaveSolver, sphere_atlas
from ripple_sim.solver.texels.distance import distance_from_point
from ripple_sim.solver.waves.footprint import footprint, footprint_at


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


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda w: w.add_impulse([[0, 0, 1], [0, 1, 0]], 1.0, 0.1), "a source has 2 points; valid is one"),
        (lambda w: w.add_impulse([0, 0, 1], "hard", 0.1), "impulse is 'hard' N s"),
        (lambda w: w.add_force([0, 0, 1], 1.0, None), "radius is None m"),
        (lambda w: w.step("long"), "time step is 'long' s"),
        (lambda w: WaveSolver(w.atlas, {"speed": 1.0}), "material is {'speed': 1.0}; valid is a Material"),
    ],
)
def test_arguments_of_a_wrong_kind_are_named(call, message: str) -> None:
    with pytest.raises(SolverError, match=message):
        call(WaveSolver(sphere_atlas(1.0, 8), backend="cpu"))


def test_what_float32_cannot_hold_is_one_error_and_no_warning() -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend="cpu")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        waves.add_impulse([0, 0, 1], 1e38, 0.5)
        with pytest.raises(SolverError, match="no longer finite"):
            waves.step(0.1)
        assert np.isnan(waves.energy())


def test_footprint_measures_straight_where_it_is_flat_and_along_the_surface_where_it_is_not(animal: Atlas) -> None:
    """Both ways through the code against distances by fast marching."""
    rng = np.random.default_rng(1)
    positions, flat = animal.positions.reshape(-1, 3), 0
    for vertex in rng.integers(0, len(animal.mesh.V), 40):
        (point,), (center,) = animal.nearest(animal.mesh.V[vertex])
        where = footprint_at(animal, point, int(center), 0.08)
        texels, along = distance_from_point(animal.texels, int(center), point, 3 * where.radius)
        distance = dict(zip(texels.tolist(), along, strict=True))
        height = (where.weights / where.weights.max()) ** (1 / 3)
        used = where.radius * np.sqrt(1 - np.minimum(1, height * (1 - (min(distance.values()) / where.radius) ** 2)))
        straight = np.linalg.norm(positions[where.texels] - point, axis=1)
        true = np.array([distance[texel] for texel in where.texels.tolist()])
        assert (used > 0.97 * straight - 0.05 * where.radius).all()
        assert (used < 1.05 * true + 0.05 * where.radius).all()
        flat += np.allclose(used, straight, atol=0.02 * where.radius)
    assert 5 < flat < 40, "only one of the two ways was taken"
