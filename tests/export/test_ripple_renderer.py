"""`RippleRenderer` in a user's loop, instead of `mujoco.Renderer`."""

import copy
import os
import subprocess
import sys
import warnings
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import pytest
import unrippled
from mujoco_models import posed
from scipy.ndimage import maximum_filter, minimum_filter

from ripple_sim import Camera, Material, RippleError, RippleRenderer, Ripples, RippleWarning

MODEL = """<mujoco><worldbody>
  <geom name="egg" type="ellipsoid" size="0.4 0.3 0.3" rgba="0.9 0.1 0.1 1"/>
  <camera name="side" pos="0 -2 0.3" xyaxes="1 0 0 0 0 1"/></worldbody></mujoco>"""


class Egg(NamedTuple):
    """An egg that ripples, and its renderer of 96 x 72 pixels."""

    model: mujoco.MjModel
    data: mujoco.MjData
    ripples: Ripples
    renderer: RippleRenderer


@pytest.fixture(scope="module")
def egg() -> Egg:
    model, data = posed(MODEL)
    ripples = Ripples(model, {"egg": Material(speed=0.5)}, resolution=32, backend="cpu")
    return Egg(model, data, ripples, RippleRenderer(model, ripples, width=96, height=72))


def test_a_ripple_changes_the_picture_where_it_is(egg):
    _, data, ripples, renderer = egg
    flat = renderer.render(data, "side").astype(int)
    ripples["egg"].add_impulse((0.0, -0.3, 0.1), 0.02, radius=0.1)
    ripples["egg"].step(0.1)
    # more than the rounding of the tone curve
    changed = np.abs(renderer.render(data, "side").astype(int) - flat).max(axis=2) > 4
    ripples.reset()
    assert changed.any()
    assert not changed[:, [*range(8), *range(-8, 0)]].any()


@pytest.mark.parametrize(("impulse", "lines"), [(0.0, 0), (1e-6, 1), (3.0, 0)])
def test_warning_at_close_about_waves_that_no_picture_showed(egg, impulse, lines):
    model, data, ripples, _ = egg
    renderer = RippleRenderer(model, ripples, width=96, height=72)
    ripples["egg"].add_impulse((0.0, -0.3, 0.1), impulse, radius=0.1)
    ripples["egg"].step(0.1)
    renderer.render(data, "side")
    ripples.reset()
    with warnings.catch_warnings(record=True, action="always") as caught:
        renderer.close()
        renderer.close()
    assert len(caught) == lines
    assert all("no wave on 'egg' was higher than a pixel" in str(w.message) for w in caught)


def test_the_same_state_gives_the_same_picture_in_the_colour_of_the_geom(egg):
    model, data, ripples, renderer = egg
    camera = Camera(lookat=(0, 0, 0), distance=2.0, azimuth=90.0, elevation=-20.0)
    first = renderer.render(data, camera)
    assert np.array_equal(
        first, RippleRenderer(model, ripples, width=96, height=72).render(data, camera)
    )
    red, green, blue = first[30:42, 42:54].mean(axis=(0, 1))
    assert red > 1.5 * max(green, blue)


def test_cameras_are_given_as_to_mujocos_renderer_and_default_to_the_free_camera(
    egg,
):
    model, data, ripples, renderer = egg
    free = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, free)
    ours = Camera(
        lookat=tuple(model.stat.center),
        distance=1.5 * model.stat.extent,
        azimuth=90.0,
        elevation=-45.0,
    )
    for camera, same in ((0, "side"), (-1, None), (free, None), (ours, None)):
        assert np.array_equal(renderer.render(data, camera), renderer.render(data, same))
    with pytest.raises(RippleError, match=r"camera must be .*, got list"):
        renderer.render(data, [0.0, 0.0, 1.0])
    with pytest.raises(RippleError, match="glass"):
        RippleRenderer(model, ripples, looks={"egg": "glass"})


def test_scene_camera_is_the_camera_of_the_picture(egg):
    model, data, _, renderer = egg
    fixed = Camera.from_mjcf(model, data, "side")
    tracking = mujoco.MjvCamera()
    tracking.type = mujoco.mjtCamera.mjCAMERA_TRACKING
    tracking.trackbodyid = 0
    tracking.distance = 3.0
    seen = {}
    ours = Camera(lookat=(0.1, 0.2, 0.3), distance=2.0, azimuth=20.0, elevation=-30.0, fovy=33.0)
    given = {
        "name": "side",
        "id": 0,
        "numpy": np.int64(0),
        "fixed": fixed,
        "ours": ours,
        "tracking": tracking,
    }
    for kind, camera in given.items():
        renderer.update_scene(data, camera)
        pair = renderer.scene.camera
        eye = np.mean([each.pos for each in pair], axis=0)
        seen[kind] = [
            *eye,
            *pair[0].forward,
            *pair[0].up,
            pair[0].frustum_top,
            pair[0].frustum_near,
        ]
    for kind in ("id", "numpy", "fixed"):
        np.testing.assert_allclose(seen[kind], seen["name"], atol=1e-6)
    assert seen["ours"][:3] == pytest.approx(ours.pose().position, abs=1e-6)
    assert seen["ours"][9] / seen["ours"][10] == pytest.approx(
        np.tan(np.radians(33.0 / 2)), rel=1e-5
    )
    assert seen["tracking"][:3] == pytest.approx(
        tracking.lookat - 3.0 * np.array(seen["tracking"][3:6]), abs=1e-5
    )


def test_cameras_that_are_not_there_are_refused_in_mujocos_words(egg):
    _, data, _, renderer = egg
    for camera, words in (
        ("top", 'The camera "top" does not exist'),
        (1, r"The camera id 1 is out of range \[-1, 1\)"),
        (np.int64(-2), r"The camera id -2 is out of range \[-1, 1\)"),
    ):
        with pytest.raises(ValueError, match=words) as error:
            renderer.update_scene(data, camera)
        assert isinstance(error.value, RippleError)


def test_a_camera_after_kinematics_alone_gets_its_pose_with_a_warning(egg):
    model, data, _, renderer = egg
    new = mujoco.MjData(model)
    mujoco.mj_kinematics(model, new)
    with pytest.warns(RippleWarning, match="no poses of cameras") as told:
        frame = renderer.render(new, "side")
    assert len(told) == 1
    assert told[0].filename == __file__
    assert np.array_equal(frame, renderer.render(data, "side"))
    assert not new.cam_xmat.any()


@pytest.mark.filterwarnings("error")
def test_data_without_poses_is_drawn_as_if_forwarded(egg):
    """New data from `MjData(model)` is drawn, and is not changed."""
    model, data, _, renderer = egg
    new = mujoco.MjData(model)
    assert np.array_equal(renderer.render(new, "side"), renderer.render(data, "side"))
    assert not new.xquat.any()


def test_data_of_a_changed_model_is_drawn_with_the_sizes_of_the_renderers_model(egg):
    model, data, _, renderer = egg
    larger = copy.copy(model)
    larger.geom_size[:] *= 1.5
    of_larger = mujoco.MjData(larger)
    mujoco.mj_forward(larger, of_larger)
    assert np.array_equal(renderer.render(of_larger, "side"), renderer.render(data, "side"))
    without_egg = mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>")
    with pytest.raises(RippleError, match="data belongs to another model"):
        renderer.render(mujoco.MjData(without_egg), "side")


def test_a_model_in_which_another_geom_would_ripple_is_refused(egg):
    _, _, ripples, _ = egg
    egg_geom = '<geom name="egg" type="ellipsoid" size="0.4 0.3 0.3" rgba="0.9 0.1 0.1 1"/>'
    for changed, what in (
        (
            '<geom name="box" type="box" size="1 1 1"/>' + egg_geom,
            "another body_parentid|another geom_",
        ),
        (egg_geom.replace("0.4", "0.5"), "another geom_size"),
        (egg_geom.replace('"egg"', '"other"'), "another names of geoms"),
    ):
        other = mujoco.MjModel.from_xml_string(MODEL.replace(egg_geom, changed))
        with pytest.raises(RippleError, match=what):
            RippleRenderer(other, ripples, width=96, height=72)


def test_a_copied_model_is_drawn_in_its_own_colour_or_in_the_named_look(egg):
    model, data, ripples, _ = egg
    changed = copy.copy(model)

    def middle(*color: float, **looks: str) -> np.ndarray:
        changed.geom_rgba[0] = [*color, 1.0]
        return (
            RippleRenderer(changed, ripples, 72, 96, looks=looks)
            .render(data)[30:42, 42:54]
            .mean(axis=(0, 1))
        )

    changed.body_mass[0] = 2.0
    red, _, blue = middle(0.1, 0.1, 0.9)
    assert blue > 1.5 * red
    assert np.ptp(middle(0.5, 0.5, 0.5)) < 15  # as in MuJoCo where there is no colour
    assert np.ptp(middle(0.5, 0.5, 0.5, egg="rubber")) > 60


@pytest.fixture(scope="module")
def mujocos(tmp_path_factory):
    """What `mujoco.Renderer` draws; it takes over the context of its process."""
    file = tmp_path_factory.mktemp("mujocos") / "drawn.npz"
    program = Path(unrippled.__file__)
    environment = {**os.environ, "MUJOCO_GL": "egl"}
    subprocess.run([sys.executable, program, file], env=environment, check=True, timeout=100)
    with np.load(file) as drawn:
        return dict(drawn)


@pytest.mark.parametrize("name", unrippled.WORLDS)
def test_without_ripples_depth_and_segmentation_are_mujocos(mujocos, name):
    model, data = unrippled.state_of(name)
    ripples = Ripples(model, {"target": Material()}, resolution=16, backend="cpu")
    with RippleRenderer(model, ripples, *unrippled.SIZE) as renderer:
        depth, segmentation = unrippled.drawn(renderer, data, name)
    theirs = mujocos[f"depth {name}"]
    objects = mujocos[f"segmentation {name}"]
    assert (depth.dtype, segmentation.dtype) == (np.float32, np.int32)
    # silhouettes within a pixel
    for one, other in ((segmentation, objects), (objects, segmentation)):
        around = [np.roll(other, shift, axis=(0, 1)) for shift in np.ndindex(3, 3)]
        near = np.any(
            [np.all(np.roll(each, (-1, -1), axis=(0, 1)) == one, axis=2) for each in around], axis=0
        )
        assert near.all()
    code = segmentation[..., 0] + 1000 * segmentation[..., 1]
    inside = (minimum_filter(code, 3) == maximum_filter(code, 3)) & (segmentation == objects).all(
        axis=2
    )
    seen = inside & (code >= 0)
    assert seen.sum() > 100
    np.testing.assert_allclose(depth[seen], theirs[seen], rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(depth[inside & ~seen], theirs[inside & ~seen], rtol=1e-3)


@pytest.mark.parametrize("name", unrippled.LIT)
@pytest.mark.filterwarnings("error::ripple_sim.RippleWarning")
def test_lights_and_surroundings_are_mujocos(mujocos, name):
    model, data = unrippled.lit_state(name)
    with RippleRenderer(model, Ripples(model, {}), *unrippled.SIZE) as renderer:
        colours, shown = unrippled.lit_frame(renderer, data, name)
    theirs = mujocos[f"colours {name}"].astype(float)
    there = mujocos[f"shown {name}"]
    same = (shown == there).all(axis=2)
    around = same & (shown[..., 0] == -1)
    assert same.mean() > 0.99
    if around.any():
        np.testing.assert_allclose(
            colours[around].mean(axis=0), theirs[around].mean(axis=0), atol=3.0
        )
    if name in ("headlight", "lamp", "no skybox"):
        assert not colours[around].any()
    if name in ("haze", "fog"):
        at_horizon = slice(24, 36)
        rows = np.abs(colours[at_horizon].mean(axis=1) - theirs[at_horizon].mean(axis=1))
        assert rows.max() < 30.0
    for geom in set(there[same][:, 0].tolist()) - {
        -1
    }:  # light adds up in linear light here, so that what faces it aslant is brighter
        ours, other = (
            each[same & (shown[..., 0] == geom)].mean(axis=0) for each in (colours, theirs)
        )
        np.testing.assert_allclose(ours, other, atol=60.0)
        assert (ours[other < 1.0] < 8.0).all()  # no light of a colour that the lamps lack


def test_the_studio_lights_on_demand_and_unsupported_flags_are_named(egg):
    model, data, ripples, _ = egg
    seen = {}
    for lighting in ("model", "studio", "auto"):
        with RippleRenderer(model, ripples, 72, 96, lighting=lighting) as renderer:
            seen[lighting] = renderer.render(data, "side")
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = 0
            with warnings.catch_warnings(record=True, action="always") as messages:
                renderer.render()
            assert len(messages) == (0 if lighting == "model" else 1)
    np.testing.assert_array_equal(seen["studio"], seen["auto"])  # the model has no <light>
    assert not seen["model"][0, 0].any()
    assert seen["studio"][0, 0].min() > 50
    with pytest.raises(
        RippleError, match="lighting must be one of 'auto', 'model', 'studio', got 'disco'"
    ):
        RippleRenderer(model, ripples, 72, 96, lighting="disco")


def test_a_transparent_target_shows_objects_behind_it(egg):
    """MuJoCo blends twice: a target that lets 40 % pass shows 16 % of the objects behind it."""
    model, data = posed(
        MODEL.replace(
            "</worldbody>",
            """<geom type="box" size="2 .1 2" pos="0 1 0" rgba="0 0 1 1"/>
        <light pos="0 -3 3" dir="0 1 -1"/></worldbody>""",
        )
    )
    ripples = Ripples(model, {"egg": Material()}, resolution=16, backend="cpu")
    seen = []
    with RippleRenderer(model, ripples, 72, 96, looks={"egg": "model"}) as renderer:
        for opacity in (1.0, 0.6, 0.2, 1.0):
            model.geom_rgba[0, 3] = opacity
            seen.append(renderer.render(data, "side")[30:42, 42:54].mean(axis=(0, 1)))
        renderer.enable_segmentation_rendering()
        assert (renderer.render()[36, 48] == [0, mujoco.mjtObj.mjOBJ_GEOM]).all()
    solid, slightly, mostly, again = seen
    np.testing.assert_array_equal(solid, again)
    wall = (mostly - (1 - 0.8**2) * solid) / 0.8**2
    np.testing.assert_allclose(slightly, (1 - 0.4**2) * solid + 0.4**2 * wall, atol=4.0)
    assert wall[2] > 1.4 * wall[0] and mostly[2] > slightly[2] > solid[2]


def test_ripples_show_in_depth_and_segmentation(egg):
    _, data, ripples, renderer = egg
    renderer.update_scene(data, "side")
    renderer.enable_depth_rendering()
    flat = renderer.render()
    ripples["egg"].height = np.full_like(ripples["egg"].height, 0.05)
    assert np.array_equal(renderer.render(), flat)  # as it was when the scene was updated
    risen = renderer.render(data, "side")
    renderer.enable_segmentation_rendering()
    egg_seen = (renderer.render() == [0, mujoco.mjtObj.mjOBJ_GEOM]).all(axis=2)
    renderer.disable_segmentation_rendering()
    ripples.reset()
    assert (flat - risen)[51, 48] == pytest.approx(0.05, abs=2e-3)
    assert (egg_seen == (risen < risen.max())).all()
    assert egg_seen.sum() > 1.15 * (flat < flat.max()).sum()


def test_a_program_written_for_mujocos_renderer_runs(egg):
    model, data, ripples, _ = egg
    with RippleRenderer(model, ripples, 30, 40) as renderer:
        assert (renderer.model, renderer.height, renderer.width) == (model, 30, 40)
        renderer.update_scene(data)
        assert renderer.scene.ngeom == 1
        colours = renderer.render()
        given = np.zeros((30, 40, 3))
        assert renderer.render(out=given) is given
        assert np.array_equal(given, colours)
        renderer.enable_depth_rendering()
        with pytest.raises(ValueError, match=r"out must have .*, \[30, 40\], got \[30, 40, 3\]"):
            renderer.render(out=given)
        renderer.disable_segmentation_rendering()  # which depth is not
        assert renderer.render().shape == (30, 40)
        renderer.enable_segmentation_rendering()
        assert renderer.render().shape == (30, 40, 2)
        renderer.disable_segmentation_rendering()
        assert np.array_equal(renderer.render(), colours)
        for camera, message in (
            ("top", "no camera 'top'"),
            (1, "no camera 1"),
            (-2, "no camera -2"),
        ):
            with pytest.raises(ValueError, match=message):
                renderer.update_scene(data, camera)
    renderer.close()
    with pytest.raises(RuntimeError, match="closed: render cannot be called after close"):
        renderer.render()


def test_pictures_before_the_first_update_are_empty(egg):
    model, _, ripples, _ = egg
    with RippleRenderer(model, ripples, 30, 40) as renderer:
        colours = renderer.render()
        renderer.enable_depth_rendering()
        depth = renderer.render()
        renderer.enable_segmentation_rendering()
        segmentation = renderer.render()
    assert (colours.shape, colours.dtype, depth.shape, depth.dtype) == (
        (30, 40, 3),
        np.uint8,
        (30, 40),
        np.float32,
    )
    assert (segmentation.shape, segmentation.dtype) == ((30, 40, 2), np.int32)
    assert not colours.any() and (segmentation == -1).all()
    np.testing.assert_allclose(depth, model.vis.map.zfar * model.stat.extent)


SHOWN = """<mujoco><statistic meansize=".3"/><worldbody><geom name="egg" size=".3" pos="-.4 0 0"/>
  <geom size=".1" pos=".4 0 0" group="4"/><site size=".1" pos=".4 0 .3" group="3"/>
  <body pos=".4 0 -.3"><joint/><geom size=".06"/></body></worldbody></mujoco>"""


def test_options_choose_the_drawn_objects_and_one_warning_names_the_rest():
    model, data = posed(SHOWN)
    ripples = Ripples(model, {"egg": Material()}, resolution=8)
    kinds = mujoco.mjtObj
    option = mujoco.MjvOption()
    with RippleRenderer(model, ripples, 60, 80) as renderer:

        def seen() -> set[tuple[int, int]]:
            renderer.update_scene(data, scene_option=option)
            return {
                tuple(each) for each in renderer.render().reshape(-1, 2).tolist() if each[0] >= 0
            }

        renderer.enable_segmentation_rendering()
        body = (2, int(kinds.mjOBJ_GEOM))
        egg = (0, int(kinds.mjOBJ_GEOM))
        hidden = (1, int(kinds.mjOBJ_GEOM))
        assert seen() == {egg, body}
        option.geomgroup[4] = option.sitegroup[3] = option.flags[mujoco.mjtVisFlag.mjVIS_JOINT] = 1
        assert seen() == {
            egg,
            body,
            hidden,
            (0, int(kinds.mjOBJ_SITE)),
            (0, int(kinds.mjOBJ_JOINT)),
        }
        option.flags[mujoco.mjtVisFlag.mjVIS_STATIC] = 0  # the egg, too
        assert seen() == {body, (0, int(kinds.mjOBJ_JOINT))}
        option = mujoco.MjvOption()
        option.geomgroup[0] = 0
        assert seen() == set()
        option = mujoco.MjvOption()
        option.label = mujoco.mjtLabel.mjLABEL_GEOM
        renderer.disable_segmentation_rendering()
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_WIREFRAME] = 1
        with pytest.warns(RippleWarning) as told:
            renderer.update_scene(data, scene_option=option)
            renderer.render()
        lost = {
            "not drawn: labels; all else of the scene is",
            "the scene's flags have no effect: mjRND_WIREFRAME",
        }
        assert {str(each.message).split("; those")[0] for each in told} == lost
        with warnings.catch_warnings(action="error"):
            renderer.render()


def test_geoms_that_are_added_to_the_scene_are_seen(egg):
    _, data, _, renderer = egg
    renderer.update_scene(data, "side")
    plain = renderer.render().astype(int)
    scene = renderer.scene
    arrow = scene.geoms[scene.ngeom]
    rgba = np.array([0, 0, 1, 1], np.float32)
    kind = mujoco.mjtGeom.mjGEOM_ARROW
    zero = np.zeros(3)
    mujoco.mjv_initGeom(arrow, kind, zero, zero, np.eye(3).ravel(), rgba)
    mujoco.mjv_connector(arrow, kind, 0.05, np.array([0, -0.5, -0.3]), np.array([0, -0.5, 3.9]))
    scene.ngeom += 1
    added = renderer.render().astype(int)
    changed = np.abs(added - plain).max(axis=2) > 40
    assert changed[:70, 47:49].all(), "also where nothing else is, up to the frame's edge"
    assert (added[changed][:, 2] > added[changed][:, 0] + 30).mean() > 0.8
    renderer.update_scene(data, "side")
    assert np.array_equal(renderer.render(), plain)


# a link as models of robots have it: parts of several materials that are seen, and over them what
# collides
LINK = """<mujoco><option timestep="0.002"/><compiler inertiafromgeom="true"/>
  <default><geom density="800"/>
    <default class="visual"><geom type="mesh" contype="0" conaffinity="0" group="1" mass="0"/>
    </default>
    <default class="collision"><geom type="box" group="0" rgba="0 1 0 1"/></default></default>
  <asset><material name="white" rgba="1 1 1 1"/><material name="black" rgba=".05 .05 .05 1"/>
    <mesh name="shell" vertex="0 0 0  .4 0 0  0 .3 0  .4 .3 0  0 0 .2  .4 0 .2  0 .3 .2  .4 .3 .2"/>
    <mesh name="cap" vertex="0 0 0  .1 0 0  0 .1 0  .1 .1 0  0 0 .1  .1 0 .1  0 .1 .1  .1 .1 .1"/>
    </asset>
  <worldbody><body name="link" pos="0 0 .5"><joint axis="0 1 0" damping="9" stiffness="99"/>
    <geom class="visual" mesh="shell" material="white" pos=".2 0 0"/>
    <geom class="visual" mesh="cap" material="black" pos=".6 0 .05"/>
    <geom class="collision" name="box" size=".2 .15 .102" pos=".4 .15 .1"/></body>
    <body pos=".4 .15 .9"><freejoint/><geom name="ball" size=".05"/></body></worldbody>
  <keyframe><key name="home" qpos="0 .4 .15 .8 1 0 0 0"/></keyframe></mujoco>"""


def test_a_visual_mesh_ripples_and_is_drawn_while_its_collider_is_hidden():
    model = mujoco.MjModel.from_xml_string(LINK)
    data = mujoco.MjData(model)
    hit = Material.suited(size=0.4, hit=(0.4, 2.0))
    ripples = Ripples(model, {"link/0": hit}, resolution=24, backend="cpu")
    option = mujoco.MjvOption()
    given = []
    with RippleRenderer(model, ripples, 60, 80) as renderer:
        renderer.enable_segmentation_rendering()
        for _ in range(2):  # episodes, from a keyframe
            mujoco.mj_resetDataKeyframe(model, data, 0)
            ripples.step(data)
            assert not ripples["link/0"].height.any()
            ripples.mj_step(data, 150)
            given.append(sum(each.impulse for each in ripples.last_impulses))
            assert {each.other for each in ripples.last_impulses} == {"ball"}
        seen = []
        for group in (1, 0):
            option.geomgroup[0] = group
            renderer.update_scene(data, Camera((0.4, 0.15, 0.6), 1.2, 120.0, -40.0), option)
            seen.append(set(renderer.render()[..., 0].ravel().tolist()))
    assert given[0] == pytest.approx(given[1]) and given[0] > 0.3
    assert np.abs(ripples["link/0"].height).max() > 3e-4
    assert 2 in seen[0] - seen[1]
    assert {0, 1} <= seen[1]


def test_a_colour_that_is_none_is_refused(ripples: Ripples) -> None:
    for color in [(0.1, 0.2), (0.0, 0.0, 255.0), "red"]:
        with pytest.raises(RippleError, match="colour of 'egg' must be three numbers from 0 to 1"):
            RippleRenderer(ripples.model, ripples, colors={"egg": color})
