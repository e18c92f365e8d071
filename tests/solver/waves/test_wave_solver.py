"""The wave solver against theory: modes, order, conservation, damping, stability."""

import copy
import dataclasses
import pickle
from collections.abc import Callable

import numpy as np
import pytest
from modes import mode_error, zonal_harmonic

from ripple_sim.bench import energy_drift
from ripple_sim.solver import Atlas, Material, SolverError, WaveSolver, sphere_atlas


def test_second_order_convergence_against_a_spherical_harmonic() -> None:
    resolutions = np.array([16, 32, 64, 128])
    errors = np.array([mode_error(n) for n in resolutions])
    order = -np.polyfit(np.log(resolutions), np.log(errors), 1)[0]
    assert order > 1.95
    assert np.log2(errors[-2] / errors[-1]) > 1.95
    assert errors[-1] < 1.5e-4


@pytest.mark.parametrize("radius", [0.01, 3.0])
@pytest.mark.parametrize("speed", [0.2, 50.0])
def test_frequency_scales_with_speed_over_radius(radius: float, speed: float) -> None:
    atlas = sphere_atlas(radius, 32)
    waves = WaveSolver(atlas, Material(speed=speed), backend="cpu")
    start = zonal_harmonic(atlas.positions[..., 2] / radius)
    waves.height = start
    waves.step(2 * np.pi / np.sqrt(20) * radius / speed / 2)
    np.testing.assert_allclose(waves.height, -start, atol=5e-3)


def test_waves_of_two_impulses_add_up(animal: Atlas, backend: str) -> None:
    def run(*impulses: tuple[np.ndarray, float]) -> np.ndarray:
        waves = WaveSolver(animal, Material(speed=0.5), backend=backend)
        for point, impulse in impulses:
            waves.add_impulse(point, impulse, 0.08)
        waves.step(0.3)
        return waves.height

    a = (animal.mesh.V[100], 1.0)
    b = (animal.mesh.V[2000], -0.7)
    both = run(a, b)
    np.testing.assert_allclose(run(a) + run(b), both, atol=1e-5 * np.abs(both).max())


def test_same_input_gives_the_same_bits(animal: Atlas, backend: str) -> None:
    def run() -> bytes:
        waves = WaveSolver(animal, Material(speed=0.5, viscosity=1e-4), backend=backend)
        waves.add_impulse(animal.mesh.V[100], 1.0, 0.06)
        waves.step(0.2)
        return waves.height.tobytes() + waves.velocity.tobytes()

    assert run() == run()


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


def test_impulses_on_the_same_texels_add_up(backend: str) -> None:
    atlas = sphere_atlas(1.0, 16)
    once, twice = (WaveSolver(atlas, backend=backend) for _ in range(2))
    once.add_impulse([0, 0, 1], 3.0, 0.4)
    for _ in range(3):
        twice.add_impulse([0, 0, 1], 1.0, 0.4)
    np.testing.assert_allclose(once.velocity, twice.velocity, rtol=1e-5, atol=1e-6)


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


MATERIAL = Material(speed=0.7, stiffness=30.0, viscosity=1e-3, density=2.0, yield_height=2e-3)


def hit(backend: str, material: Material = MATERIAL) -> WaveSolver:
    """Waves under a held force, with a dent and an impulse that came last."""
    waves = WaveSolver(sphere_atlas(1.0, 12), material, backend=backend, conserve_volume=False)
    waves.add_impulse([0, 0, 1], 0.4, 0.4)
    waves.add_force([1, 0, 0], 0.3, 0.4)
    waves.step(0.21)
    waves.add_impulse([0, 1, 0], 0.1, 0.4)
    return waves


def bits(waves: WaveSolver) -> tuple[bytes, ...]:
    return waves.height.tobytes(), waves.velocity.tobytes(), waves.dent.tobytes()


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda waves: pickle.loads(pickle.dumps(waves))]
)
def test_a_copy_continues_like_the_original_bit_for_bit(
    backend: str, copied: Callable[[WaveSolver], WaveSolver]
) -> None:
    waves = hit(backend)
    twin = copied(waves)
    untouched = copied(waves)
    assert np.abs(waves.dent).max() > 1e-3
    before = bits(untouched)
    for each in (waves, twin):
        each.step(0.3)
        each.add_impulse([0, 1, 1], 0.2, 0.3)
        each.step(0.1)
    assert bits(twin) == bits(waves)
    assert (twin.time, twin.substeps_taken, twin.energy()) == (
        waves.time,
        waves.substeps_taken,
        waves.energy(),
    )
    assert bits(untouched) == before


def test_a_dent_stays_to_the_last_bit_in_a_surface_that_does_not_yield(backend: str) -> None:
    waves = hit(backend)
    dent = waves.dent
    elastic = WaveSolver(waves.atlas, Material(speed=0.7, stiffness=30.0), backend=backend)
    elastic.state = waves.state
    assert (elastic.height == waves.height).all()
    elastic.step(0.4)
    assert (elastic.dent == dent).all()
    elastic.height = 0.0
    assert not elastic.dent.any()


def test_clamped_and_rigid_texels_keep_only_their_dent(backend: str) -> None:
    waves = hit(backend)
    z = waves.atlas.positions[..., 2]
    other = WaveSolver(
        waves.atlas, Material(speed=np.where(z < 0, 0.0, 1.0), fixed=z > 0.5), backend=backend
    )
    other.state = waves.state
    rigid = ~other.operator.movable
    assert not other.velocity[rigid].any()
    before = other.height
    other.step(0.4)
    assert (other.height == before)[rigid].all()
    assert (other.height == other.dent)[z > 0.5].all()


def test_the_state_of_another_resolution_is_refused() -> None:
    waves = WaveSolver(sphere_atlas(1.0, 8), backend="cpu")
    with pytest.raises(SolverError, match=r"shape \(6, 8, 8\), got \(6, 12, 12\)"):
        waves.state = hit("cpu").state


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


PLAIN = Material(speed=1.0, density=3.0)


@pytest.mark.parametrize(
    "material", [PLAIN, dataclasses.replace(PLAIN, yield_height=2e-3)], ids=["elastic", "dents"]
)
def test_crests_are_the_greatest_height_of_all_steps(
    animal: Atlas, backend: str, material: Material
) -> None:
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
