"""The viewer without a window: scenes, pause, reset, rays, pokes and thrown balls."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from programs import PROGRAMS, ended
from scene_files import write_scene

from ripple_sim.errors import SceneError, SimulationError
from ripple_sim.scene import Scene, load_scene
from ripple_sim.scenes.shapes import peanut, write_obj
from ripple_sim.solver import SolverError
from ripple_sim.viewer import BALLS, FLIGHT, OPERATORS, Balls, Session, add_balls, open_scene

# of the scene "sphere" [m]
RADIUS = 0.5
MIDDLE = np.array([0.0, 0.0, 0.5])
MJCF = """<mujoco>{}<worldbody><geom name="egg" type="ellipsoid" size="0.3 0.25 0.2"/>
<body pos="0 0 1"><freejoint/><geom size="0.05"/></body></worldbody></mujoco>"""
TOML = 'model = "scene.xml"\n[[ripple]]\ngeom = "egg"\n'


def run(session: Session, frames: int) -> None:
    for _ in range(frames):
        session.advance()


def state(session: Session) -> bytes:
    fields = [
        session.simulation.ripples[name].height.tobytes() for name in session.simulation.ripples
    ]
    return b"".join([session.simulation.data.qpos.tobytes(), *fields])


def test_after_a_reset_everything_happens_again_bit_for_bit(session: Session) -> None:
    run(session, 16)  # the ball has hit
    first = state(session)
    session.poke([0.0, 0.0, 3.0], [0.0, 0.0, -1.0])
    session.throw([3.0, 0.0, 0.5], [-1.0, 0.0, 0.0])
    run(session, 5)
    session.reset()
    assert session.time == 0
    assert not any(skin.height.any() for skin in session.skins.values())
    run(session, 16)
    assert state(session) == first


def test_a_poke_presses_the_surface_in_where_it_points(session: Session) -> None:
    session.paused = True
    assert session.poke([3.0, 0.0, 2.5], [-1.0, 0.0, 0.0]) is None
    point = session.poke([2.5, 0.0, 0.5], [-1.0, 0.0, 0.0])
    assert point is not None
    waves = session.simulation.ripples["sphere"]
    # all of it enters, less what keeps the volume
    pushed = -(waves.operator.mass * np.minimum(waves.velocity, 0)).sum()
    assert 0.9 * session.poke_impulse < pushed <= session.poke_impulse
    session.step()
    skin = session.skins["sphere"]
    lowest = skin.points[np.argmin(skin.height)]
    assert np.linalg.norm(lowest - point) < 0.1 * RADIUS
    assert -0.1 * RADIUS < skin.height.min() < -0.003 * RADIUS


def test_a_stronger_poke_goes_deeper_in_proportion(scene: Scene) -> None:
    depth = []
    for factor in (1.0, 2.0):
        session = Session(scene, resolution=16)
        session.poke_impulse *= factor
        session.poke([2.5, 0.0, 0.5], [-1.0, 0.0, 0.0])
        session.step()
        depth.append(session.skins["sphere"].height.min())
    assert depth[1] == pytest.approx(2 * depth[0], rel=1e-4)


def test_sliders_change_the_material_and_outlive_a_reset(session: Session) -> None:
    session.poke([2.5, 0.0, 0.5], [-1.0, 0.0, 0.0])
    run(session, 2)
    before = session.simulation.ripples["sphere"].height
    session.set_material(speed=0.9, damping=3.0)
    np.testing.assert_array_equal(session.simulation.ripples["sphere"].height, before)
    session.reset()
    waves = session.simulation.ripples["sphere"]
    assert (
        session.material("speed"),
        session.material("damping"),
        session.material("stiffness"),
    ) == (0.9, 3.0, 600.0)
    assert (waves.material.speed, waves.material.damping) == (0.9, 3.0)
    with pytest.raises(SolverError, match=r"speed must be .*, got -1"):
        session.set_material(speed=-1.0)
    assert session.material("speed") == 0.9


def test_operators_can_be_changed_while_it_runs(session: Session) -> None:
    session.poke([2.5, 0.0, 0.5], [-1.0, 0.0, 0.0])
    run(session, 4)
    shown = {}
    for operator in OPERATORS:
        session.set_operator(operator)
        assert session.operator == operator
        before = session.simulation.ripples["sphere"].height
        session.step()
        shown[operator] = session.skins["sphere"].height.copy()
        assert np.isfinite(shown[operator]).all()
        assert not np.array_equal(before, session.simulation.ripples["sphere"].height)
    with pytest.raises(SolverError, match="'magic'"):
        session.set_operator("magic")
    assert session.operator == OPERATORS[-1]
    run(session, 2)


def test_colours_follow_the_waves_at_once_and_fade_slowly(session: Session) -> None:
    faint = session.color_range
    run(session, 3)
    assert session.color_range == pytest.approx(faint)
    session.poke([2.5, 0.0, 0.5], [-1.0, 0.0, 0.0])
    run(session, 2)
    high = session.color_range
    assert high > 10 * faint
    session.simulation.ripples["sphere"].reset()
    session.step()
    assert 0.9 * high < session.color_range < high


def test_an_unstable_run_is_paused_and_can_restart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = write_scene(tmp_path, MJCF.format('<option gravity="0 0 -9e9"/>'), TOML)
    session = Session(open_scene(path), resolution=8)
    with pytest.raises(SimulationError):
        run(session, 50)
    assert session.paused
    assert not session.advance()
    session.reset()
    assert session.time == 0
    # no log of MuJoCo's
    assert {path.name for path in tmp_path.iterdir()} == {"scene.xml", "scene.toml"}


def test_a_session_needs_no_vtk() -> None:
    result = ended(PROGRAMS / "modules_of_session.py", check=True)
    assert result.stdout.splitlines()[-1] == "[]"


def test_a_ray_finds_the_surface_where_geometry_says(session: Session) -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        origin = MIDDLE + 3 * rng.standard_normal(3) / np.sqrt(3)
        if np.linalg.norm(origin - MIDDLE) < 1:
            continue
        toward = MIDDLE + 0.3 * rng.uniform(-1, 1, 3) - origin
        hit = session.pick(origin, toward)
        assert hit is not None
        # |o + t d| = R
        local = origin - MIDDLE
        a = toward @ toward
        b = local @ toward
        c = local @ local - RADIUS**2
        assert hit[2] == pytest.approx((-b - np.sqrt(b * b - a * c)) / a, rel=3e-3)
    assert session.pick([3, 0, 0.5], [1, 0, 0]) is None
    assert session.pick([3, 0, 2.5], [-1, 0, 0]) is None


def test_a_ray_finds_the_nearest_of_two_turned_and_moved_surfaces() -> None:
    session = Session(open_scene("pair"), resolution=16)
    run(session, 4)
    data = session.simulation.data
    ids = session.simulation.ripples.geom_ids
    left, right = (data.geom_xpos[ids[name]] for name in ("left", "right"))
    along = (right - left) / np.linalg.norm(right - left)
    for start, way, name in (
        (left - 2 * along, along, "left"),
        (right + 2 * along, -along, "right"),
    ):
        found, point, distance = session.pick(start, way)
        assert found == name
        closest, _ = session.simulation.ripples[name].atlas.project(point)
        assert np.linalg.norm(closest[0] - point) < 1e-3  # triangles in a ball
        # carried back to the world the point lies on the ray
        world = data.geom_xpos[ids[name]] + data.geom_xmat[ids[name]].reshape(3, 3) @ point
        np.testing.assert_allclose(world, start + distance * way, atol=1e-6)


@pytest.mark.parametrize("name", ["sphere", "rolling", "heavy", "animal"])
def test_the_suggested_poke_is_seen_but_not_absurd(name: str) -> None:
    session = Session(open_scene(name), resolution=32)
    [waves] = (session.simulation.ripples[geom] for geom in session.simulation.ripples)
    [geom] = session.simulation.ripples.geom_ids.values()
    middle = session.simulation.data.geom_xpos[geom]
    assert session.poke(middle + np.array([0, 0, 9]), [0, 0, -1]) is not None
    deepest = 0.0
    for _ in range(8):
        waves.step(1 / 30)  # without the bodies of the scene
        deepest = max(deepest, float(np.abs(waves.height).max()))
    assert 0.003 < deepest / session.size < 0.05


def test_meshes_and_scene_files_can_be_opened_and_mistakes_are_named(tmp_path: Path) -> None:
    write_obj(tmp_path / "peanut.obj", *peanut())
    scene = open_scene(tmp_path / "peanut.obj", bodies=0)
    assert scene.name == "peanut"
    assert scene.model.nbody == 1 + BALLS
    for wrong in ("no such thing", tmp_path / "missing.obj"):
        with pytest.raises(SceneError, match=r"there is no scene or mesh.*shipped scenes are"):
            open_scene(wrong)
    with pytest.raises(SceneError, match="there is no scene"):
        open_scene(tmp_path / "missing.toml")


def test_a_thrown_ball_hits_where_the_ray_meets_the_surface(session: Session) -> None:
    assert len(session.parked) == BALLS
    assert session.throw([2.5, 0.0, 0.9], [-2.5, 0.0, -0.4])
    assert len(session.parked) == BALLS - 1
    impulses = []
    for _ in range(round(1.5 * FLIGHT * session.fps)):
        session.advance()
        impulses += [hit for hit in session.simulation.impulses if hit.other.startswith("thrown")]
    expected = session.pick([2.5, 0.0, 0.9], [-2.5, 0.0, -0.4])
    assert expected is not None
    assert impulses
    # it arrives a radius early, and rolls a little while it presses
    assert np.linalg.norm(impulses[0].point - (MIDDLE + expected[1])) < 0.15 * RADIUS


def test_a_ball_flies_a_parabola_through_its_point() -> None:
    spec = mujoco.MjSpec()
    add_balls(spec, 2, 0.05, 0.1)
    model = spec.compile()
    model.opt.timestep = 1e-3
    data = mujoco.MjData(model)
    balls = Balls(model)
    assert balls.throw(data, [1.0, 2.0, 3.0], [-1.0, 0.5, 2.0], 0.4)
    for _ in range(400):
        balls.hold(data)
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.body(1).xpos, [-1.0, 0.5, 2.0], atol=0.02)
    np.testing.assert_allclose(data.qpos[7:10], model.qpos0[7:10], atol=1e-4)  # the other one waits


def test_the_oldest_ball_is_used_again_and_a_reset_calls_all_back(session: Session) -> None:
    for number in range(BALLS + 1):
        assert session.throw([3.0, 0.0, 2.0 + 0.3 * number], [-1.0, 0.0, 0.0])
    assert session.parked == set()
    session.reset()
    session.advance()
    assert len(session.parked) == BALLS
    assert session.simulation.data.qpos[-5] > 10
    without = Session(load_scene("sphere"), resolution=8)
    assert not without.throw([3.0, 0.0, 0.5], [-1.0, 0.0, 0.0])


def test_balls_change_neither_the_view_nor_a_keyframe(tmp_path: Path) -> None:
    path = write_scene(
        tmp_path, MJCF.format('<keyframe><key qpos="0.1 0.2 0.9 1 0 0 0"/></keyframe>'), TOML
    )
    scene = open_scene(path)
    plain = load_scene(path)
    assert scene.model.stat.extent == plain.model.stat.extent
    np.testing.assert_array_equal(scene.model.stat.center, plain.model.stat.center)
    session = Session(scene, resolution=8)
    np.testing.assert_array_equal(session.simulation.data.qpos[:3], [0.1, 0.2, 0.9])
    np.testing.assert_array_equal(session.simulation.data.qpos[7:], scene.model.qpos0[7:])
