"""Round geoms are as finely tessellated as the frame needs, and their poses are MuJoCo's."""

import mujoco
import numpy as np
import pytest

from ripple_sim.render.visuals.geoms import GeomVisuals
from ripple_sim.render.visuals.instances import Assets

XML = """<mujoco><worldbody>
<geom type="sphere" size=".3" pos="1 2 3" euler="10 20 30"/><geom type="ellipsoid" size=".3 .2 .1" pos="0 1 0"/>
<geom type="box" size=".3 .2 .1"/><geom type="sphere" size=".1" pos="0 0 2" rgba="1 1 1 .5"/>
<site type="sphere" size=".1" pos="0 -1 0"/></worldbody></mujoco>"""


@pytest.fixture
def visuals(resources):
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return GeomVisuals(Assets.of(model, resources), range(model.ngeom)), data


def test_geoms_of_one_shape_are_drawn_together_and_transparent_ones_alone(visuals):
    drawn, _ = visuals
    assert sorted(len(each.numbers) for each in drawn._opaque) == [1, 1, 2]  # the box, the site, both round geoms
    assert [each.visual.index for each in drawn.transparent] == [3]
    numbers = [n for each in drawn._opaque for n in each.numbers] + [drawn.transparent[0].number]
    assert sorted(numbers) == list(range(5))


def test_poses_are_those_of_the_data(visuals):
    drawn, data = visuals
    drawn.update(data, np.array([0.0, -5.0, 0.0]), 500.0)
    both = next(each for each in drawn._opaque if len(each.numbers) == 2)
    np.testing.assert_allclose(both._records["origin"], data.geom_xpos[:2], atol=1e-6)
    # column by column
    np.testing.assert_allclose(
        both._records["rotation"], data.geom_xmat[:2].reshape(-1, 3, 3).transpose(0, 2, 1), atol=1e-6
    )
    site = next(each for each in drawn._opaque if each.sites)
    np.testing.assert_allclose(site._records["origin"], data.site_xpos, atol=1e-6)


def test_nearer_and_larger_frames_need_more_segments_and_then_edges_are_within_a_quarter_of_a_pixel(visuals):
    drawn, data = visuals
    both = next(each for each in drawn._opaque if len(each.numbers) == 2)
    eye, segments = np.array([1.0, -4.0, 3.0]), []
    for pixels in (1.0, 30.0, 100.0, 300.0, 1000.0):
        drawn.update(data, eye, pixels)
        segments.append(both._segments)
        away = np.linalg.norm(data.geom_xpos[0] - eye) - 0.3
        sagitta = 0.3 * (1 - np.cos(np.pi / 4 / both._segments)) / away * pixels
        assert sagitta <= 0.26
    assert segments == sorted(segments)
    assert segments[-1] > segments[0]
    drawn.update(data, data.geom_xpos[0], 1e6)  # from within a ball: the finest there is
    assert both._segments >= segments[-1]


def test_the_shadow_bias_covers_the_gap_between_chord_and_arc_and_flat_geoms_have_none(visuals):
    drawn, data = visuals
    drawn.update(data, np.array([0.0, -5.0, 0.0]), 500.0)
    both = next(each for each in drawn._opaque if len(each.numbers) == 2)
    sagitta = np.array([0.3, 0.3]) * (1 - np.cos(np.pi / 4 / both._segments))
    assert (both.shadow_biases > sagitta).all()
    assert (both.shadow_biases < 0.05).all()
    box = next(each for each in drawn._opaque if len(each.numbers) == 1 and not each.sites)
    assert not box.shadow_biases.any()
