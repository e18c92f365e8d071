"""Capsules in place of geoms: their sizes, which of them count, and how much of the sky they hide.

What is not drawn is said.
"""

import warnings

import mujoco
import numpy as np
import pytest
from shader_functions import evaluated

from ripple_sim.errors import RippleWarning
from ripple_sim.render import Renderer
from ripple_sim.render.contract import MAX_OCCLUDERS
from ripple_sim.render.visuals.geoms import warn_of_unsupported
from ripple_sim.render.visuals.objects import Occluders, _capsules


def posed(geoms: str):
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize(
    ("geom", "axis", "radius"),
    [
        ('type="sphere" size=".3"', [0, 0, 0], 0.3),
        ('type="capsule" size=".1 .4"', [0, 0, 0.4], 0.1),
        ('type="box" size=".9 .1 .4"', [0.7, 0, 0], 0.2),
        ('type="ellipsoid" size=".1 .5 .1"', [0, 0.4, 0], 0.1),
        ('type="cylinder" size=".5 .02"', [0.4, 0, 0], 0.1),
    ],
)
def test_a_capsule_is_as_long_and_about_as_thick_as_its_geom(geom, axis, radius):
    model, _ = posed(f"<geom {geom}/>")
    centre, half_axis, got = _capsules(model, np.array([0]))
    np.testing.assert_allclose(centre[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(half_axis[0]), axis, atol=1e-6)
    assert got[0] == pytest.approx(radius)


def test_balls_contain_the_geoms_wherever_they_are_turned(resources):
    model, data = posed(
        '<geom type="box" size=".9 .1 .4" pos="1 2 3" euler="20 40 70"/><geom type="sphere" size=".3" pos="-1 0 0"/>'
    )
    balls = Occluders(resources, model, np.array([0, 1])).balls(data)
    np.testing.assert_allclose(balls[:, :3], data.geom_xpos, atol=1e-12)
    corners = np.array([[x, y, z] for x in (-0.9, 0.9) for y in (-0.1, 0.1) for z in (-0.4, 0.4)])
    assert balls[0, 3] == pytest.approx(np.linalg.norm(corners, axis=1).max())
    assert balls[1, 3] >= 0.3


def row_of_balls(count: int) -> str:
    return "".join(f'<geom type="sphere" size=".2" pos="{i} 0 0"/>' for i in range(count))


def bound(resources, model, data, focus) -> np.ndarray:
    """What the shaders read: ends, the first with the radius [k, 2, 4]."""
    occluders = Occluders(resources, model, np.arange(model.ngeom))
    with resources.gl:
        occluders.bind(data, np.array(focus, dtype=float))
        return np.frombuffer(occluders._buffer.read(), np.float32).reshape(-1, 2, 4)[: min(model.ngeom, MAX_OCCLUDERS)]


@pytest.mark.parametrize("count", [0, 1, MAX_OCCLUDERS, MAX_OCCLUDERS + 1, 2 * MAX_OCCLUDERS])
def test_the_nearest_to_the_focus_are_bound_and_no_more_than_fit(resources, count):
    model, data = posed(row_of_balls(count))
    capsules = bound(resources, model, data, [3.2, 0, 0])
    order = np.argsort(np.abs(np.arange(count) - 3.2), kind="stable")[:MAX_OCCLUDERS]
    np.testing.assert_allclose(capsules[:, 0, 0], order, atol=1e-6)


def test_capsules_fade_out_before_they_leave_the_list(resources):
    """As the focus moves, no radius jumps, though the list changes."""
    model, data = posed(row_of_balls(MAX_OCCLUDERS + 6))
    before = None
    for x in np.linspace(4.0, 12.0, 161):
        radii = np.zeros(model.ngeom)
        capsules = bound(resources, model, data, [x, 0, 0])
        radii[np.rint(capsules[:, 0, 0]).astype(int)] = capsules[:, 0, 3]
        assert radii.max() <= 0.2 + 1e-6
        assert radii[round(x)] == pytest.approx(0.2)
        if before is not None:
            assert np.abs(radii - before).max() < 0.02
        before = radii
    model, data = posed(row_of_balls(MAX_OCCLUDERS))  # all of them fit: none fades
    np.testing.assert_allclose(bound(resources, model, data, [0, 0, 0])[:, 0, 3], 0.2, atol=1e-6)


def test_an_object_has_the_bits_of_all_that_darken_it_by_a_hundredth_but_not_its_own(gl, resources):
    """Whatever is left out hides less than a hundredth of the sky from any point of the object."""
    rng = np.random.default_rng(7)
    places, sizes = rng.uniform(-2, 2, (MAX_OCCLUDERS, 3)), rng.uniform(0.02, 0.2, MAX_OCCLUDERS)
    model, data = posed(
        "".join(
            f'<geom type="capsule" size="{r} {2 * r}" pos="{x} {y} {z}"/>'
            for r, (x, y, z) in zip(sizes, places, strict=True)
        )
    )
    occluders = Occluders(resources, model, np.arange(model.ngeom))
    with gl:
        occluders.bind(data, np.zeros(3))
    bits = np.arange(MAX_OCCLUDERS)
    geom_of_bit = occluders._bound_geoms
    near = occluders.near(np.column_stack([places, np.full(len(places), 0.1)]), np.arange(len(places)))
    assert near.any() and (near < 2**MAX_OCCLUDERS - 1).all()
    for geom, mask in enumerate(near[:2]):
        own = int(bits[geom_of_bit == geom][0])
        assert not mask >> own & 1
        points = places[geom] + rng.uniform(-0.05, 0.05, (200, 3))
        for other in bits[(mask >> bits & 1 == 0) & (bits != own)]:
            assert visibility(gl, points, "0, 0, 1", near=1 << int(other)).min() > 0.99


def visibility(gl, points, normal, near=1):
    expression = f"vec4(occluder_visibility(x.xyz, vec3({normal}), {near}))"
    return evaluated(gl, "glsl/occluders.glsl", expression, np.atleast_2d(points))[:, 0]


def test_a_geom_hides_more_of_the_sky_the_nearer_it_is_and_none_from_itself_or_from_behind(gl, resources):
    model, data = posed('<geom type="sphere" size=".3"/>')
    bound(resources, model, data, [0, 0, 0])
    away = np.linspace(0.3, 30.0, 60)
    below = np.column_stack([0 * away, 0 * away, -away])
    facing = visibility(gl, below, "0, 0, 1")
    assert (np.diff(facing) > 0).all()
    assert facing[0] == pytest.approx(0.1, abs=1e-3)  # touched by it
    # far away a ball facing a patch hides (r / d)^2 of it; the geom counts for nine tenths
    np.testing.assert_allclose(1 - facing[10:], 0.9 * (0.3 / away[10:]) ** 2, rtol=1e-2)
    np.testing.assert_array_equal(visibility(gl, below, "0, 0, 1", near=0), 1.0)
    np.testing.assert_allclose(visibility(gl, below[1:], "0, 0, -1"), 1.0)


def test_a_long_geom_is_as_near_as_its_nearest_point(gl, resources):
    model, data = posed('<geom type="capsule" size=".1 2" euler="0 90 0"/>')
    bound(resources, model, data, [0, 0, 0])
    beside = visibility(gl, [[0, 0, -0.5], [1.5, 0, -0.5], [-1.9, 0, -0.5]], "0, 0, 1")
    np.testing.assert_allclose(beside, beside[0], atol=1e-5)
    assert visibility(gl, [[3.5, 0, -0.5]], "0, 0, 1")[0] > beside[0]


def test_what_is_not_drawn_is_said_once(gl):
    body = (
        """<body name="a" pos="0 0 1"><joint type="slide"/><geom size=".1"/><site name="s"/></body><site name="w"/>"""
    )
    tendon = '<tendon><spatial><site site="s"/><site site="w"/></spatial></tendon>'
    xml = f"<mujoco><worldbody>{body}</worldbody>{tendon}</mujoco>"
    with pytest.warns(RippleWarning, match="1 tendons"):
        Renderer(gl, mujoco.MjModel.from_xml_string(xml), {}, size=(32, 24)).close()


def test_a_fixed_tendon_has_nothing_to_draw():
    body = """<body><joint name="x" type="slide"/><geom size=".1"/></body>"""
    tendon = '<tendon><fixed><joint joint="x" coef="1"/></fixed></tendon>'
    with warnings.catch_warnings():
        warnings.simplefilter("error", RippleWarning)
        warn_of_unsupported(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody>{tendon}</mujoco>"))
