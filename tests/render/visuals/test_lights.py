"""Lights of the MJCF, in linear light, and the studio's, which turn with the camera."""

import numpy as np
import pytest
from drawn import ABOVE, SUN, frame_of, posed
from scipy.spatial.transform import Rotation
from shader_functions import evaluated

from ripple_sim.render import Camera
from ripple_sim.render.visuals import (
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
    model, data = posed(xml)
    lighting = model_lighting(model, data, ABOVE.pose())
    total = lighting.ambient + lighting.on(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    # MuJoCo's sums, from sRGB to linear light
    np.testing.assert_allclose(lighting.ambient, ((0.2 + 0.055) / 1.055) ** 2.4, rtol=1e-6)
    np.testing.assert_allclose(total, ((0.9 + 0.055) / 1.055) ** 2.4, rtol=1e-3)
    assert lighting.lights[0].shadow


def test_the_beam_of_a_spot_falls_off_in_srgb_as_in_mujoco():
    """At 60 degrees from the axis MuJoCo's squared cosine leaves a quarter of the light in sRGB."""
    lamp = '<light pos="0 0 1" dir="0 0 -1" diffuse=".5 .5 .5" cutoff="80" exponent="2"/>'
    model, data = posed(
        f'<mujoco><visual><headlight active="0"/></visual><worldbody>{lamp}</worldbody></mujoco>'
    )
    lighting = model_lighting(model, data, ABOVE.pose())
    beside = np.array([np.sqrt(3.0), 0.0, 0.0])
    towards = np.array([-np.sqrt(3.0), 0.0, 1.0]) / 2
    under = lighting.on(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    aside = lighting.on(beside, towards)
    np.testing.assert_allclose((aside / under) ** (1 / 2.2), 0.25, rtol=1e-6)


def test_a_light_without_mujocos_specular_makes_no_glare(gl):
    """The middle of a dark wall, where the headlight is mirrored, over its edge."""
    wall = '<geom type="box" size="3 3 .1" material="dark"/>'
    dark = '<material name="dark" rgba=".15 .15 .2 1"/>'
    head = '<headlight diffuse=".8 .8 .8" specular="{0} {0} {0}"/>'
    glare = []
    for specular in (0.0, 0.1, 0.3, 0.5):
        frame = frame_of(gl, wall, asset=dark, visual=head.format(specular), lighting="model").sum(
            axis=-1
        )
        glare.append(frame[58:62, 78:82].mean() / frame[:8, :8].mean())
    assert glare[0] < 1.1
    assert glare[1] < 1.6 < 2 < glare[2] == glare[3]


POSE = Camera((0.0, 0.0, 0.0), 2.0, 70.0, -30.0).pose()


@pytest.mark.parametrize("turn", [30.0, 90.0, 181.0])
@pytest.mark.parametrize("elevation", [-80.0, -20.0, 0.0, 40.0])
def test_the_key_light_turns_with_the_camera_and_keeps_its_height(turn, elevation):
    poses = [
        Camera((0.0, 0.0, 0.0), 2.0, azimuth, elevation).pose() for azimuth in (10.0, 10.0 + turn)
    ]
    first, second = (studio_lighting(pose).lights[0].direction for pose in poses)
    about_z = Rotation.from_euler("z", turn, degrees=True)
    np.testing.assert_allclose(second, about_z.apply(first), atol=1e-12)
    assert np.linalg.norm(first) == pytest.approx(1.0)
    # whichever way the camera looks up or down
    assert first[2] == pytest.approx(np.sin(np.radians(44.0)))
    assert first @ poses[0].rotation[:, 0] < -0.5  # from the left


def test_lamps_at_a_place_do_not_light_the_floor_far_away(frame):
    lamp = Light(np.array([0.0, 0.0, 1.0]), np.full(3, 9.0), np.array([0.0, 0.0, 1.0]))
    set_lighting(frame, Lighting([lamp], np.full(3, 0.1), studio=False), POSE, np.ones(3), None)
    np.testing.assert_allclose(frame.values["horizon"][:3], 0.1, rtol=1e-6)


def test_shaders_see_a_soft_box_in_its_middle_and_not_beyond_its_edges(gl, frame):
    set_lighting(frame, studio_lighting(POSE), POSE, None, None)
    with gl:
        frame.bind()
    for index in range(len(SOFT_BOX_LIGHTS)):
        normal = frame.values["soft_box_normal"][index]
        tangent = frame.values["soft_box_tangent"][index]
        upright = np.cross(normal[:3], tangent[:3])
        offsets = np.array(
            [[0, 0], [0.8, 0], [-0.8, 0.8], [0, -0.8], [1.2, 0], [0, 1.2], [-1.2, -1.2]]
        )
        ways = (
            normal[:3]
            + offsets[:, :1] * normal[3] * tangent[:3]
            + offsets[:, 1:] * tangent[3] * upright
        )
        ways = np.concatenate([ways, -normal[None, :3]])
        call = f"soft_box(x.xyz, soft_box_normal[{index}], soft_box_tangent[{index}], 1e-3)"
        seen = evaluated(gl, "glsl/lights.glsl", f"vec4({call})", ways, SKYBOX=0, NEAR_LIGHTS=0)[
            :, 0
        ]
        np.testing.assert_allclose(seen, [1, 1, 1, 1, 0, 0, 0, 0], atol=0.01)
