"""Frames of a model with ripples in somebody's own loop."""

import copy

import mujoco
import numpy as np
import pytest

from ripple_sim import Camera, Material, RippleError, RippleRenderer, Ripples

MODEL = """<mujoco><worldbody>
  <geom name="egg" type="ellipsoid" size="0.4 0.3 0.3" rgba="0.9 0.1 0.1 1"/>
  <camera name="side" pos="0 -2 0.3" xyaxes="1 0 0 0 0 1"/></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def egg():
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data, Ripples(model, {"egg": Material(speed=0.5)}, resolution=32, backend="cpu")


def test_a_ripple_changes_the_picture_where_it_is(egg):
    model, data, ripples = egg
    renderer = RippleRenderer(model, ripples, width=96, height=72)
    flat = renderer.render(data, "side").astype(int)
    ripples["egg"].add_impulse((0.0, -0.3, 0.1), 0.02, radius=0.1)
    ripples["egg"].step(0.1)
    changed = np.abs(renderer.render(data, "side").astype(int) - flat).max(axis=2) > 4
    ripples.reset()
    assert changed.any()
    assert not changed[:, :8].any()
    assert not changed[:, -8:].any()


def test_the_same_state_gives_the_same_picture_in_the_colour_of_the_geom(egg):
    model, data, ripples = egg
    camera = Camera(lookat=(0, 0, 0), distance=2.0, azimuth=90.0, elevation=-20.0)
    first = RippleRenderer(model, ripples, width=96, height=72).render(data, camera)
    assert np.array_equal(first, RippleRenderer(model, ripples, width=96, height=72).render(data, camera))
    red, green, blue = first[30:42, 42:54].reshape(-1, 3).mean(axis=0)
    assert red > 1.5 * green
    assert red > 1.5 * blue


def test_without_a_camera_it_is_the_free_one_of_the_model(egg):
    model, data, ripples = egg
    renderer = RippleRenderer(model, ripples, width=96, height=72)
    free = Camera(lookat=tuple(model.stat.center), distance=1.5 * model.stat.extent, azimuth=90.0, elevation=-45.0)
    assert np.array_equal(renderer.render(data), renderer.render(data, free))


def test_an_unknown_look_or_camera_is_refused_by_name(egg):
    model, data, ripples = egg
    with pytest.raises(RippleError, match="glass"):
        RippleRenderer(model, ripples, looks={"egg": "glass"})
    with pytest.raises(RippleError, match="above"):
        RippleRenderer(model, ripples, width=96, height=72).render(data, "above")


def test_cameras_are_given_as_to_mujocos_renderer(egg):
    model, data, ripples = egg
    renderer = RippleRenderer(model, ripples, width=96, height=72)
    free = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, free)
    for camera, same in ((0, "side"), (-1, None), (free, None)):
        assert np.array_equal(renderer.render(data, camera), renderer.render(data, same))
    with pytest.raises(RippleError, match="camera is list; valid are"):
        renderer.render(data, [0.0, 0.0, 1.0])


@pytest.mark.filterwarnings("error")
def test_data_without_poses_is_drawn_as_forwarded(egg):
    """As it comes from `MjData(model)`; it stays as it is."""
    model, data, ripples = egg
    renderer = RippleRenderer(model, ripples, width=96, height=72)
    new = mujoco.MjData(model)
    assert np.array_equal(renderer.render(new, "side"), renderer.render(data, "side"))
    assert not new.xquat.any()


def test_a_model_in_which_another_geom_would_ripple_is_refused(egg):
    _, _, ripples = egg
    egg_geom = '<geom name="egg" type="ellipsoid" size="0.4 0.3 0.3" rgba="0.9 0.1 0.1 1"/>'
    for changed, what in (
        ('<geom name="box" type="box" size="1 1 1"/>' + egg_geom, "another body_parentid|another geom_"),
        (egg_geom.replace("0.4", "0.5"), "another geom_size"),
        (egg_geom.replace('"egg"', '"other"'), "another names of geoms"),
    ):
        other = mujoco.MjModel.from_xml_string(MODEL.replace(egg_geom, changed))
        with pytest.raises(RippleError, match=what):
            RippleRenderer(other, ripples, width=96, height=72)


def test_a_copy_of_the_model_in_other_colours_is_drawn_in_them(egg):
    model, data, ripples = egg
    blue = copy.copy(model)
    blue.geom_rgba[0], blue.body_mass[0] = [0.1, 0.1, 0.9, 1.0], 2.0
    red, _, blue_light = RippleRenderer(blue, ripples, width=96, height=72).render(data)[30:42, 42:54].mean(axis=(0, 1))
    assert blue_light > 1.5 * red
