"""Sources leave the volume as it is, on each part of the surface."""

import numpy as np
import pytest
from hand_made import two_squares

from ripple_sim.solver import Load, Material, WaveSolver, sphere_atlas, texel_atlas


def volume_rate(waves: WaveSolver) -> float:
    """Sum of area times velocity, over that of area times speed."""
    rates = waves.atlas.areas * waves.velocity.astype(np.float64)
    return abs(rates.sum()) / np.abs(rates).sum()


def uneven(**coefficients: object) -> Material:
    """Ten times denser above than below, with a smooth part in between."""
    z = sphere_atlas(1.0, 16).positions[..., 2]
    return Material(density=1 + 9 * np.clip(z + 0.5, 0, 1), **coefficients)


def test_every_source_leaves_the_volume_alone_where_the_density_varies(backend: str) -> None:
    atlas = sphere_atlas(1.0, 16)
    bump = np.exp(-8 * (1 - atlas.positions[..., 2]))
    waves = WaveSolver(atlas, uneven(), backend=backend)
    waves.add_impulse([0, 0, 1], 1.0, 0.4)
    assert volume_rate(waves) < 1e-7
    waves.add_velocity(bump)
    assert volume_rate(waves) < 1e-6
    waves.add_height(bump)
    waves.add_force([1, 0, 0], 2.0, 0.4)
    waves.add_pressure(3 * bump)
    waves.step(0.2)
    assert volume_rate(waves) < 1e-6
    assert abs(waves.volume()) < 1e-6 * (atlas.areas * np.abs(waves.height)).sum()


@pytest.mark.parametrize(
    "coefficients",
    [{}, {"viscosity": 1e-2}, {"speed": 0.0, "bending": 1e-2}, {"stiffness": 20.0, "damping": 0.3}],
    ids=["tension", "viscosity", "bending", "springs"],
)
def test_the_volume_stays_while_waves_run_through_uneven_density(backend: str, coefficients: dict) -> None:
    waves = WaveSolver(sphere_atlas(1.0, 16), uneven(**coefficients), backend=backend)
    waves.add_impulse([0, 0.3, 1], 1.0, 0.5)
    for _ in range(5):
        waves.step(0.3)
        assert abs(waves.volume()) < 2e-5 * (waves.atlas.areas * np.abs(waves.height)).sum()


def test_keeping_the_volume_costs_no_energy() -> None:
    waves = WaveSolver(sphere_atlas(1.0, 16), uneven(), backend="cpu")
    waves.add_impulse([0, 0.3, 1], 1.0, 0.5)
    dt = waves.stable_timestep
    waves.step(dt)
    energy = waves.energy()
    for _ in range(10):
        waves.step(200 * dt, 200)
        assert waves.energy() == pytest.approx(energy, rel=1e-5)
    free = WaveSolver(sphere_atlas(1.0, 16), uneven(), backend="cpu")
    free.conserve_volume = False
    free.add_impulse([0, 0.3, 1], 1.0, 0.5)
    free.step(3.0)
    assert abs(free.volume()) > 0.1 * (free.atlas.areas * np.abs(free.height)).sum()


def test_what_is_done_to_one_part_of_a_mesh_leaves_the_others_at_rest(backend: str) -> None:
    atlas = texel_atlas(two_squares(12))
    waves = WaveSolver(atlas, Material(speed=1.0), backend=backend)
    waves.add_impulse([0.3, 0.4, 1.0], 1.0, 0.2)
    waves.add_force([0.6, 0.4, 1.0], 1.0, 0.2)
    waves.step(0.4)
    waves.add_height((atlas.positions[..., 2] > 0.5) * atlas.positions[..., 0])
    waves.add_velocity((atlas.positions[..., 2] > 0.5) * atlas.positions[..., 0])
    waves.step(0.1)
    assert not waves.height[0].any() and not waves.velocity[0].any()
    assert np.abs(waves.height[1]).max() > 0.1
    assert abs(waves.volume()) < 1e-6


def test_a_load_on_one_of_two_parts_may_end(backend: str) -> None:
    atlas = texel_atlas(two_squares(12))
    waves = WaveSolver(atlas, Material(speed=1.0), backend=backend)
    waves.step(0.1, load=Load(np.array([5]), np.array([1.0])))
    kinetic = np.abs(waves.velocity[0]).max()
    waves.step(0.1)
    assert not waves.height[1].any()
    assert 0 < np.abs(waves.velocity[0]).max() < 2 * kinetic


def test_an_island_among_rigid_texels_does_not_sink_under_a_load(backend: str) -> None:
    atlas = sphere_atlas(1.0, 24)
    angle = np.arccos(np.clip(atlas.positions[..., 2], -1, 1))
    moat = Material(speed=np.where((angle > 0.6) & (angle < 0.8), 0.0, 1.0), damping=2.0)
    waves = WaveSolver(atlas, moat, backend=backend)
    waves.add_force([0, 0, 1], 1.0, 0.3)
    waves.step(10.0)
    deepest = np.abs(waves.height).max()
    waves.step(10.0)
    assert np.abs(waves.height).max() == pytest.approx(deepest, rel=1e-3)
    assert not waves.height[angle > 0.8].any()


def test_lone_texels_on_springs_are_one_part() -> None:
    atlas = sphere_atlas(1.0, 8)
    waves = WaveSolver(atlas, Material(speed=0.0, stiffness=30.0), backend="cpu")
    waves.add_impulse([0, 0, 1], 1.0, 0.4)
    assert waves.operator.parts is None
    assert waves.velocity.min() < -1.0
    assert abs(waves.momentum()) < 1e-6
