"""Sources keep the volume of each part; the stable time step, and one substep."""

import copy

import numpy as np
import pytest
from hand_made import square, two_squares
from scipy.spatial import Delaunay
from scipy.special import jn_zeros, jv

from ripple_sim.solver import (
    Atlas,
    Load,
    Material,
    Mesh,
    SolverError,
    TexelMesh,
    WaveSolver,
    build_atlas,
    sphere_atlas,
    texel_atlas,
)
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
def test_the_volume_stays_while_waves_run_through_uneven_density(
    backend: str, coefficients: dict
) -> None:
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


def test_sources_on_one_part_of_a_mesh_leave_other_parts_at_rest(backend: str) -> None:
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
    assert np.abs(waves._backend.fields.height()).max() < 1e3
    waves.reset()
    waves.height = noise
    with np.errstate(over="ignore", invalid="ignore"):
        waves._backend.advance(3000, 1.05 * waves.stable_timestep)
    assert not np.abs(waves._backend.fields.height()).max() < 1e3


def parts(texels: TexelMesh, **coefficients: object) -> np.ndarray | None:
    return build_operator(texel_atlas(texels), Material(**coefficients), "fem").parts


def columns(*values: float) -> np.ndarray:
    """A field of the square whose columns have the given values, 12 in all."""
    return np.broadcast_to(np.repeat(values, 12 // len(values)), (1, 12, 12)).copy()


def test_springs_or_a_clamp_hold_one_part_alone() -> None:
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
    return WaveOperator(
        stencil, np.full(SHAPE, mass), np.full(SHAPE, damping), np.full(SHAPE, stiffness)
    )


@pytest.mark.parametrize("rate", [0.01, 0.3, 2.0])
def test_damping_decays_as_the_exponential_to_third_order(rate: float) -> None:
    dt = np.array([0.4, 0.2]) / rate
    decay = [float(step_coefficients(operator(damping=rate), each).decay) for each in dt]
    errors = abs(decay - np.exp(-rate * dt))
    assert errors[0] / errors[1] == pytest.approx(8, rel=0.2)


@pytest.mark.parametrize("half", [1.0, 1.5, 40.0])
def test_strong_damping_lets_the_velocity_change_its_sign_no_more(half: float) -> None:
    dt = 0.1
    zeta = 20 * half
    kick = step_coefficients(operator(damping=zeta), dt)
    assert kick.decay == 0
    # what a force sustains against the damping
    assert kick.span == pytest.approx(1 / zeta, rel=1e-6)
    # weaker damping is the centred scheme
    weaker = step_coefficients(operator(damping=19.9), 0.1)
    assert weaker.decay == np.float32((1 - 0.995) / (1 + 0.995)) and weaker.span == np.float32(
        0.1 / 1.995
    )


def field(atlas: Atlas, inside: object, value: float = 1.0) -> np.ndarray:
    """A value at some texels of an atlas, 0 elsewhere."""
    values = np.zeros(atlas.areas.shape)
    values[inside] = value
    return values


SHEET = texel_atlas(square(12))
SPHERE = sphere_atlas(1.0, 8)
SHEETS = texel_atlas(two_squares(8))
PLATE = Material.plate(2e11, 1e-3, 7800.0)
SPRINGS = Material(stiffness=3.0)


@pytest.mark.parametrize(
    ("atlas", "material", "rim", "kept"),
    [
        (SHEET, Material(), "free", [True]),
        (SHEET, Material(), "fixed", [False]),
        (SHEET, Material(), "supported", [False]),
        (SHEET, Material(), lambda points: points[:, 0] < 0.1, [False]),
        (SHEET, PLATE, "free", [True]),
        (SHEET, PLATE, "supported", [False]),
        (SHEET, PLATE, "clamped", [False]),
        (SHEET, SPRINGS, "free", [False]),
        (SHEET, Material(stiffness=field(SHEET, np.s_[0, 2, 3])), "free", [False]),
        (SHEET, Material(fixed=field(SHEET, np.s_[0, 3:6, 3:6]) > 0), "free", [False]),
        (SHEET, Material(speed=1 - field(SHEET, np.s_[0, 3:6, 3:6])), "free", [True]),
        (SPHERE, Material(), "free", [True]),
        (SPHERE, SPRINGS, "free", [True]),
        (SPHERE, Material(fixed=field(SPHERE, np.s_[0, 2:5, 2:5]) > 0), "free", [True]),
        (SHEETS, Material(), "fixed", [False, False]),
        (SHEETS, Material(stiffness=field(SHEETS, 0)), "free", [False, True]),
    ],
)
def test_volume_is_kept_by_default_where_a_surface_is_closed_or_nothing_holds_it(
    atlas: Atlas, material: Material, rim: object, kept: list[bool]
) -> None:
    waves = WaveSolver(atlas, material, rim=rim, backend="cpu")
    parts = (
        np.zeros(atlas.areas.shape, int) if waves.operator.parts is None else waves.operator.parts
    )
    assert waves.conserve_volume == any(kept)
    waves.velocity = 0.0
    waves.add_velocity(1.0 + atlas.positions[..., 0])
    for part, keeps in enumerate(kept):
        rate = abs((atlas.areas * waves.velocity)[parts == part].sum())
        assert (rate < 1e-5) == keeps
    for conserve in (True, False):
        waves.conserve_volume = conserve
        assert waves.conserve_volume == conserve
    waves.conserve_volume = None
    assert waves.conserve_volume == any(kept)


def test_invalid_conserve_volume_is_refused() -> None:
    with pytest.raises(SolverError, match="conserve_volume must be True, False or None"):
        WaveSolver(SHEET, backend="cpu", conserve_volume="auto")


def test_copies_and_states_take_over_a_change_of_conserve_volume(backend: str) -> None:
    waves = WaveSolver(SHEETS, Material(stiffness=field(SHEETS, 0)), backend=backend)
    twin = copy.copy(waves)
    for each in (waves, twin):
        each.add_impulse([0.3, 0.4, 0.0], 1.0, 0.2)
        each.add_impulse([0.3, 0.4, 1.0], 1.0, 0.2)
        each.step(0.3)
    np.testing.assert_array_equal(waves.velocity, twin.velocity)
    rates = (waves.atlas.areas * waves.velocity).sum(axis=(1, 2))
    assert abs(rates[1]) < 1e-6 < abs(rates[0])


def test_a_drum_is_heard_with_the_fundamental_of_its_closed_form(backend: str) -> None:
    """Within 0.2 dB wherever it is hit; without the mean, 0.7 of the radius lost 24 dB."""
    radius = 0.16
    density = 0.26
    impulse = 1e-2
    angles = 2 * np.pi * np.arange(64) / 64
    rings = np.arange(1, 17) / 16
    points = [[0, 0, 0], *((r * np.cos(a), r * np.sin(a), 0) for r in rings for a in angles)]
    V = radius * np.array(points, float)
    F = Delaunay(V[:, :2]).simplices
    atlas = build_atlas(Mesh.from_arrays(V, F), resolution=24, cache=False)
    zero = jn_zeros(0, 1)[0]
    mode = jv(0, zero * np.linalg.norm(atlas.positions, axis=-1) / radius)
    for place in (0.0, 0.25, 0.45, 0.6, 0.7):
        waves = WaveSolver(
            atlas, Material(speed=61.4, density=density), rim="fixed", backend=backend
        )
        waves.add_impulse([place * radius, 0, 0], impulse, 0.05 * radius)
        mass = waves.operator.mass
        amplitude = (mass * mode * waves.velocity).sum() / (mass * mode**2).sum()
        exact = -impulse / (density * np.pi * radius**2) * jv(0, zero * place) / jv(1, zero) ** 2
        assert abs(20 * np.log10(amplitude / exact)) < 0.2
