"""`Material.suited`: waves have the requested height, speed and decay at every scale."""

import numpy as np
import pytest

from ripple_sim.solver import Material, SolverError, WaveSolver, sphere_atlas
from ripple_sim.solver.operator import density_after, density_for, stiffness_under

SIZES = [1e-3, 0.02, 1.0, 30.0, 1e3]


def deepest(waves: WaveSolver, seconds: float, steps: int) -> float:
    """The deepest dent in a time [m]."""
    least = 0.0
    for _ in range(steps):
        waves.step(seconds / steps)
        least = min(least, float(waves.height.min()))
    return -least


@pytest.mark.parametrize("size", SIZES)
def test_a_hit_makes_the_dent_that_was_asked_for_and_its_waves_cross_and_die_in_time(
    size: float,
) -> None:
    atlas = sphere_atlas(size / 2, 48)
    material = Material.suited(
        size, 0.3 * size**3.5, radius=0.12 * size, amplitude=0.03, crossing=0.5, decay=1.5
    )
    waves = WaveSolver(atlas, material, backend="cpu")
    waves.add_impulse([0, 0, size / 2], 0.3 * size**3.5, 0.12 * size)
    # stiffness and viscosity take a little off the dent of a free membrane
    dent = deepest(waves, 0.1, 50)
    assert 0.02 * size < dent < 0.031 * size
    # the front is half-way round in half the circumference over the speed
    far = waves.atlas.positions[..., 2] < -0.45 * size
    assert np.abs(waves.height[far]).max() < 1e-3 * dent
    deepest(waves, np.pi / 2 * 0.5 + 0.1, 100)
    assert np.abs(waves.height[far]).max() > 1e-2 * dent
    waves.step(1.5)
    assert np.abs(waves.height).max() < 0.1 * dent


def test_scaled_worlds_have_scaled_waves() -> None:
    shares = []
    for size in SIZES:
        waves = WaveSolver(
            sphere_atlas(size / 2, 16), Material.suited(size, 0.3 * size**3.5), backend="cpu"
        )
        waves.add_impulse([0, 0, size / 2], 0.3 * size**3.5, 0.3 * size)
        waves.step(0.3)
        shares.append(waves.height / size)
    for share in shares[1:]:
        np.testing.assert_allclose(share, shares[0], atol=2e-4 * np.abs(shares[0]).max())


def test_a_body_and_its_impulse_are_the_same_hit_unless_it_is_too_heavy_to_rest() -> None:
    light = Material.suited(1.0, (0.5, 4.0))
    as_impulse = Material.suited(1.0, 3.0)
    assert (light.density, light.stiffness) == (as_impulse.density, as_impulse.stiffness)
    slow = Material.suited(1.0, (50.0, 0.01))
    assert slow.stiffness > 10 * as_impulse.stiffness


@pytest.mark.parametrize(
    ("size", "hit", "message"),
    [
        (0.0, 1.0, "size must be .*, got 0.0 m"),
        (1.0, -1.0, "hit must be .*, got -1.0 N s"),
        (1.0, (1.0, np.inf), "speed of the hit must be .*, got inf m/s"),
        (1.0, (1.0, 2.0, 3.0), "must be an impulse"),
    ],
)
def test_invalid_sizes_and_hits_are_refused(size: float, hit: object, message: str) -> None:
    with pytest.raises(SolverError, match=message):
        Material.suited(size, hit)


def test_a_load_sinks_at_most_to_the_depth_that_chose_the_stiffness() -> None:
    atlas = sphere_atlas(1.0, 64)
    force = 20.0
    radius = 0.2
    density = 40.0
    speed = 1.0
    depth = 0.02
    stiffness = stiffness_under(force, depth, radius=radius, density=density, speed=speed)
    material = Material(speed=speed, damping=40.0, stiffness=stiffness, density=density)
    waves = WaveSolver(atlas, material, backend="cpu", conserve_volume=False)
    waves.add_force([0, 0, 1], force, radius)
    waves.step(3.0)
    assert 0.5 * depth < -waves.height.min() <= depth
    assert stiffness_under(0.0, depth, radius=radius, density=density, speed=speed) == 0.0
    # without tension the springs under the footprint bear the load alone
    alone = stiffness_under(force, depth, radius=radius, density=density, speed=0.0)
    assert alone == pytest.approx(10 * force / (2 * np.pi * density * radius**2 * depth))


def test_the_density_after_a_hit_keeps_the_dent_within_a_factor_of_two_of_the_depth() -> None:
    atlas = sphere_atlas(1.0, 64)
    impulse = 1.0
    pulse = 0.02
    radius = 0.2
    speed = 2.0
    stiffness = 500.0
    depth = 0.01
    density = density_after(
        impulse, depth, duration=pulse, radius=radius, speed=speed, stiffness=stiffness
    )
    waves = WaveSolver(
        atlas,
        Material(speed=speed, stiffness=stiffness, density=density, damping=0.0),
        backend="cpu",
    )
    waves.add_force([0, 0, 1], impulse / pulse, radius)
    dent = deepest(waves, pulse, 10)
    waves.pressure = 0.0
    dent = max(dent, deepest(waves, 0.2, 50))
    assert 0.5 * depth < dent < 2 * depth


def test_the_density_of_a_free_membrane_gives_the_dent() -> None:
    density = density_for(1.0, 0.02, radius=0.2, speed=2.0)
    membrane = Material(speed=2.0, density=density)
    waves = WaveSolver(sphere_atlas(1.0, 64), membrane, backend="cpu", conserve_volume=False)
    waves.add_impulse([0, 0, 1], 1.0, 0.2)
    assert deepest(waves, 0.1, 100) == pytest.approx(0.02, rel=0.15)
