"""Scripted events happen when and where the scene says; the hook is called at every step; seeds decide chance."""

from pathlib import Path

import numpy as np
import pytest

from ripple_sim.errors import SceneError
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.simulation import Simulation

MJCF = """<mujoco><compiler angle="degree"/><option timestep="0.002" gravity="0 0 0"/><worldbody>
<body pos="0 0 1" euler="0 0 90">
<geom name="egg" type="ellipsoid" size="0.3 0.2 0.2" pos="0.1 0 0" euler="0 90 0"/></body>
<body name="stone" pos="0 0 3"><freejoint/><geom name="stone" size="0.05" mass="0.2"/></body>
<body name="brick" pos="2 0 3"><freejoint/><geom name="brick" type="box" size="0.1 0.1 0.1"/></body>
<body name="post" pos="0 3 0"><joint name="post" type="slide" axis="0 0 1"/><geom name="post" size="0.05"/></body>
</worldbody>
<actuator><position name="lift" joint="post" kp="100" kv="20"/></actuator></mujoco>"""
TOML = """model = "scene.xml"
[[ripple]]
geom = "egg"
resolution = 24
material = {speed = 0.5, density = 10.0, stiffness = 100.0}
"""


def simulation(folder: Path, script: str, **options) -> Simulation:
    (folder / "scene.xml").write_text(MJCF)
    (folder / "scene.toml").write_text(TOML + script)
    return Simulation(load_scene(folder / "scene.toml"), fps=100, backend="cpu", **options)


def test_poke_presses_at_its_point_of_the_bodys_frame(tmp_path: Path) -> None:
    sim = simulation(
        tmp_path,
        """[[poke]]
        geom = "egg"
        time = 0.05
        point = [0.3, 0.0, 0.0]
        impulse = 0.02
        radius = 0.05
        """,
    )
    for _ in range(5):
        sim.advance_frame()
    assert not sim.ripples["egg"].velocity.any()
    sim.advance_frame()
    waves = sim.ripples["egg"]
    # the geom's z axis is the body's x axis, and its middle is at x = 0.1: the point is its pole at z = 0.2
    deepest = waves.atlas.positions.reshape(-1, 3)[waves.height.argmin()]
    assert np.linalg.norm(deepest - [0, 0, 0.2]) < 0.03


def test_changed_material_keeps_the_waves_and_changes_what_follows(tmp_path: Path) -> None:
    poke = '[[poke]]\ngeom = "egg"\ntime = 0\npoint = [0.3, 0, 0]\nimpulse = 0.02\n'
    change = '[[change]]\ngeom = "egg"\ntime = 0.1\nmaterial = {damping = 50.0}\n'
    plain, damped = (simulation(tmp_path, script) for script in (poke, poke + change))
    for number in range(30):
        plain.advance_frame()
        damped.advance_frame()
        same = np.array_equal(plain.ripples["egg"].height, damped.ripples["egg"].height)
        assert same == (number < 10)
    assert damped.ripples["egg"].material.speed == 0.5
    assert damped.ripples["egg"].time == pytest.approx(0.3)
    assert damped.ripples["egg"].energy() < 0.05 * plain.ripples["egg"].energy()


def test_control_moves_an_actuator_from_its_time_on(tmp_path: Path) -> None:
    sim = simulation(tmp_path, '[[control]]\nactuator = "lift"\ntime = 0.1\nvalue = 0.2\n')
    for _ in range(10):
        sim.advance_frame()
    assert sim.data.body("post").xpos[2] == 0
    for _ in range(150):
        sim.advance_frame()
    assert sim.data.body("post").xpos[2] == pytest.approx(0.2, abs=0.01)


def test_still_disc_carries_no_waves(tmp_path: Path) -> None:
    still = "[[ripple.still]]\npoint = [0.1, 0.0, 0.3]\nradius = 0.08\n"
    poke = '[[poke]]\ngeom = "egg"\ntime = 0\npoint = [0.3, 0, 0]\nimpulse = 0.02\n'
    hit = '[[poke]]\ngeom = "egg"\ntime = 0.1\npoint = [0.1, 0.0, 0.3]\nimpulse = 0.02\n'
    sim = simulation(tmp_path, still + poke + hit)
    for _ in range(60):
        sim.advance_frame()
    waves = sim.ripples["egg"]
    centre = sim.ripples.to_geom("egg", [0.1, 0.0, 0.3])
    distance = np.linalg.norm(waves.atlas.positions - centre, axis=-1)
    around = np.abs(waves.height[(distance > 0.1) & (distance < 0.14)]).max()
    assert around > 0
    assert not waves.height[distance < 0.03].any()
    assert np.abs(waves.height[distance < 0.07]).max() < 0.1 * around  # at this resolution a texel is 30 mm wide


def test_hook_is_called_before_every_step(tmp_path: Path) -> None:
    times = []
    sim = simulation(tmp_path, "", on_step=lambda running: times.append(running.data.time))
    for _ in range(2):
        sim.advance_frame()
    np.testing.assert_allclose(times, 0.002 * np.arange(10), atol=1e-12)


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ('[[poke]]\ngeom = "stone"\ntime = 0\npoint = [0, 0, 0]\nimpulse = 1', "rippling geoms are 'egg'"),
        ('[[poke]]\ngeom = "egg"\ntime = 0\npoint = [0, 0, 0]\nimpulse = nan', "valid are numbers up to"),
        ('[[poke]]\ngeom = "egg"\ntime = -1\npoint = [0, 0, 0]\nimpulse = 1', "time -1"),
        ('[[poke]]\ngeom = "egg"\nforce = 1', r"unknown key 'force' in \[poke\]; valid are geom, time, point, impulse"),
        ('[[throw]]\nbody = "stone"\ntime = 0', "missing required field `velocity`"),
        ('[[throw]]\nbody = "post"\ntime = 0\nvelocity = [0, 0, 1]', "has no <freejoint/>"),
        ('[[place]]\nbody = "stone"\ntime = 0\nposition = [0, 0, 0]\norientation = [0, 0, 0, 0]', "not 0"),
        ('[[change]]\ngeom = "egg"\ntime = 0\nmaterial = {sped = 1}', r"\[change.material\]; valid are speed"),
        ("[random]\nsize = [2.0, 1.0]", "lower one first"),
        ('[random]\nshapes = ["cone"]', "valid are sphere, box"),
        ('[random]\nbodies = ["post"]', "free bodies are stone, brick"),
        ("[random]\nseeds = 1", r"unknown key 'seeds' in \[random\]; valid are seed, position"),
        ("[[ripple.still]]\npoint = [0, 0, 0]\nradius = 0", "radius 0"),
    ],
)
def test_wrong_events_are_refused_with_what_is_valid(tmp_path: Path, script: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        simulation(tmp_path, script)
