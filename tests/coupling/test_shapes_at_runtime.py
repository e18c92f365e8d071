"""Targets whose surfaces a program changes in the model ripple on the new surfaces."""

import pickle

import numpy as np
import pytest
from mujoco_models import posed

from ripple_sim import Material, RippleError, RippleRenderer, Ripples, RippleWarning

MODEL = """<mujoco><asset><hfield name="h" nrow="12" ncol="12" size="1 1 .5 .1"/>
<mesh name="tet" vertex="0 0 0 .4 0 0 0 .4 0 0 0 .4"/></asset><worldbody>
<camera name="c" pos="0 -3 2" xyaxes="1 0 0 0 .6 1"/><geom name="terrain" type="hfield" hfield="h"/>
<body pos="0 0 .8"><freejoint/><geom size=".08" mass=".5"/></body>
<body pos="3 0 0"><geom name="ball" size=".2"/></body>
<body pos="6 0 0"><geom name="rock" type="mesh" mesh="tet"/></body></worldbody></mujoco>"""
WAVES = Material(speed=1.0, damping=1.0, density=1000.0)


def made(*names, **options):
    model, data = posed(MODEL)
    return (
        model,
        data,
        Ripples(model, dict.fromkeys(names, WAVES), resolution=8, backend="cpu", **options),
    )


@pytest.mark.filterwarnings("ignore:no wave")
def test_impulses_lie_on_a_terrain_that_is_written_anew():
    model, data, ripples = made("terrain")
    ripples.mj_step(data, 3)
    model.hfield_data[:] = np.linspace(0.6, 1.0, 144)
    data.qpos[2] = 0.5
    with pytest.warns(
        RippleWarning, match="surface of 'terrain' was changed in the model: it gets a new atlas"
    ):
        ripples.mj_step(data)
    points = []
    for _ in range(100):
        ripples.mj_step(data)
        points += [hit.point[2] for hit in ripples.last_impulses]
    assert len(points) > 10
    np.testing.assert_allclose(points, data.qpos[2] - 0.08, atol=0.04)
    assert ripples["terrain"].height.any()


@pytest.mark.parametrize(
    ("name", "array", "part"),
    [("ball", "geom_size", 2), ("rock", "mesh_vert", ...)],
    ids=["ball", "rock"],
)
@pytest.mark.filterwarnings("ignore:the surface of")
def test_a_resized_target_gets_a_new_atlas_and_flat_waves_and_others_keep_theirs(name, array, part):
    model, data, ripples = made("ball", "rock")
    other = {"ball": "rock", "rock": "ball"}[name]
    for each in ripples:
        ripples[each].height = np.full_like(ripples[each].height, 0.01)
    before = np.ptp(ripples[name].atlas.mesh.V, axis=0)
    waves = ripples[other]
    getattr(model, array)[part] *= 2
    ripples.follow_shapes()
    np.testing.assert_allclose(np.ptp(ripples[name].atlas.mesh.V, axis=0), 2 * before, rtol=1e-5)
    assert not ripples[name].height.any()
    assert ripples[other] is waves and waves.height.any()
    atlas = ripples[name].atlas
    ripples.mj_step(data, 5)
    assert ripples[name].atlas is atlas


@pytest.mark.filterwarnings("ignore:the surface of")
def test_two_way_coupling_and_pickled_copies_continue_after_a_change():
    model, data, ripples = made("ball", two_way=True)
    model.geom("ball").size[0] = 0.3
    ripples.mj_step(data, 2)
    assert ripples["ball"].atlas.mesh.V.max() == pytest.approx(0.3, rel=0.02)
    copied = pickle.loads(pickle.dumps(ripples))
    atlas = copied["ball"].atlas
    copied.follow_shapes()
    assert copied["ball"].atlas is atlas
    copied.model.geom("ball").size[0] = 0.4
    copied.follow_shapes()
    assert copied["ball"].atlas.mesh.V.max() == pytest.approx(0.4, rel=0.02)


@pytest.mark.parametrize("what", ["held still", "texel by texel", "sensors"])
def test_a_changed_surface_is_refused_if_sensors_or_maps_refer_to_its_texels(what):
    model, data, ripples = made("ball")
    if what == "sensors":
        ripples["ball"].sensor([0.0, 0.0, 0.2], kind="acceleration", rate=1000)
    elif what == "held still":
        ripples.make_rigid("ball", [3.0, 0.0, 0.2], 0.05)
    else:
        ripples.change_material("ball", speed=np.full(ripples["ball"].height.shape, 2.0))
    model.geom("ball").size[0] = 0.3
    with pytest.raises(
        RippleError,
        match=f"surface of 'ball' was changed in the model, and .*{what}.*make new Ripples",
    ):
        ripples.mj_step(data)


@pytest.mark.filterwarnings("ignore:the surface of", "ignore:no wave")
def test_a_changed_surface_is_drawn_where_it_is_now_with_its_waves():
    model, data, ripples = made("terrain", "ball")
    with RippleRenderer(model, ripples, 48, 64) as renderer:
        renderer.enable_depth_rendering()
        flat = renderer.render(data, "c")
        model.hfield_data[:] = 0.8
        high = renderer.render(data, "c")
        ripples["terrain"].height = np.full_like(ripples["terrain"].height, 0.05)
        risen = renderer.render(data, "c")
        with RippleRenderer(model, ripples, 48, 64) as other:
            other.enable_depth_rendering()
            np.testing.assert_array_equal(other.render(data, "c"), risen)
    seen = (flat < 10) & (high < 10) & (risen < 10)
    assert seen.sum() > 100
    assert np.median((flat - high)[seen]) > 0.2
    assert 0.02 < np.median((high - risen)[seen]) < 0.15


@pytest.mark.filterwarnings("ignore:no wave", "ignore:the surface of")
def test_a_rippling_height_field_is_drawn_with_its_walls():
    model, data, ripples = made("terrain")
    model.hfield_data[:] = 0.8
    depths = []
    for each in (Ripples(model, {}), ripples):
        with RippleRenderer(model, each, 48, 64) as renderer:
            renderer.enable_depth_rendering()
            depths.append(renderer.render(data, "c"))
    assert (abs(depths[0] - depths[1]) > 0.02).mean() < 0.003
