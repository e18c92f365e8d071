"""Geoms and sites as they are drawn, their materials, and the sky that capsules hide."""

import warnings

import mujoco
import numpy as np
import pytest
from drawn import ABOVE, BALL, FLOOR, FRONT, SIZE, frame_of, posed
from mujoco_models import forwarded, mesh_spec
from shader_functions import evaluated
from textured import textured_model

from ripple_sim.errors import RippleWarning
from ripple_sim.render import MAX_OCCLUDERS, Camera, Renderer
from ripple_sim.render.visuals import Occluders, geom_visual, look_of, visuals_in
from ripple_sim.scenes.shapes import peanut


def test_groups_above_two_are_hidden(gl):
    hidden = BALL.replace("/>", ' group="3"/>')
    np.testing.assert_array_equal(frame_of(gl, FLOOR + hidden), frame_of(gl, FLOOR))
    assert np.abs(frame_of(gl, FLOOR + BALL) - frame_of(gl, FLOOR)).max() > 60


def test_sites_of_visible_groups_are_drawn_like_geoms(gl):
    """Sites are drawn as by MuJoCo: round, in their colour or material's, clear, with a shadow."""
    site = '<site type="sphere" size=".3" pos="0 0 .8" {}/>'
    plain = frame_of(gl, FLOOR, camera=FRONT)
    as_body = frame_of(gl, FLOOR + BALL, camera=FRONT)
    as_site = frame_of(gl, FLOOR + site.format('rgba=".8 .2 .2 1"'), camera=FRONT)
    ball = (as_body[..., 0] - as_body[..., 2] > 60) & (as_site[..., 0] - as_site[..., 2] > 60)
    assert ball.sum() > 400
    # of the floor's light the body shades itself a little
    upper = ball & (np.arange(SIZE[1])[:, None] < 45)
    np.testing.assert_allclose(as_site[upper], as_body[upper], atol=16)
    np.testing.assert_array_equal(
        frame_of(gl, FLOOR + site.format('group="3"'), camera=FRONT), plain
    )
    clear = frame_of(gl, FLOOR + site.format('rgba=".8 .2 .2 .3"'), camera=FRONT)
    assert (
        (as_site[ball][:, 0] - as_site[ball][:, 2]).mean()
        > 2 * (clear[ball][:, 0] - clear[ball][:, 2]).mean()
        > 10
    )
    green = frame_of(
        gl, site.format('material="g"'), asset='<material name="g" rgba="0 .8 0 1"/>', camera=FRONT
    )
    assert (green[ball][:, 1] > green[ball][:, 0] + 60).mean() > 0.9


def test_the_look_of_a_material_follows_its_shininess_roughness_and_reflectance():
    """Roughness is taken where it is given; otherwise more shininess is less of it.

    Reflectance is a coat.
    """

    def look(attributes: str):
        return look_of(
            model := textured_model('<geom size=".1" material="m"/>', attributes),
            geom_visual(model, 0),
        )

    metal = look('roughness="0.3" metallic="1" shininess="0.9"')
    assert (metal.roughness, metal.metallic) == (pytest.approx(0.3), 1.0)
    assert (
        look('shininess="0"').roughness
        > look('shininess="0.5"').roughness
        > look('shininess="1"').roughness
    )
    assert look('reflectance="0.4"').coat == pytest.approx(0.4)
    assert look('emission="0.7"').emission == pytest.approx(0.7)
    assert look("").metallic == 0.0


def geoms_of(geoms: str):
    return posed(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")


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
def test_a_capsule_is_as_long_and_about_as_thick_as_its_geom(resources, geom, axis, radius):
    model, data = geoms_of(f"<geom {geom}/>")
    ((first, last),) = bound(resources, model, data, [0, 0, 0])
    np.testing.assert_allclose(first[:3] + last[:3], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(last - first)[:3] / 2, axis, atol=1e-6)
    assert first[3] == pytest.approx(radius)


def row_of_balls(count: int) -> str:
    return "".join(f'<geom type="sphere" size=".2" pos="{i} 0 0"/>' for i in range(count))


def bound(resources, model, data, focus) -> np.ndarray:
    """What the shaders read: ends, the first with the radius [k, 2, 4]."""
    occluders = Occluders(resources, model, np.arange(model.ngeom))
    with resources.gl:
        occluders.bind(data, np.array(focus, dtype=float))
        return np.frombuffer(occluders._buffer.read(), np.float32).reshape(-1, 2, 4)[
            : min(model.ngeom, MAX_OCCLUDERS)
        ]


def test_capsules_fade_out_before_they_leave_the_list(resources):
    """As the focus moves, no radius jumps, though the list changes."""
    model, data = geoms_of(row_of_balls(MAX_OCCLUDERS + 6))
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
    model, data = geoms_of(row_of_balls(MAX_OCCLUDERS))  # all of them fit: none fades
    np.testing.assert_allclose(bound(resources, model, data, [0, 0, 0])[:, 0, 3], 0.2, atol=1e-6)


def test_the_bits_of_an_object_name_all_occluders_of_a_hundredth_except_itself(gl, resources):
    """Whatever is left out hides less than a hundredth of the sky from any point of the object."""
    rng = np.random.default_rng(7)
    places = rng.uniform(-2, 2, (MAX_OCCLUDERS, 3))
    sizes = rng.uniform(0.02, 0.2, MAX_OCCLUDERS)
    geom = '<geom type="capsule" size="{0} {1}" pos="{2} {3} {4}"/>'
    model, data = geoms_of(
        "".join(geom.format(r, 2 * r, *place) for r, place in zip(sizes, places, strict=True))
    )
    occluders = Occluders(resources, model, np.arange(model.ngeom))
    with gl:
        occluders.bind(data, np.zeros(3))
    bits = np.arange(MAX_OCCLUDERS)
    geom_of_bit = occluders._bound_geoms
    near = occluders.near(
        np.column_stack([places, np.full(len(places), 0.1)]), np.arange(len(places))
    )
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


def test_a_geom_hides_more_of_the_sky_the_nearer_it_is_and_none_from_itself_or_from_behind(
    gl, resources
):
    model, data = geoms_of('<geom type="sphere" size=".3"/>')
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
    model, data = geoms_of('<geom type="capsule" size=".1 2" euler="0 90 0"/>')
    bound(resources, model, data, [0, 0, 0])
    beside = visibility(gl, [[0, 0, -0.5], [1.5, 0, -0.5], [-1.9, 0, -0.5]], "0, 0, 1")
    np.testing.assert_allclose(beside, beside[0], atol=1e-5)
    assert visibility(gl, [[3.5, 0, -0.5]], "0, 0, 1")[0] > beside[0]


GEOM = mujoco.mjtObj.mjOBJ_GEOM
FLEX = mujoco.mjtObj.mjOBJ_FLEX
TENDON = """<body name="a" pos="0 0 .5"><joint type="slide"/><geom size=".02"/>
<site name="s" euler="180 0 0"/></body>
<site name="w" pos=".6 0 .5"/>"""
SHEET = """<flexcomp name="f" type="grid" count="3 3 1" spacing=".2 .2 .1" dim="2" pos="0 0 .5"
  rgba="1 0 0 1">
<edge equality="true"/></flexcomp>"""


def test_tendons_flexes_skins_and_rays_are_drawn(gl):
    spatial = (
        '<tendon><spatial width=".05" rgba="1 0 0 1"><site site="s"/><site '
        'site="w"/></spatial></tendon>'
    )
    cable = SHEET.replace("3 3 1", "3 1 1").replace('dim="2"', 'dim="1" radius=".05"')
    ray = (
        '<sensor><rangefinder site="s"/></sensor><visual><global linewidth="3"/>'
        '<rgba rangefinder="1 0 0 1"/></visual>'
    )
    cases = (
        (TENDON, spatial, ABOVE),
        (SHEET, "", ABOVE),
        (cable, "", ABOVE),
        (TENDON, ray, FRONT),  # it points down: a line has no width along itself
    )
    for body, rest, camera in cases:
        model, data = posed(f"<mujoco><worldbody>{FLOOR}{body}</worldbody>{rest}</mujoco>")
        unwarned = warnings.catch_warnings(action="error", category=RippleWarning)
        with unwarned, Renderer(gl, model, {}, size=SIZE) as renderer:
            red, green, _ = np.moveaxis(renderer.render(data, {}, camera).astype(int), 2, 0)
        assert (red - green > 60).sum() > 50


def test_a_flex_without_texture_coordinates_has_none():
    model, data = posed(f"<mujoco><worldbody>{SHEET}</worldbody></mujoco>")
    scene = mujoco.MjvScene(model, 9)
    option = mujoco.MjvOption()
    camera = mujoco.MjvCamera()
    mujoco.mjv_updateScene(model, data, option, None, camera, mujoco.mjtCatBit.mjCAT_ALL, scene)
    scene.flextexcoord[:] = np.nan  # MuJoCo leaves there what was in memory
    (visual,) = visuals_in(model, scene, scene.geoms[0])
    np.testing.assert_array_equal(visual.corners[:, 6:], 0.0)


@pytest.mark.parametrize(
    ("flags", "parts"),
    [
        ({}, {"faces"}),  # its smooth skin
        ({"FLEXFACE": 1}, {"faces"}),
        ({"FLEXFACE": 1, "FLEXSKIN": 0}, {"faces", "edges"}),
        ({"FLEXSKIN": 0}, {"edges"}),
        ({"FLEXSKIN": 0, "FLEXVERT": 1, "FLEXEDGE": 0}, {"vertices"}),
        ({"FLEXSKIN": 0, "FLEXVERT": 1, "FLEXFACE": 1}, {"faces", "edges", "vertices"}),
    ],
)
def test_a_flex_has_the_parts_that_the_options_show(flags, parts):
    thick = SHEET.replace("dim=", 'radius=".02" dim=')
    model, data = posed(f"<mujoco><worldbody>{thick}</worldbody></mujoco>")
    scene = mujoco.MjvScene(model, 9)
    option = mujoco.MjvOption()
    camera = mujoco.MjvCamera()
    for flag, value in flags.items():
        option.flags[getattr(mujoco.mjtVisFlag, f"mjVIS_{flag}")] = value
    mujoco.mjv_updateScene(model, data, option, None, camera, mujoco.mjtCatBit.mjCAT_ALL, scene)
    visuals = {visual.part: visual for visual in visuals_in(model, scene, scene.geoms[0])}
    assert set(visuals) == parts
    for part in parts - {"faces"}:  # tubes and balls of the flex's radius, facing outwards
        points = visuals[part].corners[:, :3].astype(float)
        normals = visuals[part].corners[:, 3:6]
        V = data.flexvert_xpos.reshape(-1, 3)
        apart = np.linalg.norm(points[:, None] - 0.02 * normals[:, None] - V, axis=2)
        np.testing.assert_allclose(apart.min(axis=1), 0.0, atol=1e-6)
        triangles = points.reshape(-1, 3, 3)
        outwards = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        assert (np.einsum("ti,tci->t", outwards, normals.reshape(-1, 3, 3)) >= -1e-12).all()


def test_flexes_that_stand_for_geoms_are_not_drawn(gl):
    V, F = peanut(0.06)
    spec = mesh_spec((V, F))
    for drawn in (False, True):
        if drawn:
            spec.add_flex(
                name="other", dim=2, vertbody=["base"], vert=1.1 * V.ravel(), elem=F.ravel()
            )
        model = spec.compile()
        with Renderer(gl, model, {}, size=SIZE) as renderer:
            image = renderer.surfaces(
                forwarded(model), {}, Camera(tuple(model.stat.center), 0.3, 90.0, -20.0)
            )
        assert {-1, int(FLEX if drawn else GEOM)} == set(np.unique(image.identity[..., 1]))
