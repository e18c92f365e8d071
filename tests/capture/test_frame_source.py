"""Motion blur and depth of field: streaks as long and discs as wide as a camera's, and no light lost."""

from typing import Any

import numpy as np
import pytest
from exposed_scene import DISTANCE, FOVY, FPS, HEIGHT, SPEED, WIDTH, linear
from PIL import Image

from ripple_sim.capture.frame_source import FrameSource
from ripple_sim.capture.snapshot import snapshots
from ripple_sim.errors import SceneError, VideoError
from ripple_sim.scene.scene import Scene, with_exposure
from ripple_sim.simulation import Simulation
from ripple_sim.video.options import VideoOptions
from ripple_sim.video.render_video import Progress, render_video

FOCAL_PIXELS = HEIGHT / 2 / np.tan(np.radians(FOVY) / 2)


def bead(depth: float, alpha: float = 1.0) -> str:
    """A body beside the target, at a distance [m] from the camera."""
    return f'<geom pos="{depth - DISTANCE} {-0.35 * depth} 0" size="{0.03 * depth}" rgba="0.9 0.9 0.9 {alpha}"/>'


def last_frame(scene: Scene, frames: int = 1, **options: Any) -> np.ndarray:
    simulation = Simulation(scene, fps=FPS, backend="cpu")
    source = FrameSource(simulation, width=WIDTH, height=HEIGHT, **options)
    pictures = [picture for state in snapshots(simulation, frames) if (picture := source.render(state)) is not None]
    assert len(pictures) == frames
    return pictures[-1]


def blot(scene: Scene, part: tuple[slice, slice], frames: int = 1) -> tuple[float, np.ndarray]:
    """Area [pixels] of what covers a part of the picture, and its variance along x and y [pixels^2]."""
    alpha = last_frame(scene, frames, transparent=True)[part][..., 3] / 255
    at = np.indices(alpha.shape)[::-1]
    mean = (alpha * at).sum(axis=(1, 2), keepdims=True) / alpha.sum()
    return float(alpha.sum()), (alpha * (at - mean) ** 2).sum(axis=(1, 2)) / alpha.sum()


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
