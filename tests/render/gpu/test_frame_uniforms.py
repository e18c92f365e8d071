"""The block of uniforms: rays and matrices that agree, and the bytes that shaders read."""

import numpy as np
import pytest
from shader_functions import evaluated

from ripple_sim.render.camera import Camera, Pose

POSE = Camera((0.3, -1.2, 0.7), 5.0, 130.0, -35.0, 50.0).pose()
THROUGH_LENS = Pose(POSE.position, POSE.rotation, POSE.distance, POSE.fovy, (0.1, -0.2), 3.0)
ASPECT = 1.6


@pytest.mark.parametrize("pose", [POSE, THROUGH_LENS], ids=["pinhole", "lens"])
def test_rays_lead_where_the_matrix_projects(frame, pose):
    """A point along the ray of a place in the frame is drawn at that place."""
    frame.set_camera(pose, ASPECT)
    values = {name: frame.values[name].astype(np.float64) for name in ("eye", "ray", "ray_right", "ray_up")}
    matrix = frame.values["view_projection"].astype(np.float64).T
    for x, y in np.random.default_rng(0).uniform(-1, 1, (20, 2)):
        way = values["ray"][:3] + x * values["ray_right"][:3] + y * values["ray_up"][:3]
        for distance in (0.2, 3.0, 40.0):
            clip = matrix @ [*(values["eye"][:3] + distance * way), 1.0]
            np.testing.assert_allclose(clip[:2] / clip[3], [x, y], atol=2e-5)
            assert clip[3] == pytest.approx(distance, rel=1e-5)  # a metre along the axis for each of the ray


def test_clip_planes_lie_before_and_behind_the_focus(frame):
    frame.set_camera(POSE, ASPECT)
    near, far = frame.values["ray"][3], frame.values["ray_right"][3]
    assert 0 < near < POSE.distance < far
    matrix = frame.values["view_projection"].T.astype(np.float64)
    for plane, depth in ((near, -1), (far, 1)):
        clip = matrix @ [*(POSE.eye - float(plane) * POSE.rotation[:, 2]), 1.0]
        assert clip[2] / clip[3] == pytest.approx(depth, abs=1e-3)


@pytest.mark.parametrize("pose", [POSE, THROUGH_LENS], ids=["pinhole", "lens"])
def test_shaders_read_what_was_set(gl, frame, pose):
    """Matrices are stored column by column; a vector's fourth number may be left out."""
    frame.set_camera(pose, ASPECT)
    frame.set_vector("zenith", [0.1, 0.2, 0.3])
    frame.set_vector("counts", [3.0, 4.0, 5.0], 6.0)
    with gl:
        frame.bind()
    points = np.column_stack([np.random.default_rng(2).normal(size=(50, 3)), np.ones(50)])
    file = "gpu/frame_uniforms.glsl"
    expected = points @ frame.values["view_projection"].astype(np.float64)
    np.testing.assert_allclose(evaluated(gl, file, "view_projection * x", points), expected, atol=1e-3)
    one = np.zeros((1, 1))
    np.testing.assert_allclose(evaluated(gl, file, "zenith", one), [[0.1, 0.2, 0.3, 0.0]], rtol=1e-6)
    np.testing.assert_allclose(evaluated(gl, file, "counts", one), [[3, 4, 5, 6]])
    np.testing.assert_allclose(evaluated(gl, file, "vec4(focus.xyz, eye.w)", one)[0, 3], pose.distance, rtol=1e-6)


def test_without_a_floor_its_map_has_a_width_to_divide_by(frame):
    assert frame.values["floor_map"][2] == 1.0
    assert not frame.values["floor_origin"].any()
