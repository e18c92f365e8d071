"""Sources leave the volume of each part of the surface as it is; the stable time step, and one substep."""

import numpy as np
import pytest
from hand_made import square, two_squares

from ripple_sim.solver import Atlas, Load, Material, TexelMesh, WaveSolver, sphere_atlas, texel_atlas
from ripple_sim.solver.operator import WaveOperator, build_operator, step_coefficients


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


def parts(texels: TexelMesh, **coefficients: object) -> np.ndarray | None:
    return build_operator(texel_atlas(texels), Material(**coefficients), "fem").parts


def columns(*values: float) -> np.ndarray:
    """A field of the square whose columns have the given values, 12 in all."""
    return np.broadcast_to(np.repeat(values, 12 // len(values)), (1, 12, 12)).copy()


def test_what_springs_or_a_clamp_hold_is_one_part() -> None:
    speed = columns(1, 1, 0, 1)
    assert parts(square(12), speed=speed, stiffness=5.0) is None
    held_left = columns(1, 0, 0, 0) > 0
    found = parts(square(12), speed=speed, fixed=held_left)
    assert found is not None
    assert len(np.unique(found[0, :, 9:])) == 1 and found[0, 0, 4] != found[0, 0, 10]
    # a clamp does not cut, unless it is all that there is in between
    assert parts(square(12), fixed=columns(0, 0, 1, 0) > 0) is None


SHAPE = (1, 4, 4)


def operator(damping: float = 0.0, stiffness: float = 0.0, mass: float = 2.0) -> WaveOperator:
    stencil = square(4).stencil(np.ones(SHAPE))
    return WaveOperator(stencil, np.full(SHAPE, mass), np.full(SHAPE, damping), np.full(SHAPE, stiffness))


@pytest.mark.parametrize("rate", [0.01, 0.3, 2.0])
def test_damping_decays_as_the_exponential_to_third_order(rate: float) -> None:
    dt = np.array([0.4, 0.2]) / rate
    decay = [float(step_coefficients(operator(damping=rate), each).decay) for each in dt]
    errors = abs(decay - np.exp(-rate * dt))
    assert errors[0] / errors[1] == pytest.approx(8, rel=0.2)


@pytest.mark.parametrize("half", [1.0, 1.5, 40.0])
def test_strong_damping_lets_the_velocity_change_its_sign_no_more(half: float) -> None:
    dt, zeta = 0.1, 20 * half
    kick = step_coefficients(operator(damping=zeta), dt)
    assert kick.decay == 0
    # what a force sustains against the damping
    assert kick.span == pytest.approx(1 / zeta, rel=1e-6)
    # weaker damping is the centred scheme
    weaker = step_coefficients(operator(damping=19.9), 0.1)
    assert weaker.decay == np.float32((1 - 0.995) / (1 + 0.995)) and weaker.span == np.float32(0.1 / 1.995)
