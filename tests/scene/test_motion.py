"""Scripted events happen when and where the scene says, to bodies and to waves."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scene_files import write_scene

from ripple_sim.errors import SceneError
from ripple_sim.scene import DropEntry, Events, PlaceEntry, Script, ThrowEntry, load_scene
from ripple_sim.simulation import Simulation

MJCF = """<mujoco><option timestep="0.002"/><worldbody>
<geom name="ground" type="plane" size="9 9 1"/>
<body name="post" pos="5 0 0"><joint type="hinge" axis="0 0 1"/><geom size="0.1"/></body>
<body name="wall" pos="6 0 0"><geom size="0.1"/></body>
<body name="stone" pos="0 0 3" quat="0.6 0 0.8 0"><freejoint/><geom size="0.1"/></body>
<body name="brick" pos="2 0 3"><freejoint/><geom type="box" size="0.1 0.2 0.1"/></body></worldbody>
</mujoco>"""


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(MJCF)


def script(model: mujoco.MjModel, *entries: DropEntry | ThrowEntry | PlaceEntry) -> Script:
    kinds = {"drop": DropEntry, "throw": ThrowEntry, "place": PlaceEntry}
    events = {
        name: [each for each in entries if type(each) is kind] for name, kind in kinds.items()
    }
    return Script(model, Events(**events), ())


def run(model: mujoco.MjModel, entries: list, seconds: float) -> mujoco.MjData:
    data = mujoco.MjData(model)
    motions = script(model, *entries)
    while data.time < seconds - 1e-9:
        motions.apply(data, {})
        mujoco.mj_step(model, data)
    return data


def applied(model: mujoco.MjModel, entry: DropEntry | ThrowEntry | PlaceEntry) -> mujoco.MjData:
    data = mujoco.MjData(model)
    script(model, entry).apply(data, {})
    return data


def velocity(data: mujoco.MjData, name: str) -> np.ndarray:
    """Angular and linear velocity of a body in the world."""
    found = np.zeros(6)
    mujoco.mj_forward(data.model, data)
    mujoco.mj_objectVelocity(
        data.model, data, mujoco.mjtObj.mjOBJ_BODY, data.model.body(name).id, found, 0
    )
    return found


@pytest.mark.parametrize("entry", [DropEntry, ThrowEntry])
def test_velocity_and_spin_are_in_the_world_frame(model, entry: type) -> None:
    turn = (0.5, -1.5, 2.0, 1.0)
    motion = {"velocity": (4, 5, 6), "angular_velocity": (-1, 2, 3)}
    data = applied(model, entry("stone", 0.0, position=(1, 2, 3), orientation=turn, **motion))
    np.testing.assert_allclose(velocity(data, "stone"), [-1, 2, 3, 4, 5, 6], atol=1e-12)
    np.testing.assert_allclose(data.body("stone").xpos, [1, 2, 3])
    np.testing.assert_allclose(data.body("stone").xquat, np.array(turn) / np.linalg.norm(turn))
    assert not velocity(data, "brick").any()


def test_a_throw_without_place_and_orientation_begins_at_the_bodys_pose(model) -> None:
    data = applied(model, ThrowEntry("stone", 0.0, velocity=(1, 0, 0), angular_velocity=(0, 0, 7)))
    np.testing.assert_allclose(velocity(data, "stone"), [0, 0, 7, 1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(data.body("stone").xpos, [0, 0, 3])
    np.testing.assert_allclose(data.body("stone").xquat, [0.6, 0, 0.8, 0])


def test_a_placed_body_is_at_rest_and_other_bodies_are_unchanged(model) -> None:
    data = mujoco.MjData(model)
    data.qvel[:] = np.arange(1.0, model.nv + 1)
    before = data.qvel.copy()
    script(model, PlaceEntry("brick", 0.0, position=(7, 8, 9))).apply(data, {})
    address = int(model.jnt_dofadr[model.body("brick").jntadr[0]])
    assert not data.qvel[address : address + 6].any()
    np.testing.assert_array_equal(
        np.delete(data.qvel, range(address, address + 6)), before[:address]
    )


def test_a_body_waits_at_home_for_its_drop_and_then_falls_freely(model) -> None:
    held = run(model, [DropEntry("stone", 0.3)], 0.3)
    np.testing.assert_allclose(held.qpos[1:8], [0, 0, 3, 0.6, 0, 0.8, 0], atol=1e-4)
    fallen = run(model, [DropEntry("stone", 0.3)], 0.7)
    assert 3 - fallen.qpos[3] == pytest.approx(9.81 / 2 * 0.4**2, rel=0.01)


def test_a_body_may_be_dropped_again_from_its_first_place(model) -> None:
    """Between the two drops the body waits at home for the second drop."""
    data = run(model, [DropEntry("stone", 0.4), DropEntry("stone", 0.2, position=(0, 0, 8))], 0.3)
    np.testing.assert_allclose(data.qpos[1:4], [0, 0, 3], atol=1e-3)


def test_events_happen_once_and_in_the_order_of_time(model) -> None:
    places = [PlaceEntry("stone", time, position=(time, 0, 3)) for time in (0.3, 0.1, 0.2)]
    for seconds, expected in ((0.05, 0.0), (0.15, 0.1), (0.25, 0.2), (0.45, 0.3)):
        data = run(model, places, seconds)
        assert data.qpos[1] == pytest.approx(expected)
    # it falls after its last placement, so it was not placed at each step
    assert data.qvel[3] < -1


def test_a_time_within_round_off_of_a_step_belongs_to_the_step(model) -> None:
    data = mujoco.MjData(model)
    data.time = 0.1 + 0.2 - 1e-12
    script(model, PlaceEntry("stone", 0.3, position=(1, 1, 1))).apply(data, {})
    np.testing.assert_array_equal(data.qpos[1:4], 1)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (
            DropEntry("rock", 0.0),
            r"\[\[drop\]\] names the body 'rock'; the model's bodies are post, wall, stone, brick",
        ),
        (
            ThrowEntry("post", 0.0, (0, 0, 1)),
            r"\[\[throw\]\] .* 'post', which has no <freejoint/>; name a free body",
        ),
        (DropEntry("wall", 0.0), "'wall', which has no <freejoint/>; only free bodies can drop"),
        (PlaceEntry("stone", np.nan, (0, 0, 0)), "time must be 0 or greater, got nan s"),
        (PlaceEntry("stone", np.inf, (0, 0, 0)), "time must be 0 or greater, got inf s"),
        (
            PlaceEntry("stone", -0.1, (0, 0, 0)),
            r"\[\[place\]\] of 'stone': time must be 0 or greater, got -0.1 s",
        ),
        (
            DropEntry("stone", 0.0, orientation=(0, 0, 0, 0)),
            "orientation must be w x y z, not 0, got",
        ),
        (DropEntry("stone", 0.0, orientation=(np.nan, 0, 0, 1)), "must be w x y z, not 0"),
    ],
)
def test_entries_that_cannot_be_carried_out_are_refused_at_once(
    model, entry: object, message: str
) -> None:
    with pytest.raises(SceneError, match=message):
        script(model, entry)


SCENE = """<mujoco><compiler angle="degree"/><option timestep="0.002" gravity="0 0 0"/><worldbody>
<body pos="0 0 1" euler="0 0 90">
<geom name="egg" type="ellipsoid" size="0.3 0.2 0.2" pos="0.1 0 0" euler="0 90 0"/></body>
<body name="stone" pos="0 0 3"><freejoint/><geom name="stone" size="0.05" mass="0.2"/></body>
<body name="brick" pos="2 0 3"><freejoint/><geom name="brick" type="box" size="0.1 0.1 0.1"/></body>
<body name="post" pos="0 3 0"><joint name="post" type="slide" axis="0 0 1"/>
<geom name="post" size="0.05"/></body>
</worldbody>
<actuator><position name="lift" joint="post" kp="100" kv="20"/></actuator></mujoco>"""
TOML = """model = "scene.xml"
[[ripple]]
geom = "egg"
resolution = 24
material = {speed = 0.5, density = 10.0, stiffness = 100.0}
"""


def simulation(folder: Path, script: str, **options) -> Simulation:
    scene = load_scene(write_scene(folder, SCENE, TOML + script))
    return Simulation(scene, fps=100, backend="cpu", **options)


def test_a_target_keeps_its_volume_unless_conserve_volume_is_false(tmp_path: Path) -> None:
    poke = '[[poke]]\ngeom = "egg"\ntime = 0\npoint = [0.3, 0, 0]\nimpulse = 0.02\n'
    for line, conserves in (
        ("", True),
        ("conserve_volume = true\n", True),
        ("conserve_volume = false\n", False),
    ):
        run = simulation(tmp_path, line + poke)
        run.advance_frame()
        waves = run.ripples["egg"]
        assert waves.conserve_volume == conserves
        assert (abs(waves.momentum()) < 1e-6) == conserves


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
    # at this resolution a texel is 30 mm wide
    assert np.abs(waves.height[distance < 0.07]).max() < 0.1 * around


def test_hook_is_called_before_every_step(tmp_path: Path) -> None:
    times = []
    sim = simulation(tmp_path, "", on_step=lambda running: times.append(running.data.time))
    for _ in range(2):
        sim.advance_frame()
    np.testing.assert_allclose(times, 0.002 * np.arange(10), atol=1e-12)
