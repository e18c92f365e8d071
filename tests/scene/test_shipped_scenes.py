"""The shipped scenes: what is to be hit is hit, ripples can be seen and are not absurd, and no step is too long."""

import warnings

import numpy as np
import pytest

from ripple_sim.scene.load_scene import load_scene
from ripple_sim.scene.scene import shipped_scenes
from ripple_sim.scenes import shapes
from ripple_sim.simulation import Simulation

NAMES = [
    "animal",
    "arm",
    "drum",
    "duck",
    "finger",
    "heavy",
    "jelly",
    "kick",
    "pair",
    "pretzel",
    "rolling",
    "skull",
    "sphere",
    "teapot",
    "terrain",
]


def test_scenes_are_shipped() -> None:
    assert set(NAMES) <= set(shipped_scenes())


@pytest.mark.parametrize("name", NAMES)
def test_targets_are_hit_and_ripple_visibly(name: str) -> None:
    scene = load_scene(name)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulation = Simulation(scene, fps=30, resolution=32, backend="cpu")
        hit, highest = set(), dict.fromkeys(simulation.ripples, 0.0)
        while simulation.data.time < min(scene.duration, 1.6):
            simulation.advance_frame()
            hit |= {impulse.geom for impulse in simulation.impulses}
            for target in highest:
                highest[target] = max(highest[target], float(np.abs(simulation.ripples[target].height).max()))
    assert hit == set(highest)
    for target, height in highest.items():
        size = float(np.ptp(simulation.ripples[target].atlas.mesh.V, axis=0).max())
        assert 0.005 < height / size < 0.25
    assert scene.duration <= 5


def test_eyes_of_the_animal_stay_still_while_its_head_ripples() -> None:
    simulation = Simulation(load_scene("animal"), fps=30, resolution=128, backend="cpu")
    waves = simulation.ripples["animal"]
    place = waves.atlas.positions
    away = np.min(
        [np.linalg.norm(place - simulation.ripples.to_geom("animal", eye.point), axis=-1)
         for eye in simulation.scene.targets[0].still],
        axis=0,
    )  # fmt: skip
    eyes, round_them = away < 0.016, (away > 0.045) & (away < 0.08)  # discs of 25 mm, texels of 4 mm
    assert eyes.sum() >= 2
    highest = 0.0
    for _ in range(24):
        simulation.advance_frame()
        assert np.abs(waves.height[eyes]).max() < 1e-4
        highest = max(highest, float(np.abs(simulation.ripples["animal"].height[round_them]).max()))
    assert highest > 0.002


def test_rolling_target_rolls_and_two_way_balls_hop() -> None:
    rolling = Simulation(load_scene("rolling"), fps=30, resolution=16, backend="cpu")
    kick = Simulation(load_scene("kick"), fps=30, resolution=48, backend="cpu")
    hop = 0.0
    for _ in range(45):
        rolling.advance_frame()
        kick.advance_frame()
        hop = max(hop, float(kick.data.body("ball_0").xpos[2]) - 0.29)
    assert np.linalg.norm(rolling.data.qvel[3:6]) > 2
    assert hop > 0.01


def test_shipped_animal_is_what_the_module_makes() -> None:
    V, F = shapes.limbed()
    lines = shapes.LIMBED_FILE.read_text().splitlines()
    vertices = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)
    triangles = np.array([line.split()[1:] for line in lines if line.startswith("f ")], dtype=int) - 1
    np.testing.assert_array_equal(triangles, F)
    np.testing.assert_allclose(vertices, V, rtol=1e-4, atol=1e-6)
