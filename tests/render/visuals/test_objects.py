"""Round geoms: tessellation as fine as a frame needs, MuJoCo's places, and the table."""

import numpy as np
import pytest
from mujoco_models import posed
from shader_functions import evaluated

from ripple_sim.render.contract import Shading
from ripple_sim.render.pose import Pose
from ripple_sim.render.visuals import (
    LOOKS,
    Assets,
    Look,
    ObjectTable,
    Occluders,
    find_look,
    instances_of,
    visuals_of,
)
from ripple_sim.solver import RippleError

XML = """<mujoco><worldbody>
<geom type="sphere" size=".3" pos="1 2 3" euler="10 20 30"/>
<geom type="ellipsoid" size=".3 .2 .1" pos="0 1 0"/>
<geom type="box" size=".3 .2 .1"/><geom type="sphere" size=".1" pos="0 0 2" rgba="1 1 1 .5"/>
<site type="sphere" size=".1" pos="0 -1 0"/></worldbody></mujoco>"""


@pytest.fixture
def visuals(resources):
    model, data = posed(XML)
    drawn = instances_of(Assets(model, resources), visuals_of(model, range(model.ngeom)))
    occluders = Occluders(resources, model, np.arange(model.ngeom))

    def update(eye, pixels, sharp=False):
        for each in drawn:
            each.update(
                data, Pose(np.asarray(eye), np.eye(3), 1.0, fovy=90.0), 2 * pixels, occluders, sharp
            )

    return drawn, data, update


def of_kind(drawn, count, site=False):
    """The opaque draw call of so many geoms, or that of the site."""
    return next(
        each
        for each in drawn
        if len(each.numbers) == count and not each.transparent and each.occludes != site
    )


def test_geoms_of_one_shape_are_drawn_together_and_transparent_ones_alone(visuals):
    drawn, _, _ = visuals
    # the box, the site, both round geoms
    assert sorted(len(each.numbers) for each in drawn if not each.transparent) == [1, 1, 2]
    assert [each.numbers for each in drawn if each.transparent] == [[3]]
    numbers = [n for each in drawn for n in each.numbers]
    assert sorted(numbers) == list(range(5))


def test_poses_are_those_of_the_data(visuals):
    drawn, data, update = visuals
    update([0.0, -5.0, 0.0], 500.0)
    both = of_kind(drawn, 2)
    np.testing.assert_allclose(both._records["origin"], data.geom_xpos[:2], atol=1e-6)
    # column by column
    rotations = data.geom_xmat[:2].reshape(-1, 3, 3).transpose(0, 2, 1)
    np.testing.assert_allclose(both._records["rotation"], rotations, atol=1e-6)
    site = of_kind(drawn, 1, site=True)
    np.testing.assert_allclose(site._records["origin"], data.site_xpos, atol=1e-6)


def test_round_edges_are_exact_to_a_quarter_of_a_pixel_at_any_distance_and_size(
    visuals,
):
    drawn, data, update = visuals
    both = of_kind(drawn, 2)
    eye = np.array([1.0, -4.0, 3.0])
    segments = []
    for pixels in (1.0, 30.0, 100.0, 300.0, 1000.0):
        update(eye, pixels)
        segments.append(both._segments)
        away = np.linalg.norm(data.geom_xpos[0] - eye) - 0.3
        sagitta = 0.3 * (1 - np.cos(np.pi / 4 / both._segments)) / away * pixels
        assert sagitta <= 0.26
    assert segments == sorted(segments)
    assert segments[-1] > segments[0]
    update(data.geom_xpos[0], 1e6)  # from within a ball: the finest there is
    assert both._segments >= segments[-1]


def test_each_round_shape_gets_its_own_number_of_segments_if_shapes_are_sharp(resources):
    balls = "".join(f'<geom size=".1" pos="{x} 0 0"/>' for x in (0.0, 1.0, 8.0, 60.0))
    model, data = posed(f"<mujoco><worldbody>{balls}</worldbody></mujoco>")
    (drawn,) = instances_of(Assets(model, resources), visuals_of(model, range(model.ngeom)))
    eye = np.array([-0.4, 0.0, 0.0])
    pixels = 300.0
    pose = Pose(eye, np.eye(3), 1.0, fovy=90.0)
    drawn.update(
        data, pose, 2 * int(pixels), Occluders(resources, model, np.arange(model.ngeom)), sharp=True
    )
    segments = {}
    for level, buffer, count in drawn._draws:
        records = np.frombuffer(buffer.read(), dtype=drawn._records.dtype)[:count]
        segments |= {float(x): level for x in records["origin"][:, 0]}
    assert sorted(segments) == [0.0, 1.0, 8.0, 60.0]
    for x, level in segments.items():
        sagitta = 0.1 * (1 - np.cos(np.pi / 4 / level)) * pixels / (x + 0.4 - 0.1)
        assert sagitta <= 1 / 64 or level == max(segments.values())
    assert segments[0.0] > segments[1.0] > segments[8.0] >= segments[60.0]
    assert segments[60.0] == 4


def test_the_shadow_bias_covers_the_gap_between_chord_and_arc_and_flat_geoms_have_none(visuals):
    drawn, _, update = visuals
    update([0.0, -5.0, 0.0], 500.0)
    both = of_kind(drawn, 2)
    sagitta = np.array([0.3, 0.3]) * (1 - np.cos(np.pi / 4 / both._segments))
    assert (both.shadow_biases > sagitta).all()
    assert (both.shadow_biases < 0.05).all()
    box = of_kind(drawn, 1)
    assert not box.shadow_biases.any()


LOOK = Look((0.1, 0.2, 0.3), 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.5)


@pytest.fixture
def table(resources):
    return ObjectTable(resources)


def read(gl, table, expression, count=1) -> np.ndarray:
    """An expression of an object `object_at(int(x.x))`, for all rows."""
    with gl:
        table.bind()
    return evaluated(gl, "glsl/objects.glsl", expression, np.arange(count)[:, None])


def test_shaders_find_a_look_in_its_row(gl, table):
    assert not read(gl, table, "object_at(0).base").any()  # of a table that is empty
    table.add(Look((0, 0, 0), 1.0), 3)
    number = table.add(LOOK, 17, opacity=0.25, size=2.5, shading=Shading.HEATMAP, height_map=4)
    row = f"object_at({number})"
    np.testing.assert_allclose(read(gl, table, f"{row}.base")[0], [0.4, 0.5, 0.6, 0.7], rtol=1e-6)
    np.testing.assert_allclose(
        read(gl, table, f"{row}.volume")[0], [0.8, 0.9, 1.5, 0.25], rtol=1e-6
    )
    np.testing.assert_allclose(read(gl, table, f"{row}.place")[0], [17, 2.5, 0, 1])
    np.testing.assert_allclose(read(gl, table, f"{row}.height_map")[0, :2], [4, 1])
    np.testing.assert_allclose(read(gl, table, "object_at(0).height_map")[0, :2], [0, 0])


def test_the_rotation_turns_gradients_into_the_world(gl, table):
    rotation, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    table.add(LOOK, 0)
    number = table.add(LOOK, 1)
    table.place(number, 0.125, rotation=rotation)
    for axis, unit in enumerate(("1, 0, 0", "0, 1, 0", "0, 0, 1")):
        turned = read(gl, table, f"vec4(object_at({number}).rotation * vec3({unit}), 0.0)")[0, :3]
        np.testing.assert_allclose(turned, rotation[:, axis], atol=1e-6)
    np.testing.assert_allclose(
        read(gl, table, "vec4(object_at(int(x.x)).place.z)", 2)[:, 0], [0, 0.125]
    )


@pytest.mark.parametrize("name", ["chrome", "", "Rubber"])
def test_an_unknown_look_is_named_with_all_valid_ones(name):
    with pytest.raises(RippleError, match=f"look must be one of .*, got '{name}'") as error:
        find_look(name)
    assert all(repr(each) in str(error.value) for each in LOOKS)


@pytest.mark.parametrize("name", LOOKS)
def test_looks_are_within_the_limits_that_the_shaders_count_on(name):
    look = find_look(name)
    shares = [
        *look.color,
        look.roughness,
        look.metallic,
        look.coat,
        look.translucency,
        look.transparency,
    ]
    assert all(0 <= share <= 1 for share in shares)
    assert look.sheen >= 0
    assert look.emission == 0  # nothing shines unless a model says so
    # light does not pass through metal
    assert not (look.metallic and (look.translucency or look.transparency))
