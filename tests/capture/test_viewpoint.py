"""Where the camera of a scene stands: free, fixed, orbiting, tracking a body."""

import mujoco
import numpy as np
import pytest

from ripple_sim.capture.frame_source import focal_distance, viewpoint
from ripple_sim.errors import SceneError
from ripple_sim.render import Camera
from ripple_sim.render.camera import ThroughLens, perspective, view_matrix
from ripple_sim.scene.scene_file import CameraEntry, check_camera

MJCF = """<mujoco><worldbody>
<geom name="lamp" size="0.1" pos="1 0.5 3"/>
<camera name="corner" pos="3 -2 1" xyaxes="0 1 0 0 0 1"/>
<body name="cart" pos="0.5 0.25 1"><freejoint/><geom size="0.1"/>
<body name="flag" pos="0 0 2"><geom size="0.1"/></body></body>
</worldbody></mujoco>"""


@pytest.fixture
def world() -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_the_free_camera_looks_at_the_middle_of_the_model(world):
    model, data = world
    pose = viewpoint(model, data, CameraEntry(distance=2.0), 0.0).pose()
    np.testing.assert_allclose(pose.focus, model.stat.center)
    assert np.linalg.norm(pose.position - pose.focus) == pytest.approx(2.0)


def test_an_orbiting_camera_goes_round_what_it_looks_at(world):
    for entry in (CameraEntry(distance=2.0, orbit=30.0), CameraEntry(name="corner", orbit=30.0)):
        start, quarter, full = (viewpoint(*world, entry, time).pose() for time in (0.0, 3.0, 12.0))
        np.testing.assert_allclose(quarter.focus, start.focus, atol=1e-12)
        before, after = (pose.position - pose.focus for pose in (start, quarter))
        np.testing.assert_allclose(after, [-before[1], before[0], before[2]], atol=1e-12)
        np.testing.assert_allclose(full.position, start.position, atol=1e-12)
        np.testing.assert_allclose(full.rotation, start.rotation, atol=1e-12)


def test_a_tracking_camera_moves_along_with_the_centre_of_mass(world):
    model, data = world
    entry = CameraEntry(track="cart", lookat=(0.0, 0.0, 0.5), distance=2.0)
    before = viewpoint(model, data, entry, 0.0).pose()
    np.testing.assert_allclose(before.focus, [0.5, 0.25, 2.0 + 0.5])  # cart and flag weigh the same
    data.qpos[:3] += [1.0, -3.0, 0.25]
    mujoco.mj_forward(model, data)
    after = viewpoint(model, data, entry, 0.0).pose()
    np.testing.assert_allclose(after.position - before.position, [1.0, -3.0, 0.25])
    np.testing.assert_array_equal(after.rotation, before.rotation)


def test_a_tracking_camera_of_the_model_turns_to_the_body_upright(world):
    model, data = world
    entry = CameraEntry(name="corner", track="flag")
    for shift in ([0.0, 0.0, 0.0], [1.0, -3.0, 2.0]):
        data.qpos[:3] = np.add([0.5, 0.25, 1.0], shift)
        mujoco.mj_forward(model, data)
        pose = viewpoint(model, data, entry, 0.0).pose()
        np.testing.assert_array_equal(pose.position, [3.0, -2.0, 1.0])
        np.testing.assert_allclose(pose.focus, data.body("flag").xpos)
        np.testing.assert_allclose(pose.rotation.T @ pose.rotation, np.eye(3), atol=1e-12)
        assert np.linalg.det(pose.rotation) == pytest.approx(1.0)
        assert pose.rotation[2, 0] == 0  # level
        assert pose.rotation[2, 1] > 0  # and not upside down


def test_a_camera_focuses_on_what_it_is_told_to(world):
    model, data = world
    free = {"lookat": (0.0, 0.0, 1.0), "distance": 4.0, "azimuth": 0.0, "elevation": 0.0}  # looks along x, from x = -4
    for focus, depth in ((None, 4.0), (1.5, 1.5), ("cart", 4.5), ("lamp", 5.0), ((2.0, 7.0, -3.0), 6.0)):
        entry = CameraEntry(**free, focus=focus)
        check_camera(model, entry)
        assert focal_distance(model, data, entry, viewpoint(model, data, entry, 0.0).pose()) == pytest.approx(depth)
    entry = CameraEntry(**free, focus="cart")
    pose = viewpoint(model, data, entry, 0.0).pose()
    for shift, depth in ((1.0, 5.5), (-9.0, 0.08)):  # behind the camera: as near as anything is drawn
        data.qpos[0] = 0.5 + shift
        mujoco.mj_forward(model, data)
        assert focal_distance(model, data, entry, pose) == pytest.approx(depth)


def test_the_eye_goes_over_the_lens_and_the_focal_plane_stays(world):
    camera = Camera((0.1, 0.2, 0.3), distance=3.0, azimuth=130.0, elevation=-25.0, fovy=40.0)
    lens, focus, aspect = (0.05, -0.02), 2.0, 1.5
    middle, pose = camera.pose(), ThroughLens(camera, lens, focus).pose()
    half = np.tan(np.radians(20.0))
    for depth in (0.5, focus, 9.0):
        point = middle.position + middle.rotation @ [0.3, -0.2, -depth]
        seen = []
        for each in (middle, pose):
            clip = perspective(40.0, aspect, 0.1, 50.0, each.shear) @ view_matrix(each) @ [*point, 1.0]
            x, y = clip[:2] / clip[3]
            seen.append([half * aspect * x, half * y])
            # the ray that the shaders send through that pixel meets the point
            way = each.rotation @ [seen[-1][0] + each.shear[0], seen[-1][1] + each.shear[1], -1.0]
            np.testing.assert_allclose(each.eye + depth * way, point, atol=1e-12)
        # thin lens: a point of the aperture sees it shifted by its share of the circle of confusion
        np.testing.assert_allclose(np.subtract(*seen[::-1]), np.array(lens) * (1 / focus - 1 / depth), atol=1e-12)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (CameraEntry(name="ear"), "no camera 'ear'; its cameras are corner"),
        (CameraEntry(focus="cat"), "nothing 'cat' .* its bodies are world, cart, flag; its geoms are lamp"),
        (CameraEntry(track="cat"), "no body 'cat' for the camera to track; its bodies are world, cart, flag"),
    ],
)
def test_what_the_model_does_not_have_is_refused(world, entry, message):
    with pytest.raises(SceneError, match=message):
        check_camera(world[0], entry)
