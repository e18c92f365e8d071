"""Motion blur, depth of field, means of pixels, and the place of a scene's camera."""

import dataclasses
from typing import Any

import mujoco
import numpy as np
import pytest
from exposed_scene import DISTANCE, FOVY, FPS, HEIGHT, SPEED, WIDTH, linear
from mujoco_models import posed
from PIL import Image

from ripple_sim import Simulation, VideoOptions, render_video
from ripple_sim.capture import FilmExposure, FrameSource, focal_distance, snapshots, viewpoint
from ripple_sim.render import Camera, perspective, view_matrix
from ripple_sim.scene import CameraEntry, CameraKey, Scene, check_camera, with_exposure

FOCAL_PIXELS = HEIGHT / 2 / np.tan(np.radians(FOVY) / 2)


def bead(depth: float, alpha: float = 1.0) -> str:
    """A body beside the target, at a distance [m] from the camera."""
    return (
        f'<geom pos="{depth - DISTANCE} {-0.35 * depth} 0" size="{0.03 * depth}" rgba="0.9 0.9 '
        f'0.9 {alpha}"/>'
    )


def last_frame(scene: Scene, frames: int = 1, **options: Any) -> np.ndarray:
    simulation = Simulation(scene, fps=FPS, backend="cpu")
    source = FrameSource(simulation, width=WIDTH, height=HEIGHT, **options)
    pictures = [
        picture
        for state in snapshots(simulation, frames)
        if (picture := source.render(state)) is not None
    ]
    assert len(pictures) == frames
    return pictures[-1]


def blot(scene: Scene, part: tuple[slice, slice], frames: int = 1) -> tuple[float, np.ndarray]:
    """Area of a shape in a picture [pixels], and its variance along x and y [pixels^2]."""
    alpha = last_frame(scene, frames, transparent=True)[part][..., 3] / 255
    at = np.indices(alpha.shape)[::-1]
    mean = (alpha * at).sum(axis=(1, 2), keepdims=True) / alpha.sum()
    return float(alpha.sum()), (alpha * (at - mean) ** 2).sum(axis=(1, 2)) / alpha.sum()


@pytest.mark.parametrize("shutter", [90.0, 180.0, 360.0])
def test_a_ball_leaves_a_streak_as_long_as_it_flies_while_the_shutter_is_open(
    opengl, make_scene, shutter
):
    above = (slice(0, HEIGHT // 2 - 8), slice(None))
    count = 24
    area, sharp = blot(make_scene(), above, frames=2)
    streak_area, streak = blot(make_scene(shutter=shutter, exposures=count), above, frames=2)
    # an even row of points of a length has a variance of length^2 (1 - 1 / count^2) / 12
    length = np.sqrt(12 * (streak[0] - sharp[0]) / (1 - count**-2))
    assert length == pytest.approx(SPEED * shutter / 360 / FPS * FOCAL_PIXELS / DISTANCE, abs=0.7)
    assert streak[1] == pytest.approx(sharp[1], abs=0.1)
    assert streak_area == pytest.approx(area, rel=0.01)


@pytest.mark.parametrize(
    ("depth", "focus", "alpha"),
    [
        (1.2, 2.0, 1.0),
        (1.2, 2.0, 0.6),
        (1.6, 2.0, 1.0),
        (6.0, 2.0, 1.0),
        (6.0, 3.0, 0.6),
        (3.0, 3.0, 1.0),
    ],
)
def test_points_out_of_focus_blur_to_the_disc_of_a_thin_lens(
    opengl, make_scene, depth, focus, alpha
):
    aperture = 0.12
    right = (slice(None), slice(WIDTH // 2 + 12, None))
    area, sharp = blot(make_scene(bead(depth, alpha), ""), right)
    scene = make_scene(bead(depth, alpha), "", aperture=aperture, focus=focus, exposures=48)
    disc_area, disc = blot(scene, right)
    circle = aperture * abs(depth - focus) / depth * FOCAL_PIXELS / focus
    # a full disc has a variance of diameter^2 / 16 along each axis
    diameters = 4 * np.sqrt(np.maximum(disc - sharp, 0))
    np.testing.assert_allclose(diameters, circle, atol=0.5)
    assert disc_area == pytest.approx(area, rel=0.02)


def test_depth_of_field_loses_no_light(opengl, make_scene):
    def light(**exposure: Any) -> np.ndarray:
        return linear(last_frame(make_scene(bead(1.2) + bead(5.0), "", **exposure))).mean(
            axis=(0, 1)
        )

    np.testing.assert_allclose(light(aperture=0.12), light(), rtol=3e-3)


@pytest.mark.parametrize("transparent", [False, True])
def test_a_frame_of_one_exposure_equals_the_plain_frame(opengl, make_scene, transparent):
    plain = last_frame(make_scene(), 2, transparent=transparent)
    single = last_frame(
        make_scene(shutter=180.0, aperture=0.1, exposures=1), 2, transparent=transparent
    )
    np.testing.assert_array_equal(single, plain)


def test_an_orbiting_camera_blurs_fixed_objects(opengl, make_scene):
    right = (slice(None), slice(WIDTH // 2 + 12, None))
    orbit = 120.0
    depth = 1.2
    scene = make_scene(bead(depth), "", shutter=360.0, exposures=24)
    (_, still) = blot(scene, right)
    (_, moved) = blot(with_exposure(scene, orbit=orbit), right)
    angle = np.radians(orbit / FPS)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    x, y = turn @ [depth - DISTANCE, -0.35 * depth]
    way = FOCAL_PIXELS * abs(-y / (DISTANCE + x) - 0.35)
    assert np.sqrt(12 * (moved[0] - still[0])) == pytest.approx(way, abs=0.7)


def test_shadows_of_many_exposures_are_smoother(opengl, make_scene):
    bodies = '<geom type="plane" size="5 5 0.1" pos="0 0 -0.6"/><geom size="0.25" pos="0.3 0 0"/>'
    scene = make_scene(bodies, "", elevation=-50.0)
    scenes = (with_exposure(scene, aperture=1e-9, exposures=count) for count in (1, 8, 64))
    one, few, many = (last_frame(each).astype(float) for each in scenes)
    assert 0 < np.abs(few - many).mean() < 0.5 * np.abs(one - many).mean()


def test_overlays_are_drawn_once_over_the_mean_of_the_exposures(opengl, make_scene, tmp_path):
    def render(name: str, **options: Any) -> np.ndarray:
        path = tmp_path / name
        render_video(
            make_scene(),
            path,
            VideoOptions(size=(WIDTH, HEIGHT), fps=FPS, duration=2 / FPS, **options),
        )
        return np.asarray(Image.open(path / "frame_00001.png")).astype(int)

    blur = {"shutter": 180.0, "exposures": 8}
    bare = render("bare", **blur)
    clock = render("clock", overlay=["time"], **blur)
    ink = np.abs(clock - bare).max(axis=2) > 0
    assert 0 < ink.mean() < 0.1
    away = ink & (render("still") == bare).all(axis=2)  # from what moves
    assert away.any()
    np.testing.assert_array_equal(clock[away], render("plain", overlay=["time"])[away])


def shrink(picture: np.ndarray, factor: int) -> np.ndarray:
    frame = FilmExposure(factor).expose(picture)
    assert frame is not None
    return frame


@pytest.mark.parametrize("factor", [1, 2, 3])
@pytest.mark.parametrize("channels", [3, 4])
def test_shrinking_keeps_the_colour_of_even_areas(factor, channels):
    # all values survive
    small = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(channels, axis=2)
    small[..., 3:] = 255
    np.testing.assert_array_equal(
        shrink(small.repeat(factor, axis=0).repeat(factor, axis=1), factor), small
    )


def test_the_colour_of_transparent_pixels_does_not_count_in_a_mean():
    frame = np.zeros((2, 2, 4), np.uint8)
    frame[0, 0] = (200, 100, 50, 255)
    frame[1, 1] = (0, 255, 0, 0)
    assert shrink(frame, 2).tolist() == [[[200, 100, 50, 64]]]
    assert shrink(np.zeros((2, 2, 4), np.uint8), 2).tolist() == [[[0, 0, 0, 0]]]


@pytest.mark.parametrize("channels", [3, 4])
def test_a_film_exposure_averages_codes_and_linear_light_alike(channels):
    codes = np.random.default_rng(6).integers(0, 256, (3, 4, 6, channels), dtype=np.uint8)
    light = linear(codes)
    light[..., 3:] = codes[..., 3:] / 255
    light[..., :3] *= light[..., 3:] if channels == 4 else 1
    exposure = FilmExposure(2, 3)
    meter = FilmExposure(2, 3)
    for number in range(3):
        frame = exposure.expose(codes[number])
        mean = meter.expose(light[number].astype(np.float16))
    np.testing.assert_allclose(
        mean, light.reshape(3, 2, 2, 3, 2, channels).mean(axis=(0, 2, 4)), rtol=1e-3
    )
    assert (frame.dtype, mean.dtype) == (np.uint8, np.float16)
    expected = mean[..., :3] / (mean[..., 3:] if channels == 4 else 1)
    np.testing.assert_allclose(linear(frame)[..., :3], expected, atol=5e-3)
    # half a code, and half of float16's last place
    np.testing.assert_allclose(frame[..., 3:] / 255, mean[..., 3:], atol=0.5 / 255 + 2.0**-12)


MJCF = """<mujoco><worldbody>
<geom name="lamp" size="0.1" pos="1 0.5 3"/>
<camera name="corner" pos="3 -2 1" xyaxes="0 1 0 0 0 1"/>
<body name="cart" pos="0.5 0.25 1"><freejoint/><geom size="0.1"/>
<body name="flag" pos="0 0 2"><geom size="0.1"/></body></body>
</worldbody></mujoco>"""


@pytest.fixture
def world() -> tuple[mujoco.MjModel, mujoco.MjData]:
    return posed(MJCF)


def test_the_free_camera_looks_at_the_middle_of_the_model(world):
    pose = viewpoint(*world, CameraEntry(distance=2.0), 0.0).pose()
    np.testing.assert_allclose(pose.focus, world[0].stat.center)
    assert np.linalg.norm(pose.position - pose.focus) == pytest.approx(2.0)


def test_an_orbiting_camera_circles_the_point_that_it_looks_at(world):
    for entry in (CameraEntry(distance=2.0, orbit=30.0), CameraEntry(name="corner", orbit=30.0)):
        start, quarter, full = (viewpoint(*world, entry, time).pose() for time in (0.0, 3.0, 12.0))
        np.testing.assert_allclose(quarter.focus, start.focus, atol=1e-12)
        before, after = (pose.position - pose.focus for pose in (start, quarter))
        np.testing.assert_allclose(after, [-before[1], before[0], before[2]], atol=1e-12)
        np.testing.assert_allclose(full.position, start.position, atol=1e-12)
        np.testing.assert_allclose(full.rotation, start.rotation, atol=1e-12)


def test_a_camera_path_passes_through_its_keys_smoothly_and_overshoots_none(world):
    entry = CameraEntry(
        lookat=(0.0, 0.0, 1.0),
        elevation=-30.0,
        fovy=40.0,
        key=[
            CameraKey(time=1.0, distance=4.0, azimuth=350.0),
            CameraKey(time=2.0, azimuth=370.0, lookat=(1.0, 0.0, 0.0)),
            CameraKey(time=4.0, distance=2.0, azimuth=360.0, lookat=(0.0, 2.0, 0.0)),
        ],
    )
    check_camera(world[0], entry)
    times = np.arange(0.0, 5.0, 0.01)
    cameras = [viewpoint(*world, entry, time) for time in times]
    at = {time: viewpoint(*world, entry, time) for time in (1.0, 2.0, 4.0)}
    assert [camera.azimuth for camera in at.values()] == [350.0, 370.0, 360.0]
    assert (at[1.0].distance, at[4.0].distance) == (4.0, 2.0)
    assert (at[2.0].lookat, at[4.0].lookat) == ((1.0, 0.0, 0.0), (0.0, 2.0, 0.0))
    # what no key gives is the camera's, and a value moves between the keys that give it
    assert {(camera.elevation, camera.fovy) for camera in cameras} == {(-30.0, 40.0)}
    assert viewpoint(*world, entry, 2.5).distance == pytest.approx(3.0)
    azimuths = np.array([camera.azimuth for camera in cameras])
    assert azimuths.min() == 350.0
    assert azimuths.max() == 370.0
    # at rest before and after, and no jump of the velocity [degrees/s]: the acceleration is bounded
    velocities = np.diff(azimuths) / 0.01
    assert not velocities[times[:-1] < 0.995].any()
    assert not velocities[times[1:] > 4.005].any()
    assert np.abs(np.diff(velocities)).max() < 0.05 * np.abs(velocities).max()


def test_a_camera_path_rides_on_a_tracked_body(world):
    keys = [CameraKey(time=0.0, lookat=(0.0, 0.0, 0.5)), CameraKey(time=1.0, distance=3.0)]
    entry = CameraEntry(track="cart", key=keys)
    pose = viewpoint(*world, entry, 0.5).pose()
    np.testing.assert_allclose(pose.focus, [0.5, 0.25, 2.0 + 0.5])
    assert pose.distance == pytest.approx(3.0)


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


def test_a_camera_focuses_on_a_distance_a_body_or_a_point(world):
    model, data = world
    # looks along x, from x = -4
    free = {"lookat": (0.0, 0.0, 1.0), "distance": 4.0, "azimuth": 0.0, "elevation": 0.0}
    for focus, depth in (
        (None, 4.0),
        (1.5, 1.5),
        ("cart", 4.5),
        ("lamp", 5.0),
        ((2.0, 7.0, -3.0), 6.0),
    ):
        entry = CameraEntry(**free, focus=focus)
        check_camera(model, entry)
        assert focal_distance(
            model, data, entry, viewpoint(model, data, entry, 0.0).pose()
        ) == pytest.approx(depth)
    entry = CameraEntry(**free, focus="cart")
    pose = viewpoint(model, data, entry, 0.0).pose()
    # behind the camera: as near as anything is drawn
    for shift, depth in ((1.0, 5.5), (-9.0, 0.08)):
        data.qpos[0] = 0.5 + shift
        mujoco.mj_forward(model, data)
        assert focal_distance(model, data, entry, pose) == pytest.approx(depth)


def test_the_eye_goes_over_the_lens_and_the_focal_plane_stays(world):
    camera = Camera((0.1, 0.2, 0.3), distance=3.0, azimuth=130.0, elevation=-25.0, fovy=40.0)
    lens = (0.05, -0.02)
    focus = 2.0
    aspect = 1.5
    middle = camera.pose()
    pose = dataclasses.replace(camera.pose(), lens=lens, focal_distance=focus)
    half = np.tan(np.radians(20.0))
    for depth in (0.5, focus, 9.0):
        point = middle.position + middle.rotation @ [0.3, -0.2, -depth]
        seen = []
        for each in (middle, pose):
            clip = (
                perspective(40.0, aspect, 0.1, 50.0, each.shear) @ view_matrix(each) @ [*point, 1.0]
            )
            x, y = clip[:2] / clip[3]
            seen.append([half * aspect * x, half * y])
            # the ray that the shaders send through that pixel meets the point
            way = each.rotation @ [seen[-1][0] + each.shear[0], seen[-1][1] + each.shear[1], -1.0]
            np.testing.assert_allclose(each.eye + depth * way, point, atol=1e-12)
        # thin lens: a point of the aperture sees it shifted by its share of the circle of confusion
        np.testing.assert_allclose(
            np.subtract(*seen[::-1]), np.array(lens) * (1 / focus - 1 / depth), atol=1e-12
        )
