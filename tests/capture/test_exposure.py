"""Motion blur and depth of field: streaks as long and discs as wide as a camera's, and no light lost."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from ripple_sim.capture.exposure import Exposures, disc_points
from ripple_sim.capture.frame_source import FrameSource
from ripple_sim.capture.sensor import Sensor
from ripple_sim.capture.shutter import ShutterTimes
from ripple_sim.capture.snapshot import snapshots
from ripple_sim.errors import SceneError, VideoError
from ripple_sim.scene.camera import CameraEntry
from ripple_sim.scene.camera_override import with_exposure
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.scene.scene import Scene
from ripple_sim.simulation import Simulation
from ripple_sim.video.options import VideoOptions
from ripple_sim.video.render_video import Progress, render_video

FPS, WIDTH, HEIGHT, DISTANCE, FOVY, SPEED = 30, 240, 120, 2.0, 40.0, 18.0
FOCAL_PIXELS = HEIGHT / 2 / np.tan(np.radians(FOVY) / 2)

MJCF = """<mujoco><option gravity="0 0 0" timestep="0.002"/><worldbody>
<geom name="egg" type="sphere" size="0.05"/>{bodies}</worldbody></mujoco>"""
SHOT = '<body name="shot" pos="0 0.9 0.3"><freejoint/><geom size="0.05" contype="0" conaffinity="0"/></body>'
TOML = f"""model = "scene.xml"
duration = 0.2
lighting = "studio"
[camera]
lookat = [0, 0, 0]
distance = {DISTANCE}
azimuth = 0
elevation = 0
fovy = {FOVY}
[[ripple]]
geom = "egg"
resolution = 16
material = {{speed = 0.5, density = 20.0}}
"""
THROW = f"""[[throw]]
body = "shot"
time = 0.0
velocity = [0, {-SPEED}, 0]
"""


@pytest.fixture
def make_scene(tmp_path: Path) -> Callable[..., Scene]:
    def make(bodies: str = SHOT, script: str = THROW, **exposure: Any) -> Scene:
        (tmp_path / "scene.xml").write_text(MJCF.format(bodies=bodies))
        (tmp_path / "scene.toml").write_text(TOML + script)
        return with_exposure(load_scene(tmp_path / "scene.toml"), **exposure)

    return make


def bead(depth: float, alpha: float = 1.0) -> str:
    """A body beside the target, at a distance [m] from the camera."""
    return f'<geom pos="{depth - DISTANCE} {-0.35 * depth} 0" size="{0.03 * depth}" rgba="0.9 0.9 0.9 {alpha}"/>'


def last_frame(scene: Scene, frames: int = 1, **options: Any) -> np.ndarray:
    simulation = Simulation(scene, fps=FPS, backend="cpu")
    source = FrameSource(simulation, width=WIDTH, height=HEIGHT, **options)
    pictures = [picture for state in snapshots(simulation, frames) if (picture := source.render(state)) is not None]
    assert len(pictures) == frames
    return pictures[-1]


def linear(codes: np.ndarray) -> np.ndarray:
    """Light of sRGB values from 0 to 255."""
    share = codes / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def blot(scene: Scene, part: tuple[slice, slice], frames: int = 1) -> tuple[float, np.ndarray]:
    """Area [pixels] of what covers a part of the picture, and its variance along x and y [pixels^2]."""
    alpha = last_frame(scene, frames, transparent=True)[part][..., 3] / 255
    at = np.indices(alpha.shape)[::-1]
    mean = (alpha * at).sum(axis=(1, 2), keepdims=True) / alpha.sum()
    return float(alpha.sum()), (alpha * (at - mean) ** 2).sum(axis=(1, 2)) / alpha.sum()


@pytest.mark.parametrize("count", [1, 2, 7, 32, 100])
def test_lens_points_fill_the_disc_evenly(count):
    points = disc_points(count)
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=1e-12)
    assert np.linalg.norm(points, axis=1).max(initial=0) <= 1.15
    if count >= 32:
        # of a full disc: a quarter along each axis, nothing between them
        np.testing.assert_allclose(points.T @ points / count, np.eye(2) / 4, atol=0.02)


def test_exposures_of_a_camera():
    assert len(Exposures.of(CameraEntry())) == 1
    assert not Exposures.of(CameraEntry(shutter=180.0, aperture=0.1, exposures=1)).offsets.any()
    exposures = Exposures.of(CameraEntry(shutter=180.0, aperture=0.1, exposures=40))
    np.testing.assert_allclose(exposures.times, np.arange(40) / 80)
    # whatever part of the time is looked at, the eye has been all over the lens
    for begin in range(0, 40, 10):
        part = exposures.offsets[begin : begin + 10]
        assert np.linalg.norm(part.mean(axis=0)) < 0.015
        assert 0.025 < np.linalg.norm(part, axis=1).mean() < 0.042


def test_the_sensor_averages_light_over_exposures():
    black, white = np.zeros((2, 3, 3), np.uint8), np.full((2, 3, 3), 255, np.uint8)
    sensor = Sensor(exposures=2)
    for _ in range(2):  # the second frame keeps nothing of the first
        assert sensor.expose(black) is None
        np.testing.assert_array_equal(sensor.expose(white), 188)  # sRGB of half the light


@pytest.mark.parametrize("channels", [3, 4])
def test_the_sensor_averages_codes_and_linear_light_alike(channels):
    codes = np.random.default_rng(6).integers(0, 256, (3, 4, 6, channels), dtype=np.uint8)
    light = linear(codes)
    light[..., 3:] = codes[..., 3:] / 255
    light[..., :3] *= light[..., 3:] if channels == 4 else 1
    sensor, meter = Sensor(2, 3), Sensor(2, 3)
    for number in range(3):
        frame, mean = sensor.expose(codes[number]), meter.expose(light[number].astype(np.float32))
    np.testing.assert_allclose(mean, light.reshape(3, 2, 2, 3, 2, channels).mean(axis=(0, 2, 4)), rtol=1e-5)
    assert frame.dtype == np.uint8
    expected = mean[..., :3] / (mean[..., 3:] if channels == 4 else 1)
    np.testing.assert_allclose(linear(frame)[..., :3], expected, atol=5e-3)
    np.testing.assert_allclose(frame[..., 3:] / 255, mean[..., 3:], atol=2e-3)


def test_states_within_a_step_are_interpolated_and_do_not_change_the_motion(make_scene):
    poke = '[[poke]]\ngeom = "egg"\ntime = 0.02\npoint = [0.0, 0.0, 0.05]\nimpulse = 1e-4\nradius = 0.02\n'
    scene = make_scene(script=THROW + poke)
    whole, parts = (Simulation(scene, fps=FPS, backend="cpu") for _ in range(2))
    steps, dt = whole.steps_per_frame, whole.model.opt.timestep
    times = np.array([0, 0.5, 1, 1.25, steps - 0.5, steps])
    shutter_times = ShutterTimes(parts, times / steps)
    for number in range(3):
        begin, start, heights = whole.data.time, whole.data.body("shot").xpos[1], [whole.ripples["egg"].height]
        for _ in range(steps):
            whole.step()
            heights.append(whole.ripples["egg"].height)
        whole.advance_frame()
        for time, (data, shown) in zip(times, shutter_times, strict=True):
            assert data.time == pytest.approx(begin + time * dt, abs=1e-12)
            if number:  # in frame 0 it stands still until the first step
                assert data.body("shot").xpos[1] == pytest.approx(start - SPEED * time * dt, abs=1e-9)
            before, after = heights[int(np.floor(time))], heights[int(np.ceil(time))]
            np.testing.assert_allclose(shown["egg"], before + (time % 1) * (after - before), rtol=1e-5, atol=1e-9)
        parts.advance_frame()
        np.testing.assert_array_equal(parts.data.qpos, whole.data.qpos)
        np.testing.assert_array_equal(parts.ripples["egg"].height, whole.ripples["egg"].height)
    assert whole.ripples["egg"].height.any()


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("shutter", [90.0, 180.0, 360.0])
def test_a_ball_leaves_a_streak_as_long_as_it_flies_while_the_shutter_is_open(make_scene, shutter):
    above, count = (slice(0, HEIGHT // 2 - 8), slice(None)), 24
    area, sharp = blot(make_scene(), above, frames=2)
    streak_area, streak = blot(make_scene(shutter=shutter, exposures=count), above, frames=2)
    # an even row of points of a length has a variance of length^2 (1 - 1 / count^2) / 12
    length = np.sqrt(12 * (streak[0] - sharp[0]) / (1 - count**-2))
    assert length == pytest.approx(SPEED * shutter / 360 / FPS * FOCAL_PIXELS / DISTANCE, abs=0.7)
    assert streak[1] == pytest.approx(sharp[1], abs=0.1)
    assert streak_area == pytest.approx(area, rel=0.01)


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize(
    ("depth", "focus", "alpha"),
    [(1.2, 2.0, 1.0), (1.2, 2.0, 0.6), (1.6, 2.0, 1.0), (6.0, 2.0, 1.0), (6.0, 3.0, 0.6), (3.0, 3.0, 1.0)],
)
def test_what_is_out_of_focus_blurs_to_the_disc_of_a_thin_lens(make_scene, depth, focus, alpha):
    aperture, right = 0.12, (slice(None), slice(WIDTH // 2 + 12, None))
    area, sharp = blot(make_scene(bead(depth, alpha), ""), right)
    scene = make_scene(bead(depth, alpha), "", aperture=aperture, focus=focus, exposures=48)
    disc_area, disc = blot(scene, right)
    circle = aperture * abs(depth - focus) / depth * FOCAL_PIXELS / focus
    # a full disc has a variance of diameter^2 / 16 along each axis
    diameters = 4 * np.sqrt(np.maximum(disc - sharp, 0))
    np.testing.assert_allclose(diameters, circle, atol=0.5)
    assert disc_area == pytest.approx(area, rel=0.02)


@pytest.mark.usefixtures("opengl")
def test_depth_of_field_loses_no_light(make_scene):
    def light(**exposure: Any) -> np.ndarray:
        return linear(last_frame(make_scene(bead(1.2) + bead(5.0), "", **exposure))).mean(axis=(0, 1))

    np.testing.assert_allclose(light(aperture=0.12), light(), rtol=3e-3)


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("transparent", [False, True])
def test_one_exposure_is_the_plain_frame(make_scene, transparent):
    plain = last_frame(make_scene(), 2, transparent=transparent)
    single = last_frame(make_scene(shutter=180.0, aperture=0.1, exposures=1), 2, transparent=transparent)
    np.testing.assert_array_equal(single, plain)


@pytest.mark.usefixtures("opengl")
def test_a_camera_that_goes_round_blurs_what_stands_still(make_scene):
    right, orbit, depth = (slice(None), slice(WIDTH // 2 + 12, None)), 120.0, 1.2
    scene = make_scene(bead(depth), "", shutter=360.0, exposures=24)
    (_, still), (_, moved) = blot(scene, right), blot(with_exposure(scene, orbit=orbit), right)
    angle = np.radians(orbit / FPS)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    x, y = turn @ [depth - DISTANCE, -0.35 * depth]
    way = FOCAL_PIXELS * abs(-y / (DISTANCE + x) - 0.35)
    assert np.sqrt(12 * (moved[0] - still[0])) == pytest.approx(way, abs=0.7)


@pytest.mark.usefixtures("opengl")
def test_shadows_of_many_exposures_are_smoother(make_scene):
    bodies = '<geom type="plane" size="5 5 0.1" pos="0 0 -0.6"/><geom size="0.25" pos="0.3 0 0"/>'
    scene = make_scene(bodies, "", elevation=-50.0)
    one, few, many = (
        last_frame(with_exposure(scene, aperture=1e-9, exposures=count)).astype(float) for count in (1, 8, 64)
    )
    assert 0 < np.abs(few - many).mean() < 0.5 * np.abs(one - many).mean()


@pytest.mark.usefixtures("opengl")
def test_overlays_are_laid_over_the_mean(make_scene, tmp_path):
    def render(name: str, **options: Any) -> np.ndarray:
        path = tmp_path / name
        render_video(make_scene(), path, VideoOptions(size=(WIDTH, HEIGHT), fps=FPS, duration=2 / FPS, **options))
        return np.asarray(Image.open(path / "frame_00001.png")).astype(int)

    blur = {"shutter": 180.0, "exposures": 8}
    bare, clock = render("bare", **blur), render("clock", overlay=["time"], **blur)
    ink = np.abs(clock - bare).max(axis=2) > 0
    assert 0 < ink.mean() < 0.1
    away = ink & (render("still") == bare).all(axis=2)  # from what moves
    assert away.any()
    np.testing.assert_array_equal(clock[away], render("plain", overlay=["time"])[away])


@pytest.mark.usefixtures("opengl")
def test_a_blurred_video_is_resumed_to_the_same_one(make_scene, tmp_path):
    def render(name: str, progress: Progress | None = None, **options: Any) -> list[bytes]:
        blur = {"shutter": 180.0, "aperture": 0.05, "focus": "shot", "exposures": 3}
        extra = {"supersample": 2, "transparent": True, "compare": "paper", "slow_motion": 2.0}
        options = {**blur, **extra, **options}
        render_video(
            make_scene(),
            tmp_path / name,
            VideoOptions(size=(80, 40), fps=FPS, duration=0.1, **options),
            progress=progress,
        )
        return [path.read_bytes() for path in sorted((tmp_path / name).iterdir())]

    def interrupt(done: int, total: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render("broken", progress=interrupt)
    with pytest.raises(VideoError, match=r"the camera's shutter was 180\.0 and now is 90\.0"):
        render("broken", resume=True, shutter=90.0)
    whole = render("whole")
    assert len(whole) == 6
    assert len(set(whole)) > 3
    assert render("broken", resume=True) == whole


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"shutter": 400.0}, "shutter angle is 400.0; valid is 0 to 360"),
        ({"aperture": -0.1}, "aperture is -0.1; valid is 0 m or more"),
        ({"focus": 0}, "focus is 0.0; valid is more than 0 m"),
        ({"focus": "moon"}, "nothing 'moon' for the camera to focus on; its bodies are world, shot"),
        ({"focus": (1.0, 2.0)}, "focus"),
        ({"exposures": 0}, "number of exposures is 0; valid is 1 to"),
        ({"shutter": "half"}, "shutter"),
        ({"focus": 2.0}, "give the camera an aperture"),
        ({"exposures": 16}, "all 16 exposures would be the same: give the camera a shutter angle"),
    ],
)
def test_what_no_camera_can_do_is_refused(make_scene, wrong, message):
    with pytest.raises(SceneError, match=message):
        make_scene(**wrong)
