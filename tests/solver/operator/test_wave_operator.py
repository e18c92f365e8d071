"""The stable time step, the parts of a surface that float freely, and the kick of one substep."""

import dataclasses

import numpy as np
import pytest
from hand_made import square, two_squares

from ripple_sim.solver import Atlas, Material, TexelMesh, WaveSolver, texel_atlas
from ripple_sim.solver.operator.assembly import build_operator
from ripple_sim.solver.operator.wave_operator import WaveOperator, number_or_field, step_coefficients


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


@pytest.mark.parametrize("coefficients", [{}, {"speed": 0.0, "bending": 1.0}, {"speed": columns(1, 2, 3)}])
def test_a_surface_in_one_piece_has_no_parts(coefficients: dict) -> None:
    assert parts(square(12), **coefficients) is None


def test_the_parts_of_a_mesh_are_parts() -> None:
    found = parts(two_squares(4))
    assert found is not None and found.dtype == np.int32
    assert (found[0] == 0).all() and (found[1] == 1).all()


def test_rigid_texels_cut_a_surface_up() -> None:
    found = parts(square(12), speed=columns(1, 1, 0, 1))
    assert found is not None
    assert (found[0, :, :6] == 0).all() and (found[0, :, 9:] == 1).all()


def test_what_springs_or_a_clamp_hold_is_one_part() -> None:
    speed = columns(1, 1, 0, 1)
    assert parts(square(12), speed=speed, stiffness=5.0) is None
    held_left = columns(1, 0, 0, 0) > 0
    found = parts(square(12), speed=speed, fixed=held_left)
    assert found is not None
    assert len(np.unique(found[0, :, 9:])) == 1 and found[0, 0, 4] != found[0, 0, 10]
    # a clamp does not cut, unless it is all that there is in between
    assert parts(square(12), fixed=columns(0, 0, 1, 0) > 0) is None


def test_a_plate_holds_together_where_it_bends() -> None:
    found = parts(square(12), speed=0.0, bending=columns(1, 1, 0, 1))
    assert found is not None and found[0, 0, 0] != found[0, 0, 11]


SHAPE = (1, 4, 4)


def operator(damping: float = 0.0, stiffness: float = 0.0, mass: float = 2.0) -> WaveOperator:
    stencil = square(4).stencil(np.ones(SHAPE))
    return WaveOperator(stencil, np.full(SHAPE, mass), np.full(SHAPE, damping), np.full(SHAPE, stiffness))


@pytest.mark.parametrize(("damping", "stiffness"), [(0.0, 9.0), (0.7, 9.0), (30.0, 4.0)])
def test_kicks_and_drifts_are_the_centred_difference_scheme(damping: float, stiffness: float) -> None:
    dt, force, mass = 0.05, 1.3, 2.0
    kick = step_coefficients(operator(damping, stiffness, mass), dt)
    height, velocity, heights = 1.0, 0.4, [1.0]
    for _ in range(50):
        velocity = kick.decay * velocity + kick.gain[0, 1, 1] * force - kick.spring * height
        height += dt * velocity
        heights.append(height)
    before, now, after = (np.array(heights[i : len(heights) - 2 + i]) for i in range(3))
    acceleration, speed = (after - 2 * now + before) / dt**2, (after - before) / (2 * dt)
    np.testing.assert_allclose(acceleration + damping * speed + stiffness * now, force / mass, atol=2e-4)


def test_without_damping_a_lone_texel_swings_for_ever_at_the_leapfrogs_frequency() -> None:
    dt, k = 0.1, 25.0
    spring = float(step_coefficients(operator(stiffness=k), dt).spring)
    phase = np.arccos(1 - k * dt**2 / 2)
    # from the extremum: half a kick first
    height, velocity, heights = 1.0, spring / 2, []
    for _ in range(200):
        velocity -= spring * height
        height += dt * velocity
        heights.append(height)
    np.testing.assert_allclose(heights, np.cos(phase * np.arange(1, 201)), atol=1e-4)


@pytest.mark.parametrize("rate", [0.01, 0.3, 2.0])
def test_damping_decays_as_the_exponential_to_third_order(rate: float) -> None:
    errors = [
        abs(float(step_coefficients(operator(damping=rate), dt).decay) - np.exp(-rate * dt))
        for dt in (0.4 / rate, 0.2 / rate)
    ]
    assert errors[0] / errors[1] == pytest.approx(8, rel=0.2)


@pytest.mark.parametrize("damping", [0.0, 1e3, 1e9])
def test_no_damping_makes_a_velocity_grow(damping: float) -> None:
    assert abs(step_coefficients(operator(damping=damping), 1.0).decay) <= 1


def test_clamped_texels_take_no_force_and_no_source() -> None:
    fixed = np.zeros(SHAPE, bool)
    fixed[0, 1, 2] = True
    kick = step_coefficients(dataclasses.replace(operator(), fixed=fixed), 0.1)
    np.testing.assert_allclose(kick.gain, np.where(fixed, 0, 0.1 / 2.0), rtol=1e-6)
    np.testing.assert_allclose(kick.span, np.where(fixed, 0, 0.1), rtol=1e-6)


def test_sources_move_nothing_where_nothing_pulls_back() -> None:
    coefficient = np.ones(SHAPE)
    coefficient[:, :, 2:] = 0
    rigid = dataclasses.replace(operator(), stencil=square(4).stencil(coefficient))
    span = np.broadcast_to(step_coefficients(rigid, 0.1).span, SHAPE)
    np.testing.assert_allclose(span[..., :2], 0.1, rtol=1e-6)
    assert not span[..., 2:].any()
    assert (step_coefficients(rigid, 0.1).gain > 0).all()


def test_a_field_of_one_value_is_a_number_and_the_kick_is_in_float32() -> None:
    assert number_or_field(np.full(SHAPE, 0.1)) == np.float32(0.1)
    varied = np.full(SHAPE, 0.1)
    varied[0, 3, 3] = 0.2
    field = number_or_field(varied)
    assert isinstance(field, np.ndarray) and field.dtype == np.float32
    np.testing.assert_array_equal(field, varied.astype(np.float32))
    # NaN equals nothing, not even itself: it must not be lost in a number
    assert isinstance(number_or_field(np.array([[[np.nan, 1.0]]])), np.ndarray)
    kick = step_coefficients(operator(damping=0.3, stiffness=2.0), 0.1)
    assert kick.gain.shape == SHAPE and kick.gain.dtype == np.float32
    assert all(type(each) is np.float32 for each in (kick.decay, kick.spring, kick.span))


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
