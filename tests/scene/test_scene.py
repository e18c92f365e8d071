"""Scene files: what is shipped loads, what is wrong is named.

A scene through another camera or with another exposure: what has no effect is refused.

Overlays by name: what is understood, and what is refused.

TOML files of any content become a table or one line that says what is wrong.
"""

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from ripple_sim.errors import SceneError
from ripple_sim.scene.drop import drop_scene
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.scene.scene import (
    NAMES,
    Request,
    Scene,
    parse_request,
    read_toml,
    through_camera,
    with_exposure,
)
from ripple_sim.scene.scene_file import CameraEntry, RippleEntry
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


MODEL = mujoco.MjModel.from_xml_string(
    """<mujoco><worldbody><camera name="eye" pos="0 -3 1"/><camera name="side" pos="3 0 1"/>
    <geom name="egg" size="0.1"/><body name="stone" pos="0 0 1"><geom size="0.05"/></body></worldbody></mujoco>"""
)


def scene(**camera: object) -> Scene:
    return Scene("still", MODEL, (RippleEntry(geom="egg"),), CameraEntry(**camera), 1.0)


def test_through_camera_changes_the_camera_alone_and_not_the_scene_itself() -> None:
    before = scene(shutter=180.0)
    after = through_camera(before, "side")
    assert after.camera == CameraEntry(name="side")
    assert before.camera == CameraEntry(shutter=180.0)
    assert dataclasses.replace(after, camera=before.camera).__dict__ == before.__dict__
    with pytest.raises(SceneError, match="no camera 'ear'; its cameras are eye, side"):
        through_camera(before, "ear")


def test_exposure_replaces_what_is_given_and_leaves_what_is_none() -> None:
    before = scene(azimuth=12.0, shutter=90.0, aperture=0.1, exposures=8)
    after = with_exposure(before, shutter=180, aperture=None, focus="stone", exposures=None)
    assert after.camera == CameraEntry(azimuth=12.0, shutter=180.0, aperture=0.1, focus="stone", exposures=8)
    assert with_exposure(before).camera == before.camera
    assert with_exposure(before, aperture=0.0).camera.aperture == 0.0, "0 is a value"


@pytest.mark.parametrize(
    ("camera", "changes", "message"),
    [
        ({}, {"shutter": "wide"}, r"camera: Expected `float`, got `str` - at `shutter`"),
        ({}, {"exposures": 2.5}, r"camera: .*`exposures`"),
        ({}, {"shutter": 400}, "shutter angle is 400"),
        ({}, {"focus": 1.0}, "a focus needs a lens: give the camera an aperture of more than 0 m"),
        ({"shutter": 180.0}, {"focus": "stone"}, "a focus needs a lens"),
        ({}, {"exposures": 16}, "all 16 exposures would be the same: give the camera a shutter angle"),
        ({"shutter": 180.0}, {"shutter": 0.0, "exposures": 2}, "all 2 exposures would be the same"),
    ],
)
def test_an_exposure_without_effect_or_sense_is_refused(camera: dict, changes: dict, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        with_exposure(scene(**camera), **changes)


def test_request_takes_every_name_and_ranges() -> None:
    request = parse_request([" height=0.02", "contacts", "grid", "time", "energy "])
    assert request == Request("height", 0.02, True, True, True, True)
    assert parse_request(["velocity"]) == Request(heatmap="velocity")
    assert not parse_request([])
    assert parse_request(["time"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["hight"], ", ".join(NAMES)),
        ([""], "valid are"),
        (["height", "velocity"], "choose one"),
        (["height=0"], "positive number"),
        (["height=wide"], "positive number"),
        (["velocity=inf"], "m/s"),
        (["time=3"], "has no range"),
    ],
)
def test_request_refuses(words: list[str], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        parse_request(words)


@pytest.mark.parametrize(
    "text, said",
    [
        (
            ".".join(["a"] * 200_000) + " = 1",
            r"plan '.*a\.toml' has a key of 200000 parts",
        ),  # tomllib would take half an hour
        ("[" + " . ".join(["'a'"] * 101) + "]", "has a key of 101 parts .*; valid are at most 100"),
        ("a = " + "9" * 5000, "is not valid TOML: Exceeds the limit"),
        ("a = " + "[" * 5000, "nested too deeply"),
        ("a", "is not valid TOML"),
        ("a = \ud800", "cannot be read"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(text.encode(errors="surrogatepass"))
    with pytest.raises(SceneError, match=said):
        read_toml(path, "plan")


def test_dots_in_numbers_paths_and_comments_are_no_keys(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(f"# {'.' * 300}\n# {'. ' * 300}\na = [{', '.join(['0.5'] * 300)}]\nb.c = '../../x.y'\n")
    assert read_toml(path, "plan") == {"a": [0.5] * 300, "b": {"c": "../../x.y"}}
