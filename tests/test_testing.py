"""`ripple_sim.testing`: frames, surfaces and assertions for the tests of a user."""

import copy
import pickle

import mujoco
import numpy as np
import pytest
from hits import Run
from mujoco_models import BALL, forwarded, limbed_asset, model_of
from scipy.spatial import cKDTree

from ripple_sim import Material, RippleError, Ripples
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import WaveSolver, build_atlas, sphere_atlas, vertex_map
from ripple_sim.testing import (
    assert_impulse_at,
    assert_symmetric,
    assert_wave_at,
    asymmetry,
    record_impulses,
)

pytestmark = pytest.mark.filterwarnings("ignore:geom .target. collides as its convex hull")

TURNED_MESH = (
    '<body name="base" pos="0.5 -0.3 1" euler="20 -30 70"><freejoint/>'
    '<geom name="target" type="mesh" mesh="limbed" pos="0.1 0.2 0.3" euler="0 40 0" mass="3"/>'
    "</body>"
)
EGG = '<geom name="egg" type="ellipsoid" size="0.4 0.3 0.3" pos="0.1 -0.2 0.3" euler="0 0 30"/>'


def in_the_world(model: mujoco.MjModel, data: mujoco.MjData, V: np.ndarray) -> np.ndarray:
    """Vertices of a mesh file in the world, without the frame that MuJoCo gives the mesh."""
    turn = np.zeros(9)
    mujoco.mju_euler2Quat(quaternion := np.zeros(4), np.radians([0.0, 40.0, 0.0]), "xyz")
    mujoco.mju_quat2Mat(turn, quaternion)
    in_body = V @ turn.reshape(3, 3).T + [0.1, 0.2, 0.3]
    body = data.body("base")
    return in_body @ body.xmat.reshape(3, 3).T + body.xpos


def test_vertices_of_a_mesh_are_in_the_world_where_its_file_and_the_mjcf_have_them() -> None:
    model = model_of(TURNED_MESH, limbed_asset('scale="1 1 1"'))
    data = forwarded(model)
    waves = Ripples(model, {"target": Material()}, resolution=8, backend="cpu")["target"]
    V = waves.atlas.mesh.V
    file_vertices = in_the_world(model, data, limbed(0.03)[0])
    # before the first step, given data, and after steps that turn the body
    assert cKDTree(file_vertices).query(waves.to_world(V))[0].max() < 1e-5
    assert np.linalg.norm(V - waves.to_world(V), axis=1).min() > 0.1  # the frames differ
    data.qvel[:] = [0.3, 0, 1, 2, 3, 1]
    mujoco.mj_step(model, data, 100)
    moved = in_the_world(model, data, limbed(0.03)[0])
    assert cKDTree(moved).query(waves.to_world(V, data))[0].max() < 1e-5
    np.testing.assert_allclose(waves.from_world(waves.to_world(V, data), data), V, atol=1e-12)


def test_targets_and_their_copies_follow_the_latest_step() -> None:
    model = model_of(TURNED_MESH, limbed_asset())
    run = Run(model, "target", resolution=8).until(0.1)
    waves = run.ripples["target"]
    points = waves.atlas.positions.tolist()
    here = waves.to_world(points)
    assert here.shape == waves.atlas.positions.shape
    np.testing.assert_array_equal(here, waves.to_world(points, run.data))
    for other in (copy.copy(waves), pickle.loads(pickle.dumps(run.ripples))["target"]):
        np.testing.assert_array_equal(other.to_world(points), here)
    run.ripples.change_material("target", speed=2.0)
    np.testing.assert_array_equal(run.ripples["target"].to_world(points), here)
    assert waves.to_world([0, 0, 0]).shape == (3,)
    with pytest.raises(RippleError, match="points must have shape"):
        waves.to_world([[1.0, 2.0]])


def test_surface_is_displaced_along_its_normals() -> None:
    model = model_of(EGG)
    data = forwarded(model)
    ripples = Ripples(model, {"egg": Material()}, resolution=32, backend="cpu")
    flat = ripples.surface("egg", data)
    assert len(flat.F) and np.abs(np.linalg.norm(flat.normals, axis=1) - 1).max() < 1e-12
    middle = flat.V.mean(axis=0)
    assert (((flat.V - middle) * flat.normals).sum(axis=1) > 0).all()
    waves = ripples["egg"]
    x = waves.atlas.positions[..., 0]
    waves.height = 0.01 + 0.05 * x
    V, F, normals = ripples.surface("egg")
    np.testing.assert_array_equal(F, flat.F)
    along_x = waves.from_world(flat.V)[:, 0]
    rise = ((V - flat.V) * flat.normals).sum(axis=1)
    np.testing.assert_allclose(rise, 0.01 + 0.05 * along_x, atol=2e-4)
    # a slope of 0.05 tips the normals by as much where the surface runs along x
    top = np.abs(along_x) < 0.05
    tip = np.linalg.norm(normals - flat.normals, axis=1)[top]
    assert tip == pytest.approx(0.05, rel=0.15)


def test_the_surface_of_a_soft_body_lies_on_its_nodes() -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom type="plane" size="3 3 1"/>
        <flexcomp name="jelly" type="grid" dim="3" count="3 3 3" spacing=".1 .1 .1" pos="0 0 1"
          mass="1"
         radius="0.005"><contact selfcollide="none"/><edge equality="true"/></flexcomp></worldbody>
         </mujoco>"""
    )
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"jelly": Material(density=10.0)}, resolution=8, backend="cpu")
    ripples.mj_step(data, 50)
    V, _, _ = ripples.surface("jelly")
    assert cKDTree(data.flexvert_xpos).query(V)[0].max() < 1e-6
    assert V[:, 2].mean() < 1 - 0.5 * 9.81 * 0.09**2


def test_impulse_of_a_ball_is_found_where_it_lands_and_nowhere_else() -> None:
    model = model_of(EGG + BALL.format("0.1 -0.2 1"))
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"egg": Material(density=800.0)}, resolution=24, backend="cpu")
    impulses = record_impulses(ripples, data, 0.5)
    top = [0.1, -0.2, 0.6]
    # what stopped the ball and threw it up again, against its weight [N s]
    momentum = 0.3 * (data.qvel[2] + 9.81 * data.time)
    hits = assert_impulse_at(
        impulses, top, within=0.03, impulse=momentum, rtol=0.001, geom="egg", other="ball"
    )
    assert len(hits) == len(impulses) > 1
    with pytest.raises(
        AssertionError, match=r"no impulse by 'ball' within 0.05 m of \[0.1, -0.2, 0\]"
    ):
        assert_impulse_at(impulses, [0.1, -0.2, 0.0], within=0.05, other="ball")
    with pytest.raises(AssertionError, match=r"sum up to .* N s, not 0.1 N s"):
        assert_impulse_at(impulses, top, within=0.03, impulse=0.1)
    with pytest.raises(AssertionError, match="no impulse by 'stone' on 'egg'"):
        assert_impulse_at(impulses, top, within=9.0, geom="egg", other="stone")


def test_waves_are_found_where_the_surface_was_hit() -> None:
    model = model_of(EGG)
    ripples = Ripples(
        model, {"egg": Material(speed=0.3, density=5.0)}, resolution=32, backend="cpu"
    )
    waves = ripples["egg"]
    with pytest.raises(AssertionError, match="0 everywhere"):
        assert_wave_at(waves, [0.1, -0.2, 0.6], within=0.05)
    ripples.poke("egg", [0.1, -0.2, 0.6], 0.05, 0.08)
    waves.step(0.01)
    assert_wave_at(waves, [0.1, -0.2, 0.6], within=0.03)
    with pytest.raises(AssertionError, match=r"displaced most, by .* m, at"):
        assert_wave_at(waves, [0.1, -0.2, 0.0], within=0.03)


@pytest.mark.parametrize("axis", [[0, 0, 1], [0.3, -0.5, 0.8]])
def test_ring_on_a_sphere_is_the_same_all_round_its_source_and_round_nothing_else(
    axis: list[float],
) -> None:
    waves = WaveSolver(sphere_atlas(1.0, 48), Material(speed=1.0), backend="cpu")
    waves.add_impulse(axis, 1.0, 0.25)
    waves.step(0.9)
    aside = np.cross(axis, [1.0, 0.2, 0.3])
    assert_symmetric(waves, axis=axis, tolerance=0.02)
    assert_symmetric(waves, mirror=aside, field="velocity")
    assert asymmetry(waves, mirror=axis) > 1
    # four degrees off
    with pytest.raises(AssertionError, match="not the same all round the axis"):
        assert_symmetric(waves, axis=np.array(axis) + 0.07 * aside / np.linalg.norm(aside))


def test_symmetry_of_a_target_is_judged_in_the_world() -> None:
    """The egg's long axis is turned by 30 degrees about the vertical."""
    model = model_of(EGG)
    ripples = Ripples(
        model, {"egg": Material(speed=0.5, density=5.0)}, resolution=48, backend="cpu"
    )
    ripples.poke("egg", [0.1, -0.2, 0.6], 0.05, 0.1)
    waves = ripples["egg"]
    waves.step(0.6)
    long = [np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0]
    assert_symmetric(waves, mirror=long, tolerance=0.02)
    assert_symmetric(
        waves, mirror=np.cross(long, [0, 0, 1]), through=[0.1, -0.2, 0.3], tolerance=0.02
    )
    with pytest.raises(AssertionError, match="the surface itself does not have the symmetry"):
        assert_symmetric(waves, mirror=[1, 0, 0])
    for wrong in ({}, {"mirror": [1, 0, 0], "axis": [1, 0, 0]}, {"axis": [0, 0, 0]}):
        with pytest.raises(RippleError, match=r"must be a direction|give one of"):
            asymmetry(waves, **wrong)


def test_public_calls_with_points_take_lists() -> None:
    ball = sphere_atlas(1.0, 8)
    for atlas in (ball, build_atlas(ball.mesh, 8, cache=False)):
        points = [[0.0, 0.1, 2.0], [1, 0, 0]]
        triangles, closest = atlas.closest_points(points)
        assert len(triangles) == 2 and closest.shape == (2, 3)
        np.testing.assert_array_equal(atlas.closest_points(tuple(points[0]))[1], closest[:1])
        assert atlas.closest_points.distances(points)[0] == pytest.approx(
            np.hypot(2, 0.1) - 1, abs=0.01
        )
        assert atlas.nearest(points)[0].shape == atlas.project(points)[0].shape == (2, 3)
        assert len(atlas.locate(points)[0]) == len(atlas.nearest_texel(points)) == 2
        assert atlas.sampling_matrix(points).shape == (2, atlas.areas.size)
        assert vertex_map(atlas, [1.0] * len(atlas.mesh.V)).shape == atlas.areas.shape
        waves = WaveSolver(atlas, Material(speed=1.0), backend="cpu")
        waves.move(atlas.mesh.V.tolist())
        assert len(waves.sensor(points, "height").points) == 2
        with pytest.raises(RippleError, match=r"points must be .*, got 'north'"):
            atlas.closest_points("north")
