"""Cameras agree with MuJoCo's and with projection by hand; bounds; the sRGB curve."""

import dataclasses

import mujoco
import numpy as np
import pytest

from ripple_sim import render
from ripple_sim.errors import RippleWarning, SceneError
from ripple_sim.render import Camera, Pose, linear_to_srgb, srgb_to_linear
from ripple_sim.solver import RippleError

MJCF = """<mujoco><worldbody>
<geom size="1"/><camera name="side" pos="0 -5 1" xyaxes="1 0 0 0 .2 1"/>
<body name="moving" pos="1 2 3"><freejoint/><geom size=".1" pos=".2 0 0"/>
<camera pos="0 -2 0" fovy="30"/></body>
</worldbody><visual><global fovy="35" azimuth="20" elevation="-10"/></visual></mujoco>"""
FREE = {"lookat": (0.3, -0.2, 0.1), "distance": 2.5, "azimuth": 37.0, "elevation": -28.0}

PROJECTIONS = """<mujoco><statistic center="0 0 0" extent="3"/><worldbody><geom size=".1"/>
<camera name="plain" pos="0 -5 1" xyaxes="1 0 0 0 .2 1" fovy="30"/>
<camera name="orthographic" pos="1 -5 1" xyaxes="1 0 0 0 .2 1" projection="orthographic" fovy="3"/>
<camera name="off centre" pos="0 -5 1" xyaxes="1 .1 0 0 .2 1" resolution="200 120"
  sensorsize="8e-3 4.8e-3" focal="6e-3 6e-3" principal="1e-3 .5e-3"/>
<camera name="two focal lengths" pos="0 -5 1" xyaxes="1 0 0 0 .2 1" resolution="200 120"
  sensorsize="8e-3 4.8e-3" focal="3e-3 6e-3"/></worldbody></mujoco>"""

SIZE = (200, 120)
PARALLEL = {"orthographic": True, "fovy": 3.0}
OFF_CENTRE = {"centre": (0.4, -0.2), "half_width": 0.6}


def mujoco_camera(kind: str = "FREE", **attributes: object) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.type = getattr(mujoco.mjtCamera, f"mjCAMERA_{kind}")
    for name, value in attributes.items():
        setattr(camera, name, value)
    return camera


def default_camera(model: mujoco.MjModel) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, camera)
    return camera


@pytest.mark.parametrize(
    ("given", "theirs"),
    [
        (-1, default_camera),
        (1, lambda model: mujoco_camera("FIXED", fixedcamid=1)),
        ("side", lambda model: mujoco_camera("FIXED", fixedcamid=0)),
        (mujoco_camera(), lambda model: mujoco_camera()),
        # the model's word counts there
        (mujoco_camera(orthographic=1), lambda model: mujoco_camera(orthographic=1)),
        (Camera((0.3, -0.2, 0.1), 2.5, 37.0, -28.0, 35.0), lambda model: mujoco_camera(**FREE)),
        (
            mujoco_camera("TRACKING", trackbodyid=1),
            lambda model: mujoco_camera("TRACKING", trackbodyid=1),
        ),
        (mujoco_camera("FIXED", fixedcamid=1), lambda model: mujoco_camera("FIXED", fixedcamid=1)),
    ],
    ids=["-1", "id", "name", "free", "free with a flag", "ours", "tracking", "fixed"],
)
def test_cameras_of_all_kinds_have_the_pose_and_angle_of_mujocos(given, theirs):
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    data.qpos[:] = [0.5, 0.4, 2.0, 0.8, 0.0, 0.6, 0.0]
    mujoco.mj_forward(model, data)
    scene = mujoco.MjvScene(model, maxgeom=50)
    option = mujoco.MjvOption()
    everything = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, option, None, theirs(model), everything, scene)
    eyes = [np.array(eye.pos, dtype=float) for eye in scene.camera]
    seen = scene.camera[0]
    pose = render.find_viewpoint(model, data, given).pose()
    np.testing.assert_allclose(pose.position, np.mean(eyes, axis=0), atol=1e-6)
    np.testing.assert_allclose(-pose.rotation[:, 2], seen.forward, atol=1e-6)
    np.testing.assert_allclose(pose.rotation[:, 1], seen.up, atol=1e-6)
    assert np.tan(np.radians(pose.fovy / 2)) == pytest.approx(
        seen.frustum_top / seen.frustum_near, rel=1e-5
    )


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (2, r"no camera 2; it has: 'side' \(id 0\), '' \(id 1\)"),
        (-2, "no camera -2"),
        ("sid", "'sid'.*'side'"),
        ((0.0, 1.0, 2.0), "camera must be a Camera, .*, got tuple"),
        (mujoco_camera("USER"), "type must be mjCAMERA_FREE .*, got 3"),
        (mujoco_camera("TRACKING"), "trackbodyid must be a body of the model, 0 to 1, got -1"),
        (mujoco_camera("FIXED"), "no camera -1"),
    ],
)
def test_invalid_cameras_are_refused(given, message: str):
    model = mujoco.MjModel.from_xml_string(MJCF)
    with pytest.raises(SceneError, match=message):
        render.find_viewpoint(model, mujoco.MjData(model), given)


@pytest.mark.parametrize("broken", [{"distance": 0.0}, {"fovy": 180.0}, {"azimuth": np.nan}])
def test_impossible_cameras_are_refused(broken):
    with pytest.raises(RippleError, match="camera"):
        Camera(**{"lookat": (0, 0, 0), "distance": 1.0, "azimuth": 0.0, "elevation": 0.0} | broken)


def test_balls_about_triangles_hold_each_and_are_small() -> None:
    random = np.random.default_rng(5)
    angle = random.uniform(0, 2 * np.pi, 300)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(300)], axis=1)
    triangles = ring[:, None] + random.normal(size=(300, 3, 3)) * 0.02
    balls = render.balls_about(triangles, 16)
    centres = balls[:, :3]
    radii = balls[:, 3]
    distances = np.linalg.norm(triangles[:, :, None] - centres, axis=3)
    is_corner_inside = distances <= radii + 1e-12  # [triangle, corner, ball]; round-off
    assert is_corner_inside.all(axis=1).any(axis=1).all()
    assert len(balls) == 16
    assert radii.max() < 0.4


def random_balls(count: int) -> np.ndarray:
    random = np.random.default_rng(7)
    return np.column_stack([random.normal(size=(count, 3)), random.uniform(0.1, 0.5, count)])


def test_the_enclosing_ball_contains_every_ball() -> None:
    balls = random_balls(9)
    centre, radius = render.enclosing(balls)
    assert (np.linalg.norm(balls[:, :3] - centre, axis=1) + balls[:, 3] <= radius + 1e-12).all()
    assert render.enclosing(balls[:1])[1] == balls[0, 3]


def test_within_returns_the_balls_that_touch_the_given_ball() -> None:
    balls = np.concatenate([random_balls(40), [[9.0, 0.0, 0.0, np.inf]]])
    near = render.within(balls, np.zeros(3), 1.0)
    gap = np.linalg.norm(balls[:, :3], axis=1) - balls[:, 3]
    np.testing.assert_array_equal(near, balls[gap < 1.0])
    assert 1 < len(near) < 40


def test_the_srgb_curve_has_known_values_and_an_inverse() -> None:
    np.testing.assert_allclose(
        srgb_to_linear([0.0, 0.04045, 0.5, 1.0]), [0.0, 0.0031308, 0.21404, 1.0], atol=1e-5
    )
    np.testing.assert_allclose(
        linear_to_srgb([0.0, 0.18, 0.5, 1.0]), [0.0, 0.46136, 0.73536, 1.0], atol=1e-5
    )
    values = np.linspace(0.0, 1.0, 4001)
    np.testing.assert_allclose(linear_to_srgb(srgb_to_linear(values)), values, atol=1e-7)
    np.testing.assert_allclose(srgb_to_linear(linear_to_srgb(values)), values, atol=1e-7)


def pose(seed: int, lens: tuple[float, float] = (0.0, 0.0), **others: object) -> Pose:
    rotation, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    rotation[:, 0] *= np.sign(np.linalg.det(rotation))
    plain = Pose(np.array([0.3, -0.2, 0.5]), rotation, 2.0, 50.0, lens, 2.0)
    return dataclasses.replace(plain, **others)


def pixels(points: np.ndarray, camera: Pose) -> np.ndarray:
    """Where points show [pixels], [k, 2]."""
    matrix = camera.projection(SIZE[0] / SIZE[1], (0.01, 100.0)) @ render.view_matrix(camera)
    clip = np.c_[points, np.ones(len(points))] @ matrix.T
    return (0.5 + 0.5 * clip[:, :2] / clip[:, 3:]) * SIZE


@pytest.mark.parametrize("lens", [(0.0, 0.0), (0.2, -0.1)])
@pytest.mark.parametrize("others", [{}, OFF_CENTRE, PARALLEL, PARALLEL | OFF_CENTRE])
def test_box_holds_the_ball(lens: tuple[float, float], others: dict[str, object]) -> None:
    camera = pose(1, lens, **others)
    random = np.random.default_rng(2)
    local = np.stack(
        [random.uniform(-2, 2, 40), random.uniform(-2, 2, 40), random.uniform(-6, -1, 40)], axis=1
    )
    radii = random.uniform(0.05, 0.6, 40)
    centres = camera.eye + local @ camera.rotation.T
    directions = random.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    boxes = render.boxes_of(np.column_stack([centres, radii]), camera, SIZE)
    for centre, radius, box in zip(centres, radii, boxes, strict=True):
        shown = np.clip(pixels(centre + radius * directions, camera), 0, SIZE)
        first_corner = box[:2]
        last_corner = box[2:]
        assert (shown >= first_corner).all() and (shown <= last_corner).all()


@pytest.mark.parametrize("others", [{}, OFF_CENTRE, PARALLEL, PARALLEL | OFF_CENTRE])
def test_points_in_focus_stay_in_place_for_all_eyes_on_the_lens(
    others,
) -> None:
    middle = pose(1, **others)
    aside = pose(1, (0.2, -0.1), **others)
    points = np.random.default_rng(6).normal(size=(20, 3))
    depth = (points - middle.position) @ middle.rotation[:, 2] + 2.0
    in_focus = points - depth[:, None] * middle.rotation[:, 2]
    np.testing.assert_allclose(pixels(in_focus, aside), pixels(in_focus, middle), atol=1e-9)
    for camera in (middle, aside):
        to_points = camera.ways(points)
        shown, away = camera.pixels(points, SIZE)
        ahead = away > 0
        shown_half_way, away_half_way = camera.pixels(points - 0.5 * to_points, SIZE)
        np.testing.assert_allclose(shown_half_way[ahead], shown[ahead], atol=1e-6)
        np.testing.assert_allclose(away_half_way, away / 2, atol=1e-12)


@pytest.mark.parametrize("others", [{}, PARALLEL])
def test_the_near_plane_moves_on_to_the_first_ball_ahead_and_no_farther(others) -> None:
    camera = pose(1, clip=(0.001, 100.0), **others)
    forward = -camera.rotation[:, 2]
    balls = np.array([[*(camera.position + away * forward), 0.5] for away in (-3.0, 4.0, 6.0)])
    near, far = camera.planes_about(balls)
    first_surface = 4.0 - 0.5
    assert (near, far) == (pytest.approx(first_surface, rel=0.02), 100.0)
    assert near < first_surface
    about_the_eye = np.array([[*camera.position, 1.0]])
    with_eye_inside = camera.planes_about(np.concatenate([balls, about_the_eye]))
    without_balls = camera.planes_about(balls[:0])
    assert with_eye_inside == without_balls == (0.001, 100.0)
    without_clip = dataclasses.replace(camera, clip=None)
    assert without_clip.planes_about(balls) == (0.02 * 2.0, 200.0 * 2.0)


def test_a_substitute_perspective_has_the_same_height_in_focus_with_one_warning() -> None:
    plain = pose(1)
    parallel = pose(1, **PARALLEL)
    assert plain.in_perspective(1.5, "the page") is plain
    with pytest.warns(RippleWarning, match="the page shows the camera in perspective") as told:
        shown = parallel.in_perspective(1.5, "the page")
    assert len(told) == 1
    assert shown.is_plain(1.5)
    assert shown.pixel_height(parallel.distance, 100) == pytest.approx(
        parallel.pixel_height(5.0, 100)
    )


def test_a_ball_about_the_eye_has_the_whole_frame_and_a_ball_behind_the_eye_has_none() -> None:
    camera = pose(4)
    behind = camera.eye + 2.0 * camera.rotation[:, 2]
    centres = np.stack([camera.eye, camera.eye + camera.rotation[:, 0], behind])
    boxes = render.boxes_of(np.column_stack([centres, [0.5, np.inf, 0.5]]), camera, SIZE)
    np.testing.assert_array_equal(boxes[:2], [[0, 0, *SIZE]] * 2)
    assert (boxes[2, :2] == boxes[2, 2:]).all()


def projected(matrix, points):
    clip = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return clip[:, :3] / clip[:, 3:], clip[:, 3]


@pytest.mark.parametrize("fovy", [5.0, 45.0, 120.0])
@pytest.mark.parametrize("aspect", [0.5, 1.0, 16 / 9])
def test_corners_of_the_frustum_are_corners_of_clip_space(fovy, aspect):
    near = 0.3
    far = 70.0
    half = np.tan(np.radians(fovy) / 2) * np.array([aspect, 1.0])
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    depth = np.where(corners[:, 2] < 0, near, far)
    points = np.column_stack([corners[:, :2] * half * depth[:, None], -depth])
    shown, w = projected(render.perspective(fovy, aspect, near, far), points)
    np.testing.assert_allclose(shown, corners, atol=1e-12)
    # what attributes are divided by is the distance along the axis
    np.testing.assert_allclose(w, depth)


@pytest.mark.parametrize(("half_width", "depth"), [(1.0, 2.0), (0.02, 7.0), (30.0, 0.5)])
def test_the_orthographic_box_is_clip_space(half_width, depth):
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    points = np.column_stack([corners[:, :2] * half_width, -depth * (corners[:, 2] + 1) / 2])
    shown, w = projected(render.orthographic(half_width, depth), points)
    np.testing.assert_allclose(shown, corners, atol=1e-12)
    np.testing.assert_array_equal(w, 1.0)


def in_opengl(camera: mujoco.MjvGLCamera, aspect: float, points: np.ndarray) -> np.ndarray:
    """Points in clip space as glFrustum and glOrtho define it, by OpenGL's manual."""
    bottom = float(camera.frustum_bottom)
    top = float(camera.frustum_top)
    near = float(camera.frustum_near)
    far = float(camera.frustum_far)
    half_width = float(camera.frustum_width) or aspect * (top - bottom) / 2
    left = camera.frustum_center - half_width
    right = camera.frustum_center + half_width
    forward = np.array(camera.forward, float)
    up = np.array(camera.up, float)
    x, y, z = np.stack([np.cross(forward, up), up, -forward]) @ (points - camera.pos).T
    if camera.orthographic:
        clip_x = (2 * x - right - left) / (right - left)
        clip_y = (2 * y - top - bottom) / (top - bottom)
        clip_z = -(2 * z + far + near) / (far - near)
        return np.stack([clip_x, clip_y, clip_z], axis=1)
    clip_x = (2 * near * x + (right + left) * z) / (right - left)
    clip_y = (2 * near * y + (top + bottom) * z) / (top - bottom)
    clip_z = (-(far + near) * z - 2 * far * near) / (far - near)
    return np.stack([clip_x, clip_y, clip_z], axis=1) / -z[:, None]


@pytest.mark.parametrize("name", ["plain", "orthographic", "off centre", "two focal lengths"])
def test_every_projection_shows_and_clips_points_as_mujocos_frustum_does(
    name,
):
    model = mujoco.MjModel.from_xml_string(PROJECTIONS)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    scene = mujoco.MjvScene()
    aspect = SIZE[0] / SIZE[1]
    mujoco.mjv_updateCamera(model, data, render.mujoco_camera(model, name), scene)
    points = np.random.default_rng(3).normal(size=(30, 3))
    theirs = in_opengl(mujoco.mjv_averageCamera(*scene.camera), aspect, points)
    for pose in (render.find_viewpoint(model, data, name), render.pose_of_scene(scene.camera, 2.0)):
        ours, _ = projected(pose.projection(aspect) @ render.view_matrix(pose), points)
        np.testing.assert_allclose(ours, theirs, atol=2e-5)  # MuJoCo's frustum is float32
        shown, depth = pose.pixels(points, SIZE)
        their_pixels = (0.5 + 0.5 * theirs[:, :2] * [1, -1]) * SIZE
        np.testing.assert_allclose(shown, their_pixels, atol=1e-2)
        local = (points - pose.position) @ pose.rotation
        np.testing.assert_allclose(depth, -local[:, 2])
        copied = mujoco.MjvScene()
        render.set_scene_camera(copied.camera, pose, model)
        again = in_opengl(copied.camera[0], aspect, points)
        np.testing.assert_allclose(again, theirs, atol=2e-5)


@pytest.mark.parametrize("name", ["plain", "orthographic", "off centre", "two focal lengths"])
def test_points_of_a_depth_image_lie_where_their_pixels_are(name):
    model = mujoco.MjModel.from_xml_string(PROJECTIONS)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pose = render.find_viewpoint(model, data, name)
    depth = np.random.default_rng(4).uniform(1.0, 9.0, (6, 10))
    shown, away = pose.pixels(pose.points(depth), (10, 6))
    middles = np.stack(np.meshgrid(np.arange(10) + 0.5, np.arange(6) + 0.5), axis=-1)
    np.testing.assert_allclose(shown, middles, atol=1e-9)
    np.testing.assert_allclose(away, depth)


def test_scenes_whose_camera_sees_nothing_are_refused():
    with pytest.raises(
        SceneError, match="the scene's camera sees nothing: its frustum is 0 m to 0 m high"
    ):
        render.pose_of_scene(mujoco.MjvScene().camera, 1.0)


def test_a_camera_whose_pose_was_never_computed_gets_it_with_a_warning():
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    with pytest.warns(RippleWarning, match="the data has no poses of cameras"):
        pose = render.find_viewpoint(model, data, "side")
    np.testing.assert_allclose(pose.position, [0, -5, 1])
    assert not data.cam_xmat.any()


def test_a_camera_on_a_body_keeps_its_distance_from_the_body():
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)

    def distance_at(x: float) -> float:
        data.qpos[0] = x
        mujoco.mj_forward(model, data)
        return render.find_viewpoint(model, data, 1).distance

    near_origin = distance_at(0.0)
    from_camera_to_geom = np.hypot(2.0, 0.2)
    # to the middle of the tree, which is about that of its geom
    assert near_origin == pytest.approx(distance_at(200.0))
    assert near_origin == pytest.approx(from_camera_to_geom, rel=0.2)


def test_the_distance_of_a_camera_is_to_its_robot_or_to_its_target_body():
    model = mujoco.MjModel.from_xml_string("""<mujoco>
      <statistic center="9 9 9" extent="1"/>
      <worldbody>
        <body name="base" pos="3 0 0"><geom size=".2"/>
          <body pos="0 0 1"><joint/><geom size=".2"/><camera name="wrist" pos="0 0 1"/></body>
        </body>
        <camera name="aimed" mode="targetbody" target="base"/>
        <camera name="still"/>
      </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    distances = {
        name: render.find_viewpoint(model, data, name).distance
        for name in ("wrist", "aimed", "still")
    }
    to_middle_of_robot = 1.5
    to_base = 3.0
    to_middle_of_model = 9 * np.sqrt(3)
    assert distances == {
        "wrist": pytest.approx(to_middle_of_robot),
        "aimed": pytest.approx(to_base),
        "still": pytest.approx(to_middle_of_model),
    }
