"""The scene of a model: drawn geoms, bounds, order, lights and skybox, or the studio."""

import mujoco
import numpy as np
import pytest
from drawn import BALL, FLOOR, FRONT, SPOT, SUN, ball_surface, frame_of
from mujoco_models import forwarded

from ripple_sim.render import Camera, DrawnScene, Resources
from ripple_sim.render.visuals import Assets, visuals_of
from ripple_sim.solver import RippleError

XML = """<mujoco><worldbody>
<geom name="target" type="sphere" size=".5" pos="0 0 1"/>
<geom name="far" type="box" size=".2 .2 .2" pos="0 5 0" rgba="1 0 0 .5"/>
<geom name="near" type="sphere" size=".2" pos="0 -1 0" rgba="0 1 0 .5"/>
<geom name="solid" type="capsule" size=".1 .3" pos="2 0 0"/>
<geom name="wall" type="plane" size="0 0 .1" pos="0 0 -3"/>
<site type="sphere" size=".1" pos="0 2 0" rgba="0 0 1 .5"/>
</worldbody></mujoco>"""
HEIGHT_MAP = np.zeros((6, 10, 10, 4), np.float32)
POSE = Camera((0.0, 0.0, 0.0), 4.0, 90.0, 0.0).pose()  # seen from -y


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_string(XML)


@pytest.fixture
def data(model):
    return forwarded(model)


@pytest.fixture(scope="module", params=["clay", "water"])
def scene(request, gl, model):
    """A scene whose target is opaque, and one whose target is transparent."""
    with gl:
        resources = Resources(gl, owner=gl)
        target = model.geom("target").id
        surfaces = {target: ball_surface(request.param)}
        made = DrawnScene(Assets(model, resources), surfaces, (32, 24))
        made.show(visuals_of(model, [g for g in range(model.ngeom) if g != target]))
        yield made
        resources.release()


def updated(gl, scene, data, height=0.0):
    height_map = HEIGHT_MAP + np.array([0, 0, 0, height], dtype=np.float32)
    with gl as ctx:
        return scene.update(ctx, data, {0: height_map}, POSE)


def test_transparent_things_come_with_the_furthest_first(gl, scene, data):
    updated(gl, scene, data)
    layers = scene.layers(data, POSE)
    y = [round(float(balls[:, 1].mean()), 1) for balls, _ in layers]
    assert y in ([5.0, 2.0, 0.0, -1.0], [5.0, 2.0, -1.0])
    assert len({layer.numbers[0] for _, layer in layers}) == len(layers)


def test_bounds_contain_the_waves_and_planes_are_without_end(gl, scene, data, model):
    for height in (0.0, 0.2, -0.2):
        updated(gl, scene, data, height)
        balls = scene.balls(data)
        assert np.isinf(balls[:, 3]).sum() == 1
        directions = np.random.default_rng(0).normal(size=(50, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        finite = np.isfinite(balls[:, 3])
        for point in np.array([0, 0, 1]) + (0.5 + height) * directions:
            reach = np.linalg.norm(balls[finite, :3] - point, axis=1) - balls[finite, 3]
            assert reach.min() < 0.01  # a facet's chord under the sphere


def test_bounds_of_shadow_casters_stay_the_same_as_a_target_turns(gl, scene, model, data):
    updated(gl, scene, data)
    before = scene.casters(data)
    data.geom_xmat[0] = [0, -1, 0, 1, 0, 0, 0, 0, 1]
    updated(gl, scene, data)
    np.testing.assert_array_equal(before, scene.casters(data))
    assert np.isfinite(before).all()  # planes cast no shadow


@pytest.mark.parametrize("shape", [(6, 8, 8, 4), (6, 10, 10), (5, 10, 10, 4)])
def test_a_height_map_of_another_shape_is_refused(gl, scene, data, shape):
    with (
        pytest.raises(RippleError, match=r"geom 0 must have shape \[6, 10, 10, 4\]"),
        gl as ctx,
    ):
        scene.update(ctx, data, {0: np.zeros(shape, np.float32)}, POSE)


def test_a_model_without_lights_gets_the_studio_and_lighting_can_be_chosen(gl):
    dark = "<headlight active='0'/>"
    sun = SUN.format(1.0, "true")
    np.testing.assert_array_equal(
        frame_of(gl, FLOOR + BALL), frame_of(gl, FLOOR + BALL, lighting="studio")
    )
    np.testing.assert_array_equal(
        frame_of(gl, FLOOR + BALL + sun), frame_of(gl, FLOOR + BALL + sun, lighting="model")
    )
    assert frame_of(gl, FLOOR + BALL, visual=dark, lighting="model").mean() < 40
    with pytest.raises(RippleError, match=r"must be one of 'auto', 'model', 'studio', got 'dusk'"):
        frame_of(gl, FLOOR, lighting="dusk")


def test_a_scene_lit_by_a_spot_alone_is_dark_all_round(gl):
    spot = SPOT.format(0.0, 0.0).replace('exponent="1"', 'exponent="20"')
    dark = frame_of(gl, FLOOR + BALL + spot, visual='<headlight active="0"/>', camera=FRONT)
    light = frame_of(
        gl, FLOOR + BALL + SUN.format(0.0, "true"), visual='<headlight active="0"/>', camera=FRONT
    )
    assert dark[:10].mean() < 20 < 80 < light[:10].mean()
    assert dark.max() > 100


def test_skybox_fills_the_background(gl):
    sky = '<texture type="skybox" builtin="flat" rgb1=".1 .2 .9" width="16" height="96"/>'
    frame = frame_of(gl, SUN.format(0.0, "true"), asset=sky, camera=FRONT)
    # bright colours pale a little
    np.testing.assert_allclose(frame.mean(axis=(0, 1)), 255 * np.array([0.1, 0.2, 0.9]), atol=12)
    assert frame.std(axis=(0, 1)).max() < 1
