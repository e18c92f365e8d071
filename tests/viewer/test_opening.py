"""What can be opened, and pokes that suit it.

Balls: parked, thrown, called back.
"""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from played import MIDDLE, RADIUS

from ripple_sim.errors import SceneError
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.scenes.shapes import peanut, write_obj
from ripple_sim.viewer.opening import BALLS, FLIGHT, Balls, add_balls, open_scene, poke_strength
from ripple_sim.viewer.session import Session


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


def test_a_suggested_poke_scales_with_size_and_density() -> None:
    material = load_scene("sphere").targets[0].material.material()
    (radius, impulse), (twice, more) = poke_strength(material, 1.0), poke_strength(material, 2.0)
    assert twice == pytest.approx(2 * radius)
    assert more > 4 * impulse


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
    assert np.linalg.norm(impulses[0].point - (MIDDLE + expected.point)) < 0.15 * RADIUS


def test_a_ball_flies_a_parabola_through_its_point() -> None:
    spec = mujoco.MjSpec()
    add_balls(spec, 2, 0.05, 0.1)
    model = spec.compile()
    model.opt.timestep = 1e-3
    data, balls = mujoco.MjData(model), Balls(model)
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


def test_a_scene_without_balls_says_so() -> None:
    session = Session(load_scene("sphere"), resolution=8)
    assert not session.throw([3.0, 0.0, 0.5], [-1.0, 0.0, 0.0])


def test_balls_change_neither_the_view_nor_a_keyframe(tmp_path: Path) -> None:
    (tmp_path / "scene.xml").write_text("""<mujoco><worldbody><geom name="egg" type="ellipsoid" size="0.3 0.25 0.2"/>
      <body pos="0 0 1"><freejoint/><geom size="0.05"/></body></worldbody>
      <keyframe><key qpos="0.1 0.2 0.9 1 0 0 0"/></keyframe></mujoco>""")
    (tmp_path / "scene.toml").write_text('model = "scene.xml"\n[[ripple]]\ngeom = "egg"\n')
    scene, plain = open_scene(tmp_path / "scene.toml"), load_scene(tmp_path / "scene.toml")
    assert scene.model.stat.extent == plain.model.stat.extent
    np.testing.assert_array_equal(scene.model.stat.center, plain.model.stat.center)
    session = Session(scene, resolution=8)
    np.testing.assert_array_equal(session.simulation.data.qpos[:3], [0.1, 0.2, 0.9])
    np.testing.assert_array_equal(session.simulation.data.qpos[7:], scene.model.qpos0[7:])
