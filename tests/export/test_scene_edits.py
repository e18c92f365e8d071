"""`RippleRenderer` draws what a program writes into the scene before `render`, as MuJoCo does."""

import os
import subprocess
import sys
from pathlib import Path

import edited_scenes
import mujoco
import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from ripple_sim import Material, RippleRenderer, Ripples


@pytest.fixture(scope="module")
def mujocos(tmp_path_factory):
    """What `mujoco.Renderer` draws; it takes over the context of its process."""
    file = tmp_path_factory.mktemp("mujocos") / "drawn.npz"
    program = Path(edited_scenes.__file__)
    environment = {**os.environ, "MUJOCO_GL": "egl"}
    subprocess.run([sys.executable, program, file], env=environment, check=True, timeout=100)
    with np.load(file) as drawn:
        return dict(drawn)


@pytest.fixture(scope="module")
def flat():
    """A renderer whose target has no waves, and its data."""
    model, data = edited_scenes.state()
    with RippleRenderer(
        model, Ripples(model, {"target": Material()}, resolution=16), *edited_scenes.SIZE
    ) as renderer:
        yield renderer, data


@pytest.mark.parametrize("name", edited_scenes.EDITS)
@pytest.mark.filterwarnings("ignore:not drawn")
def test_edits_show_in_colours_depth_and_segmentation_as_in_mujoco(mujocos, flat, name):
    ours = edited_scenes.drawn(*flat, name)
    theirs = {kind: mujocos[f"{name} {kind}"] for kind in ours}
    code, expected = (each["segmentation"] @ [1, 1000] for each in (ours, theirs))
    # silhouettes within a pixel
    inside = minimum_filter(expected, 3) == maximum_filter(expected, 3)
    assert (code[inside] == expected[inside]).mean() > 0.999
    seen = inside & (code == expected) & (code >= 0)
    np.testing.assert_allclose(ours["depth"][seen], theirs["depth"][seen], rtol=2e-5, atol=1e-3)
    # where shapes come and go, colours change in both
    objects = [each["segmentation"] for each in (ours, theirs)]
    change, expected_change = (
        abs(each["after"].astype(int) - each["before"]).max(axis=2) > 16 for each in (ours, theirs)
    )
    solid = inside & (objects[1][..., 0] != edited_scenes.FLOOR)
    assert (change == expected_change)[solid].mean() > 0.8
    assert expected_change.sum() > 50


def test_colours_are_those_of_the_scene(flat):
    renderer, data = flat
    for entry, rgb in ((edited_scenes.TARGET, 2), (edited_scenes.FLOOR, 0), (edited_scenes.BOX, 1)):
        renderer.update_scene(data, "c")
        before = renderer.render().astype(int)
        renderer.enable_segmentation_rendering()
        shown = (renderer.render() == [entry, edited_scenes.GEOM]).all(axis=2)
        renderer.disable_segmentation_rendering()
        renderer.scene.geoms[entry].rgba = [*np.eye(3)[rgb] * 0.9, 1]
        change = (renderer.render() - before)[shown].mean(axis=0)
        assert change.argmax() == rgb, entry
        assert change[rgb] - change.min() > 20, entry


def test_lights_can_be_added_to_and_removed_from_the_scene(flat):
    renderer, data = flat
    renderer.update_scene(data, "c")
    before = renderer.render().astype(int)
    edited_scenes.lamp(renderer.scene)
    lit = renderer.render().astype(int)
    renderer.scene.geoms[edited_scenes.LINK].pos = [-1, -1, 2]  # in the beam
    shaded = renderer.render().astype(int)
    renderer.scene.nlight = 0
    dark = renderer.render().astype(int)
    floor = (slice(60, 80), slice(40, 56))
    red, _, blue = (lit - before)[floor].mean(axis=(0, 1))
    assert red > 20 and red - blue > 30
    assert (shaded - lit)[..., 0].min() < -20
    assert dark.mean() < 0.8 * before.mean()


def test_waves_follow_a_geom_that_is_moved_in_the_scene():
    model, data = edited_scenes.state()
    ripples = Ripples(model, {"target": Material(speed=0.5)}, resolution=16)
    ripples["target"].height = np.full_like(ripples["target"].height, 0.1)
    with RippleRenderer(model, ripples, *edited_scenes.SIZE) as renderer:
        renderer.enable_depth_rendering()
        nearest = []
        for place in ([1, 0, 0.5], [-1, 0, 2]):
            renderer.update_scene(data, "c")
            renderer.scene.geoms[edited_scenes.LINK].rgba[3] = 0
            renderer.scene.geoms[edited_scenes.TARGET].pos = place
            renderer.enable_segmentation_rendering()
            mask = (renderer.render() == [edited_scenes.TARGET, edited_scenes.GEOM]).all(axis=2)
            renderer.disable_segmentation_rendering()
            renderer.enable_depth_rendering()
            centre = np.array(place) - data.camera("c").xpos
            nearest.append(
                -centre @ data.camera("c").xmat.reshape(3, 3)[:, 2] - renderer.render()[mask].min()
            )
    np.testing.assert_allclose(nearest, 0.5, atol=0.01)  # radius 0.4 m, and the waves


def test_an_entry_of_another_shape_is_drawn_without_ripples_with_one_warning(flat):
    renderer, data = flat
    renderer.update_scene(data, "c")
    renderer.scene.geoms[edited_scenes.TARGET].size = [0.9, 0.9, 0.9]
    renderer.enable_segmentation_rendering()
    with pytest.warns(match="not drawn: the ripples of 'target', which has another shape"):
        large = (renderer.render() == [edited_scenes.TARGET, edited_scenes.GEOM]).all(axis=2).sum()
    renderer.update_scene(data, "c")
    small = (renderer.render() == [edited_scenes.TARGET, edited_scenes.GEOM]).all(axis=2).sum()
    renderer.disable_segmentation_rendering()
    assert large > 3 * small > 100


def test_the_scene_stays_as_the_program_wrote_it(flat):
    renderer, data = flat
    renderer.update_scene(data, "c")
    scene = renderer.scene
    added = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(
        added,
        mujoco.mjtGeom.mjGEOM_SPHERE,
        np.full(3, 0.2),
        np.zeros(3),
        np.eye(3).ravel(),
        np.ones(4, np.float32),
    )
    added.objid = 5
    added.objtype = 3
    added.segid = 9
    scene.ngeom += 1
    renderer.render()
    assert (added.objid, added.objtype, added.segid) == (5, 3, 9)
