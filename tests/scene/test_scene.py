"""Scene files: what is shipped loads, what is wrong is named."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from ripple_sim.errors import SceneError
from ripple_sim.scene.drop import drop_scene
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.scene.scene import shipped_scenes
from ripple_sim.scenes.shapes import peanut, write_obj
from ripple_sim.simulation import Simulation
from ripple_sim.solver import RippleError

MJCF = """<mujoco><worldbody><camera name="eye" pos="0 -3 1"/><geom name="floor" type="plane" size="1 1 1"/>
<geom name="egg" type="ellipsoid" size="0.3 0.2 0.2"/>
<body name="stone" pos="0 0 1"><freejoint/><geom name="stone" size="0.05"/></body></worldbody></mujoco>"""
TOML = """model = "scene.xml"
[camera]
name = "eye"
[[ripple]]
geom = "egg"
resolution = 16
[ripple.material]
speed = 0.5
[[drop]]
body = "stone"
time = 0.25
velocity = [0.5, 0.0, 0.0]
"""


def write(folder: Path, toml: str = TOML, mjcf: str = MJCF) -> Path:
    (folder / "scene.xml").write_text(mjcf)
    path = folder / "scene.toml"
    path.write_text(toml)
    return path


def test_every_shipped_scene_loads() -> None:
    assert "duck" in shipped_scenes()
    for name in shipped_scenes():
        scene = load_scene(name)
        assert scene.targets
        assert scene.duration > 0


def test_values_arrive_where_they_belong(tmp_path: Path) -> None:
    scene = load_scene(write(tmp_path))
    [entry] = scene.targets
    assert (entry.geom, entry.resolution, entry.material.speed) == ("egg", 16, 0.5)
    assert scene.camera.name == "eye"
    assert scene.name == "scene"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("speed = 0.5", "sped = 0.5", r"unknown key 'sped' in \[ripple.material\]; valid are speed, damping"),
        ("[camera]", "[kamera]", r"unknown key 'kamera'; valid are model, ripple"),
        ('body = "stone"', 'thing = "stone"', r"unknown key 'thing' in \[drop\]; valid are body, time"),
        ("speed = 0.5", 'speed = "fast"', r"ripple.*speed"),
        ("speed = 0.5", "speed = -1", r"speed is -1 m/s; valid"),
        ("[[ripple]]", "[[ripple", "not valid TOML"),
        ('geom = "egg"', 'geom = "eg"', "its geoms are 'floor', 'egg', 'stone'"),
        ('geom = "egg"', 'geom = "floor"', "is a plane, which cannot ripple"),
        ('geom = "egg"', 'geom = "egg"\nlook = "shiny"', "valid are .*rubber"),
        ('name = "eye"', 'name = "ear"', "its cameras are eye"),
        ('model = "scene.xml"', 'model = "other.xml"', "other.xml' does not exist"),
        ('body = "stone"', 'body = "rock"', "bodies are stone"),
        ("time = 0.25", "time = -1", "time -1"),
        ("time = 0.25", "time = nan", r"drop.time is nan; valid are numbers"),
        ("velocity = [0.5, 0.0, 0.0]", "velocity = [inf, 0.0, 0.0]", r"drop.velocity is inf"),
        ("speed = 0.5", "speed = 1e300", r"ripple.material.speed is 1e\+300"),
        ('geom = "egg"', 'geom = "egg"\ncolor = [0, 0, 300]', "three numbers from 0 to 1"),
        ('model = "scene.xml"', 'model = "scene.xml"\nduration = 0', "duration is 0"),
    ],
)
def test_mistakes_are_named_with_what_is_valid(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in TOML
    with pytest.raises(RippleError, match=message) as error:
        load_scene(write(tmp_path, TOML.replace(old, new)))
    assert "\n" not in str(error.value)


def test_mujocos_refusal_is_passed_on_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="MuJoCo refuses") as error:
        load_scene(write(tmp_path, mjcf=MJCF.replace('size="0.05"', 'size="-1"')))
    assert "\n" not in str(error.value)


def test_unknown_scene_lists_the_shipped_ones() -> None:
    with pytest.raises(SceneError, match="duck"):
        load_scene("goose")


def test_dropped_body_waits_then_falls(tmp_path: Path) -> None:
    simulation = Simulation(load_scene(write(tmp_path)), fps=100, backend="cpu")
    heights = []
    for _ in range(40):
        simulation.advance_frame()
        heights.append(float(simulation.data.body("stone").xpos[2]))
    times = (np.arange(40) + 1) / 100
    waiting = times < 0.25
    np.testing.assert_allclose(np.array(heights)[waiting], 1.0, atol=1e-3)
    # poses in data lag behind by the step that was just made
    fallen = times[-1] - simulation.model.opt.timestep - 0.25
    assert 1 - heights[-1] == pytest.approx(9.81 / 2 * fallen**2, abs=2e-3)
    assert simulation.data.body("stone").xpos[0] == pytest.approx(0.5 * fallen, abs=2e-3)


@pytest.mark.parametrize("fps", [24, 60, 1000])
def test_a_whole_number_of_physics_steps_makes_a_frame(tmp_path: Path, fps: int) -> None:
    simulation = Simulation(load_scene(write(tmp_path)), fps=fps, backend="cpu")
    for _ in range(5):
        simulation.advance_frame()
    assert simulation.data.time == pytest.approx(5 / fps, rel=1e-9)
    assert simulation.model.opt.timestep <= 0.002 + 1e-12


def test_drop_scene_stands_any_mesh_on_the_floor(tmp_path: Path) -> None:
    V, F = peanut()
    write_obj(tmp_path / "peanut.obj", 37.0 * V[:, [0, 2, 1]] * [1, 1, -1] + 5.0, F)
    scene = drop_scene(tmp_path / "peanut.obj", bodies=3, seed=1)
    data = mujoco.MjData(scene.model)
    mujoco.mj_forward(scene.model, data)
    simulation = Simulation(scene, fps=60, resolution=16, backend="cpu")
    mesh = simulation.ripples["target"].atlas.mesh
    world = mesh.V @ data.geom("target").xmat.reshape(3, 3).T + data.geom("target").xpos
    assert np.ptp(world, axis=0).max() == pytest.approx(1.0, rel=1e-5)
    assert world[:, 2].min() == pytest.approx(0.0, abs=1e-5)
    assert len(scene.events.drop) == 3
    hit = set()
    for _ in range(180):
        simulation.advance_frame()
        hit |= {impulse.other for impulse in simulation.impulses}
    assert hit == {"body_0", "body_1", "body_2"}


def test_drop_scene_is_the_same_for_the_same_seed(tmp_path: Path) -> None:
    write_obj(tmp_path / "peanut.obj", *peanut())
    first, second, other = (drop_scene(tmp_path / "peanut.obj", seed=seed) for seed in (3, 3, 4))
    assert [d.position for d in first.events.drop] == [d.position for d in second.events.drop]
    assert [d.position for d in first.events.drop] != [d.position for d in other.events.drop]


def test_drop_scene_refuses_wrong_numbers(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="0 to 100"):
        drop_scene(tmp_path / "any.obj", bodies=101)
