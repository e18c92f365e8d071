"""Absorbing regions swallow pulses."""

import numpy as np
import pytest

from ripple_sim.solver import Material, SolverError, WaveSolver, absorbing_damping, sphere_atlas


def test_absorbing_cap_swallows_a_pulse() -> None:
    atlas = sphere_atlas(1.0, 96)
    angle = np.arccos(np.clip(atlas.positions[..., 2], -1, 1))
    goal = 1e-2
    # kinetic energy outside the cap when the pulse is back where it began; half of a wave's energy is kinetic
    energies = {}
    for kind, damping in {
        "none": 0.0,
        "graded": absorbing_damping(atlas, angle > 2.0, speed=1.0, reflection=goal),
        "abrupt": np.where(angle > 2.0, 200.0, 0.0),
    }.items():
        waves = WaveSolver(atlas, Material(damping=damping), backend="cpu")
        pulse = np.exp(-(((angle - 1.2) / 0.12) ** 2))
        waves.height, waves.velocity = pulse, 2 * (angle - 1.2) / 0.12**2 * pulse
        start = waves.energy()
        waves.step(2 * (np.pi - 1.2))
        moving = (waves.operator.mass * waves.velocity**2)[angle < 2.0].sum()
        energies[kind] = moving / start
    assert energies["none"] > 0.9
    assert np.sqrt(energies["graded"]) < 2.5 * goal
    # what a wall of strong damping throws back
    assert energies["abrupt"] > 100 * energies["graded"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"region": np.zeros((6, 8, 8), bool)}, "holds 0 of 384 texels"),
        ({"region": np.ones((6, 8, 8), bool)}, "holds 384 of 384 texels"),
        ({"region": np.zeros((6, 8, 8))}, "float64"),
        ({"reflection": 1.5}, "reflection is 1.5"),
        ({"speed": 0.0}, "speed is 0.0"),
        ({"width": -1.0}, "width is -1.0"),
    ],
)
def test_bad_absorbers_are_named(arguments: dict, message: str) -> None:
    atlas = sphere_atlas(1.0, 8)
    with pytest.raises(SolverError, match=message):
        absorbing_damping(atlas, **({"region": atlas.positions[..., 2] > 0, "speed": 1.0} | arguments))
