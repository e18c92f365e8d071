"""Points taken into a geom's frame and back agree with MuJoCo's own transforms."""

import mujoco
import numpy as np
import pytest

from ripple_sim.coupling.patches import Pose, in_frame, in_world


def random_pose(seed: int) -> tuple[Pose, np.ndarray]:
    """A pose and its quaternion."""
    rng = np.random.default_rng(seed)
    quaternion = rng.standard_normal(4)
    quaternion /= np.linalg.norm(quaternion)
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, quaternion)
    return Pose(rng.standard_normal(3), rotation.reshape(3, 3)), quaternion


@pytest.mark.parametrize("seed", range(3))
def test_points_go_into_the_world_as_mujoco_takes_them(seed: int) -> None:
    pose, quaternion = random_pose(seed)
    points = np.random.default_rng(seed + 10).standard_normal((7, 3))
    expected, no_turn = np.zeros(3), np.zeros(4)
    for point, found in zip(points, in_world(points, pose), strict=True):
        mujoco.mju_trnVecPose(expected, pose.position, quaternion, point)
        np.testing.assert_allclose(found, expected, atol=1e-14)
    back = np.zeros(3)
    mujoco.mju_negPose(back, no_turn, pose.position, quaternion)
    for point, found in zip(points, in_frame(points, pose), strict=True):
        mujoco.mju_trnVecPose(expected, back, no_turn, point)
        np.testing.assert_allclose(found, expected, atol=1e-14)


@pytest.mark.parametrize("seed", range(3))
def test_there_and_back_is_where_it_began(seed: int) -> None:
    pose, _ = random_pose(seed)
    points = 100 * np.random.default_rng(seed).standard_normal((20, 3))
    np.testing.assert_allclose(in_frame(in_world(points, pose), pose), points, atol=1e-12)
    np.testing.assert_allclose(in_world(in_frame(points, pose), pose), points, atol=1e-12)


def test_a_geom_placed_on_a_turned_body_has_its_corners_where_its_frame_says() -> None:
    """A box inside a body inside a body: its corner, marked by a site of its own, is at the same place in the world."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body pos="1 2 3" euler="20 30 40"><body pos="-0.5 0 1" euler="0 70 0">
        <geom name="box" type="box" size="0.1 0.2 0.3" pos="0.4 0 0"/>
        <site name="corner" pos="0.5 0.2 0.3"/></body></body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pose = Pose(data.geom("box").xpos, data.geom("box").xmat.reshape(3, 3))
    [corner] = in_world(np.array([[0.1, 0.2, 0.3]]), pose)
    np.testing.assert_allclose(corner, data.site("corner").xpos, atol=1e-14)


def test_no_points_stay_no_points_and_the_given_ones_are_not_changed() -> None:
    pose, _ = random_pose(0)
    assert in_frame(np.zeros((0, 3)), pose).shape == in_world(np.zeros((0, 3)), pose).shape == (0, 3)
    points = np.random.default_rng(0).standard_normal((4, 3))
    before = points.copy()
    in_frame(points, pose), in_world(points, pose)
    np.testing.assert_array_equal(points, before)
