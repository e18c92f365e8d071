"""Lights of the MJCF, in linear light.

The studio: its lights turn with the camera, and the background takes on the floor's colour.
"""

import mujoco
import numpy as np
import pytest
from drawn import ABOVE, SUN
from shader_functions import evaluated

from ripple_sim.render.camera import Camera
from ripple_sim.render.visuals.lights import (
    SOFT_BOX_LIGHTS,
    Light,
    Lighting,
    model_lighting,
    set_lighting,
    studio_lighting,
)


def test_light_adds_up_to_mujocos_brightness_in_both_extremes():
    xml = f"""<mujoco><visual><headlight ambient=".2 .2 .2" diffuse=".3 .3 .3"/></visual>
    <worldbody>{SUN.format(0.0, "true").replace(".8 .8 .8", ".4 .4 .4")}</worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lighting = model_lighting(model, data, ABOVE.pose())
    total = lighting.ambient + lighting.on(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    # MuJoCo's sums, from sRGB to linear light
    np.testing.assert_allclose(lighting.ambient, ((0.2 + 0.055) / 1.055) ** 2.4, rtol=1e-6)
    np.testing.assert_allclose(total, ((0.9 + 0.055) / 1.055) ** 2.4, rtol=1e-3)
    assert lighting.lights[0].shadow


def test_the_beam_of_a_spot_falls_off_in_srgb_as_in_mujoco():
    """At 60 degrees from the axis, MuJoCo's cosine to the power of 2 leaves a quarter of the light, in sRGB."""
    lamp = '<light pos="0 0 1" dir="0 0 -1" diffuse=".5 .5 .5" cutoff="80" exponent="2"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><visual><headlight active="0"/></visual><worldbody>{lamp}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lighting = model_lighting(model, data, ABOVE.pose())
    beside = np.array([np.sqrt(3.0), 0.0, 0.0])
    towards = np.array([-np.sqrt(3.0), 0.0, 1.0]) / 2
    under, aside = lighting.on(np.zeros(3), np.array([0.0, 0.0, 1.0])), lighting.on(beside, towards)
    np.testing.assert_allclose((aside / under) ** (1 / 2.2), 0.25, rtol=1e-6)


POSES = [
    Camera((0.0, 0.0, 0.0), 2.0, azimuth, elevation).pose() for azimuth, elevation in ((0, 0), (70, -30), (200, 89))
]


def about_z(degrees: float) -> np.ndarray:
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])


@pytest.mark.parametrize("turn", [30.0, 90.0, 181.0])
@pytest.mark.parametrize("elevation", [-80.0, -20.0, 0.0, 40.0])
def test_the_key_light_turns_with_the_camera_and_keeps_its_height(turn, elevation):
    first, second = (
        studio_lighting(Camera((0.0, 0.0, 0.0), 2.0, azimuth, elevation).pose()).lights[0].direction
        for azimuth in (10.0, 10.0 + turn)
    )
    np.testing.assert_allclose(second, about_z(turn) @ first, atol=1e-12)
    assert np.linalg.norm(first) == pytest.approx(1.0)
    assert first[2] == pytest.approx(np.sin(np.radians(44.0)))  # whichever way the camera looks up or down
    pose = Camera((0.0, 0.0, 0.0), 2.0, 10.0, elevation).pose()
    assert first @ pose.rotation[:, 0] < -0.5  # from the left


@pytest.mark.parametrize("pose", POSES)
def test_soft_boxes_have_upright_frames_of_their_own(frame, pose):
    set_lighting(frame, studio_lighting(pose), pose, None, None)
    normal, tangent = (frame.values[f"soft_box_{name}"][:, :3] for name in ("normal", "tangent"))
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=1), 1.0, atol=1e-6)
    np.testing.assert_allclose(np.einsum("ki,ki->k", normal, tangent), 0.0, atol=1e-6)
    np.testing.assert_allclose(tangent[:, 2], 0.0, atol=1e-6)
    assert (normal[:, 2] > 0).all()


def test_soft_boxes_are_dimmer_beside_lights_of_the_model(frame):
    pose = POSES[1]
    set_lighting(frame, studio_lighting(pose), pose, None, None)
    alone = frame.values["soft_box_radiance"][:, :3].copy()
    np.testing.assert_allclose(alone, [box[4] for box in SOFT_BOX_LIGHTS], rtol=1e-6)
    sun = Light(np.array([0.0, 0.0, 1.0]), np.ones(3))
    set_lighting(frame, Lighting([sun], np.zeros(3), studio=False), pose, None, None)
    np.testing.assert_allclose(frame.values["soft_box_radiance"][:, :3], alone / 2, rtol=1e-6)


def test_a_light_far_away_and_one_at_a_place_are_told_apart(frame):
    sun = Light(np.array([0.0, 0.6, 0.8]), np.array([1.0, 2.0, 3.0]))
    lamp = Light(np.array([0.0, 0.0, 1.0]), np.ones(3), np.array([1.0, 2.0, 3.0]), cutoff=np.pi / 3, exponent=5.0,
                 falloff=np.array([1.0, 0.5, 0.25]))  # fmt: skip
    set_lighting(frame, Lighting([sun, lamp], np.zeros(3), studio=False), POSES[0], None, None)
    first, second = frame.values["lights"][:2]
    assert first["position"][3] == 0.0
    np.testing.assert_allclose(first["radiance"][:3], [1, 2, 3])
    np.testing.assert_allclose(second["position"], [1, 2, 3, 1])
    np.testing.assert_allclose(second["direction"], [0, 0, 1, 0.5], atol=1e-6)
    np.testing.assert_allclose([second["radiance"][3], *second["falloff"][:3]], [5, 1, 0.5, 0.25])


@pytest.mark.parametrize("studio", [True, False])
def test_the_background_has_the_hue_of_the_floor_and_grows_darker_towards_the_zenith(frame, studio):
    albedo = np.array([0.6, 0.3, 0.1])
    sun = Light(np.array([0.0, 0.0, 1.0]), np.full(3, 0.5))
    lighting = studio_lighting(POSES[0]) if studio else Lighting([sun], np.full(3, 0.05), studio=False)
    set_lighting(frame, lighting, POSES[0], albedo, None)
    horizon, zenith = frame.values["horizon"][:3], frame.values["zenith"][:3]
    # what the floor sends back, as far as the background takes it on
    np.testing.assert_allclose(horizon, (0.6 if studio else 0.55) * albedo, rtol=1e-5)
    assert (zenith < 0.5 * horizon).all()


def test_lamps_at_a_place_do_not_light_the_floor_far_away(frame):
    lamp = Light(np.array([0.0, 0.0, 1.0]), np.full(3, 9.0), np.array([0.0, 0.0, 1.0]))
    set_lighting(frame, Lighting([lamp], np.full(3, 0.1), studio=False), POSES[0], np.ones(3), None)
    np.testing.assert_allclose(frame.values["horizon"][:3], 0.1, rtol=1e-6)


def test_ambient_light_takes_half_of_the_hue_of_a_skybox_and_none_of_its_brightness(frame):
    skies = []
    for brightness in (0.1, 1.0, 0.0):
        sky = brightness * np.array([0.5, 1.0, 1.5])
        set_lighting(frame, Lighting([], np.full(3, 0.2), studio=False), POSES[0], None, sky)
        skies.append(frame.values["sky"].copy())
    np.testing.assert_allclose(skies[0], [0.15, 0.2, 0.25, 0.0], rtol=1e-5)
    np.testing.assert_allclose(skies[1], skies[0], rtol=1e-5)
    assert np.isfinite(skies[2]).all()  # black


def test_shaders_see_a_soft_box_in_its_middle_and_not_beyond_its_edges(gl, frame):
    set_lighting(frame, studio_lighting(POSES[1]), POSES[1], None, None)
    with gl:
        frame.bind()
    for index in range(len(SOFT_BOX_LIGHTS)):
        normal, tangent = frame.values["soft_box_normal"][index], frame.values["soft_box_tangent"][index]
        upright = np.cross(normal[:3], tangent[:3])
        offsets = np.array([[0, 0], [0.8, 0], [-0.8, 0.8], [0, -0.8], [1.2, 0], [0, 1.2], [-1.2, -1.2]])
        ways = normal[:3] + offsets[:, :1] * normal[3] * tangent[:3] + offsets[:, 1:] * tangent[3] * upright
        ways = np.concatenate([ways, -normal[None, :3]])
        call = f"soft_box(x.xyz, soft_box_normal[{index}], soft_box_tangent[{index}], 1e-3)"
        seen = evaluated(gl, "glsl/lights.glsl", f"vec4({call})", ways, SKYBOX=0, NEAR_LIGHTS=0)[:, 0]
        np.testing.assert_allclose(seen, [1, 1, 1, 1, 0, 0, 0, 0], atol=0.01)
