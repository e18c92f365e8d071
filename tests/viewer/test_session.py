"""The viewer without a window: running, pausing, resetting, poking.

Rays find the nearest surface.

The skin follows the surface.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from played import MIDDLE, RADIUS, run

from ripple_sim.errors import SimulationError
from ripple_sim.scene.scene import Scene
from ripple_sim.solver import SolverError, sphere_atlas
from ripple_sim.viewer.opening import open_scene
from ripple_sim.viewer.session import OPERATORS, Session, Skin


def state(session: Session) -> bytes:
    fields = [session.simulation.ripples[name].height.tobytes() for name in session.simulation.ripples]
    return b"".join([session.simulation.data.qpos.tobytes(), *fields])


def test_time_goes_on_frame_by_frame_and_stops_where_it_is_paused(session: Session) -> None:
    assert session.advance()
    assert session.time == pytest.approx(1 / 30)
    session.paused = True
    assert not session.advance()
    assert session.time == pytest.approx(1 / 30)
    session.step()
    assert session.time == pytest.approx(2 / 30)


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


def test_two_sessions_that_are_played_alike_are_alike(scene: Scene) -> None:
    def play() -> bytes:
        session = Session(scene, resolution=16)
        run(session, 3)
        session.poke([0.3, 2.0, 0.6], [0.0, -1.0, 0.0])
        session.throw([3.0, 0.0, 0.5], [-1.0, 0.0, 0.0])
        session.set_material(speed=0.8)
        run(session, 20)
        return state(session)

    assert play() == play()


def test_a_poke_presses_the_surface_in_where_it_points(session: Session) -> None:
    session.paused = True
    assert session.poke([3.0, 0.0, 2.5], [-1.0, 0.0, 0.0]) is None
    hit = session.poke([2.5, 0.0, 0.5], [-1.0, 0.0, 0.0])
    assert hit is not None
    waves = session.simulation.ripples["sphere"]
    # all of it enters, less what keeps the volume
    pushed = -(waves.operator.mass * np.minimum(waves.velocity, 0)).sum()
    assert 0.9 * session.poke_impulse < pushed <= session.poke_impulse
    session.step()
    skin = session.skins["sphere"]
    lowest = skin.points[np.argmin(skin.height)]
    assert np.linalg.norm(lowest - hit.point) < 0.1 * RADIUS
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
    assert (session.material("speed"), session.material("damping"), session.material("stiffness")) == (0.9, 3.0, 600.0)
    assert (waves.material.speed, waves.material.damping) == (0.9, 3.0)
    with pytest.raises(SolverError, match="speed is -1"):
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


def test_what_becomes_unstable_is_paused_and_can_start_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.xml").write_text("""<mujoco><option gravity="0 0 -1e12"/><worldbody>
      <geom name="egg" type="ellipsoid" size="0.3 0.25 0.2"/>
      <body pos="0 0 1"><freejoint/><geom size="0.05"/></body></worldbody></mujoco>""")
    (tmp_path / "scene.toml").write_text('model = "scene.xml"\n[[ripple]]\ngeom = "egg"\n')
    session = Session(open_scene(tmp_path / "scene.toml"), resolution=8)
    with pytest.raises(SimulationError):
        run(session, 50)
    assert session.paused
    assert not session.advance()
    session.reset()
    assert session.time == 0
    assert {path.name for path in tmp_path.iterdir()} == {"scene.xml", "scene.toml"}  # no log of MuJoCo's


def test_a_session_needs_no_vtk() -> None:
    code = (
        "import sys\nfrom ripple_sim.viewer.opening import open_scene\nfrom ripple_sim.viewer.session import Session\n"
        "session = Session(open_scene('sphere'), resolution=8)\nsession.advance()\n"
        "print(sorted({name.split('.')[0] for name in sys.modules} & {'vtkmodules', 'pyvista', 'trame'}))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
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
        a, b, c = toward @ toward, local @ toward, local @ local - RADIUS**2
        assert hit.distance == pytest.approx((-b - np.sqrt(b * b - a * c)) / a, rel=3e-3)
    assert session.pick([3, 0, 0.5], [1, 0, 0]) is None
    assert session.pick([3, 0, 2.5], [-1, 0, 0]) is None


def test_a_ray_finds_the_nearest_of_two_turned_and_moved_surfaces() -> None:
    session = Session(open_scene("pair"), resolution=16)
    run(session, 4)
    data, ids = session.simulation.data, session.simulation.ripples.geom_ids
    left, right = (data.geom_xpos[ids[name]] for name in ("left", "right"))
    along = (right - left) / np.linalg.norm(right - left)
    for start, way, name in ((left - 2 * along, along, "left"), (right + 2 * along, -along, "right")):
        hit = session.pick(start, way)
        assert hit is not None
        assert hit.geom == name
        atlas = session.simulation.ripples[name].atlas
        closest, _ = atlas.project(hit.point)
        assert np.linalg.norm(closest[0] - hit.point) < 1e-3  # triangles in a ball
        # carried back to the world the point lies on the ray
        world = data.geom_xpos[ids[name]] + data.geom_xmat[ids[name]].reshape(3, 3) @ hit.point
        np.testing.assert_allclose(world, start + hit.distance * way, atol=1e-6)


def test_a_skin_is_the_surface_while_nothing_moves(session: Session) -> None:
    skin = session.skins["sphere"]
    np.testing.assert_allclose(np.linalg.norm(skin.points, axis=1), RADIUS, rtol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(skin.normals, axis=1), 1, rtol=1e-5)
    corners = skin.points[skin.F]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", outward, corners.mean(axis=1)) > 0).all()


def test_a_skin_follows_a_smooth_height_with_its_points_and_normals() -> None:
    atlas = sphere_atlas(1.0, 48)
    skin = Skin(atlas)
    rest, flat, height = skin.points.copy(), skin.normals.copy(), 0.02
    x, _, z = np.moveaxis(atlas.positions, -1, 0)
    skin.update((height * (x * z)).astype(np.float32))
    direction = rest / np.linalg.norm(rest, axis=1, keepdims=True)
    wave = height * direction[:, 0] * direction[:, 2]
    np.testing.assert_allclose(skin.height, wave, atol=2e-3 * height)
    np.testing.assert_allclose(np.linalg.norm(skin.points - rest, axis=1), np.abs(wave), atol=3e-3 * height)
    # gradient on the unit sphere of a x z: the plane gradient (z, 0, x) a without its radial part
    gradient = height * np.stack([direction[:, 2], np.zeros(len(rest)), direction[:, 0]], axis=1)
    gradient -= np.einsum("ij,ij->i", gradient, direction)[:, None] * direction
    tipped = flat - gradient
    tipped /= np.linalg.norm(tipped, axis=1, keepdims=True)
    assert np.linalg.norm(skin.normals - tipped, axis=1).max() < 0.02 * np.linalg.norm(tipped - flat, axis=1).max()
