"""Changes of the model between two frames are drawn in the next one, as by a new renderer."""

import numpy as np
import pytest
from mujoco_models import posed

from ripple_sim import Material, RippleError, RippleRenderer, Ripples
from ripple_sim.coupling.watched import WatchedArray

XML = """<mujoco><asset>
<texture name="t" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".8 .8 .8" width="64"
height="64"/><texture name="sides" type="cube" builtin="flat" rgb1=".9 .2 .2" width="8" height="8"/>
<material name="floor" texture="t" texrepeat="4 4"/><material name="paint" rgba="1 .5 .2 1"/>
<material name="sides" texture="sides"/><mesh name="tet" vertex="0 0 0 .5 0 0 0 .5 0 0 0 .5"/>
<hfield name="hills" nrow="12" ncol="12" size=".5 .5 .4 .1"/></asset>
<worldbody><light pos="0 -1 4" dir="0 .2 -1"/><camera name="c" pos="0 -5 3" xyaxes="1 0 0 0 .5 1"/>
<geom name="floor" type="plane" size="5 5 .1" material="floor"/>
<geom name="target" type="box" size=".4 .4 .4" pos="-1 0 .5" rgba=".7 .2 .2 1"/>
<geom name="other" type="box" size=".4 .4 .4" pos="1 0 .5" material="paint"/>
<geom name="dice" type="box" size=".3 .3 .3" pos="0 -1 .3" material="sides"/>
<geom name="rock" type="mesh" mesh="tet" pos="1.5 -1.5 .3" rgba=".2 .7 .2 1"/>
<geom name="hills" type="hfield" hfield="hills" pos="-1.5 -1.5 .1" rgba=".3 .6 .9 1"/></worldbody>
</mujoco>"""
SIZE = 96, 128


def randomised_colours(model):
    model.geom("target").rgba[:] = 0, 0, 1, 1
    model.geom("other").rgba[:] = 0, 1, 1, 1
    model.mat_rgba[model.material("floor").id] = 1, 0.2, 0.2, 1


def materials(model):
    model.mat_emission[model.material("paint").id] = 1.0
    model.mat_specular[:] = 0.1
    model.mat_texrepeat[model.material("floor").id] = 9, 2


def reflecting_floor(model):
    model.mat_reflectance[model.material("floor").id] = 0.7


def floor_without_texture(model):
    model.mat_texid[model.material("floor").id] = -1


def target_of_a_material(model):
    model.geom_matid[model.geom("target").id] = model.material("sides").id
    model.geom("target").rgba[:] = 0.5, 0.5, 0.5, 1


def textures(model):
    model.tex_data[:] = 255 - model.tex_data


def sizes(model):
    model.geom("other").size[:] = 0.2, 0.3, 0.9


def hills(model):
    rows, columns = np.mgrid[:12, :12]
    model.hfield_data[:] = (0.5 + 0.5 * np.sin(rows) * np.cos(columns)).ravel()


def rock(model):
    model.mesh_vert[:] *= 2


def lights(model):
    model.light_diffuse[0] = 0.2, 0.9, 0.2
    model.vis.headlight.diffuse[:] = 0.1


CHANGES = [
    randomised_colours,
    materials,
    reflecting_floor,
    floor_without_texture,
    target_of_a_material,
    textures,
    sizes,
    hills,
    rock,
    lights,
]


WRITTEN = (
    "geom_rgba",
    "geom_size",
    "geom_matid",
    "mat_rgba",
    "mat_emission",
    "mat_specular",
    "mat_reflectance",
    "mat_texrepeat",
    "mat_texid",
    "tex_data",
    "hfield_data",
    "mesh_vert",
    "light_diffuse",
)


def images_of(renderer, data):
    renderer.update_scene(data, "c")
    images = [renderer.render()]
    renderer.enable_depth_rendering()
    images.append(renderer.render())
    renderer.enable_segmentation_rendering()
    images.append(renderer.render())
    renderer.disable_segmentation_rendering()
    return images


def scene():
    model, data = posed(XML)
    return (
        model,
        data,
        Ripples(model, {"target": Material(density=10.0)}, resolution=8, backend="cpu"),
    )


@pytest.fixture(scope="module")
def drawn():
    """A frame, and a function that draws the changed model with this renderer and a new one."""
    model, data, ripples = scene()
    kept = {name: getattr(model, name).copy() for name in WRITTEN}
    headlight = model.vis.headlight.diffuse.copy()
    with RippleRenderer(model, ripples, *SIZE) as renderer:
        before = images_of(renderer, data)

        def after(change):
            change(model)
            now = images_of(renderer, data)
            with RippleRenderer(model, ripples, *SIZE) as other:
                expected = images_of(other, data)
            for name, array in kept.items():
                getattr(model, name)[:] = array
            model.vis.headlight.diffuse = headlight
            return now, expected, images_of(renderer, data)

        yield before, after


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__)
def test_changes_of_the_model_and_their_undoing_show_in_the_next_frame(drawn, change):
    before, after = drawn
    now, expected, undone = after(change)
    for one, other in ((now, expected), (undone, before)):
        assert (abs(one[0].astype(int) - other[0]).max(axis=2) > 2).mean() < 2e-3
        np.testing.assert_array_equal(one[2], other[2])
        np.testing.assert_allclose(one[1], other[1], rtol=1e-5)
    assert (abs(now[0].astype(int) - before[0]).max(axis=2) > 8).sum() > 40


def test_changes_before_the_first_frame_are_seen():
    model, data, ripples = scene()
    with RippleRenderer(model, ripples, *SIZE) as renderer:
        textures(model)
        first = images_of(renderer, data)
        textures(model)
        assert abs(images_of(renderer, data)[0].astype(int) - first[0]).max() > 100


def test_uploads_with_mujocos_names_work_and_other_names_are_refused():
    model, data, ripples = scene()
    with RippleRenderer(model, ripples, *SIZE) as renderer:
        images_of(renderer, data)
        textures(model)
        renderer.upload_texture(0)
        renderer.upload_hfield(0)
        renderer.upload_mesh(0)
        images_of(renderer, data)
        for upload in (renderer.upload_texture, renderer.upload_mesh, renderer.upload_hfield):
            with pytest.raises(RippleError, match=r"must be an id below [12], from 0, got 2"):
                upload(2)


def test_wide_changes_of_a_large_texture_show_at_once_and_small_ones_soon():
    array = np.zeros(5_000_000, np.uint8)
    watched = WatchedArray(array)
    assert not watched.changed(array)
    array[3_000_000:3_010_000] = 1
    assert watched.changed(array)
    assert watched.differs(array, 2_999_000, 2_000) and not watched.differs(array, 0, 3_000_000)
    watched.take(array)
    assert not watched.changed(array)
    array[4_321_987] = 7
    assert sum(watched.changed(array) for _ in range(20)) >= 1
