"""Screenshots and videos are numbered and whole or absent; the camera stays level."""

from pathlib import Path
from types import SimpleNamespace

import av
import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from ripple_sim.errors import EncodingError, VideoError
from ripple_sim.viewer import Recorder, level
from ripple_sim.viewer.controls import ray


def frame(level: int, height: int = 32, width: int = 48) -> np.ndarray:
    return np.full((height, width, 3), level, np.uint8)


@pytest.fixture
def recorder(tmp_path: Path) -> Recorder:
    return Recorder(tmp_path, "duck", 30)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_screenshots_take_the_next_free_number_and_keep_every_pixel(
    recorder: Recorder, tmp_path: Path
) -> None:
    (tmp_path / "duck-2.png").write_text("mine")
    noise = np.random.default_rng(0).integers(0, 256, (33, 47, 3), np.uint8)
    assert [recorder.save(noise).name for _ in range(2)] == ["duck-1.png", "duck-3.png"]
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "duck-1.png")), noise)
    assert (tmp_path / "duck-2.png").read_text() == "mine"


def test_a_screenshot_that_cannot_be_written_is_one_line_and_leaves_nothing(
    tmp_path: Path, monkeypatch
) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(VideoError, match=r"cannot write .*duck-1\.png: File exists"):
        Recorder(tmp_path / "file", "duck", 30).save(frame(0))

    def half(self, path, **options):
        Path(path).write_bytes(b"\x89PNG")
        raise KeyboardInterrupt

    monkeypatch.setattr(Image.Image, "save", half)
    with pytest.raises(KeyboardInterrupt):
        Recorder(tmp_path, "duck", 30).save(frame(0))
    assert names(tmp_path) == ["file"]


@pytest.mark.parametrize("size", [(32, 48), (33, 47), (33, 48)])
def test_a_video_has_the_frames_at_its_rate_without_an_odd_row_or_column(recorder, tmp_path, size):
    path = recorder.start(frame(0, *size))
    assert recorder.recording
    levels = [40, 120, 200]
    assert all(recorder.add(frame(level, *size)) for level in levels)
    assert recorder.stop() == path == tmp_path / "duck-1.mp4"
    assert not recorder.recording
    with av.open(str(path)) as container:
        assert container.streams.video[0].average_rate == 30
        images = [image.to_ndarray(format="rgb24") for image in container.decode(video=0)]
    assert {image.shape for image in images} == {(32, size[1] // 2 * 2, 3)}
    # codes of 255; the codec rounds colours
    np.testing.assert_allclose([image.mean() for image in images], levels, atol=3)


def test_a_window_of_another_size_ends_the_video_with_what_it_has(
    recorder: Recorder, tmp_path: Path
) -> None:
    recorder.start(frame(0))
    assert recorder.add(frame(10))
    assert not recorder.add(frame(10, 64, 64))
    assert not recorder.recording
    assert names(tmp_path) == ["duck-1.mp4"]
    recorder.start(frame(0, 64, 64))
    recorder.add(frame(10, 64, 64))
    assert recorder.stop() == tmp_path / "duck-2.mp4"


def test_a_video_without_frames_leaves_nothing(recorder: Recorder, tmp_path: Path) -> None:
    recorder.start(frame(0))
    assert recorder.stop() is recorder.stop() is None
    assert not recorder.add(frame(0))
    assert names(tmp_path) == []


def test_a_window_too_small_for_a_video_is_refused_and_nothing_records(
    recorder: Recorder, tmp_path: Path
) -> None:
    with pytest.raises(VideoError, match=r"must be 16 .*, got 14x14"):
        recorder.start(frame(0, 15, 15))
    assert not recorder.recording
    assert names(tmp_path) == []


def test_a_failure_to_write_ends_the_recording(recorder: Recorder, tmp_path: Path) -> None:
    recorder.start(frame(0))
    recorder.add(frame(0))
    (tmp_path / "duck-1.mp4").mkdir()  # in the way of the finished file
    (tmp_path / "duck-1.mp4" / "mine").touch()
    with pytest.raises(EncodingError, match=r"cannot write the video .*duck-1\.mp4"):
        recorder.stop()
    assert not recorder.recording
    assert (names(tmp_path), names(tmp_path / "duck-1.mp4")) == (["duck-1.mp4"], ["mine"])


FOCUS = np.array([0.3, -0.1, 0.5])


def camera(offset: list[float], up: tuple[float, float, float] = (0.3, 0.2, 0.9)) -> pv.Camera:
    made = pv.Camera()
    made.focal_point = FOCUS
    made.position = FOCUS + offset
    made.up = up
    return made


def elevation(made: pv.Camera) -> float:
    x, y, z = np.array(made.position) - FOCUS
    return float(np.degrees(np.arctan2(z, np.hypot(x, y))))


@pytest.mark.parametrize("offset", [[1, 2, 0.5], [-3, 0, -4], [0, 1, 20]])
def test_a_camera_that_is_not_steep_stays_where_it_is_and_is_made_level(
    offset: list[float],
) -> None:
    made = camera(offset)
    level(made)
    np.testing.assert_allclose(made.position, FOCUS + offset)
    assert tuple(made.up) == (0, 0, 1)


@pytest.mark.parametrize("offset", [[0.01, 0.02, 5], [-1e-9, 0, -3], [0.1, 0, 20]])
def test_a_steep_camera_keeps_its_distance_and_direction_at_88_degrees(offset: list[float]) -> None:
    made = camera(offset)
    level(made)
    assert abs(elevation(made)) == pytest.approx(88.0)
    assert np.sign(elevation(made)) == np.sign(offset[2])
    away = np.array(made.position) - FOCUS
    assert np.linalg.norm(away) == pytest.approx(np.linalg.norm(offset))
    np.testing.assert_allclose(
        away[:2] / np.hypot(*away[:2]), np.array(offset[:2]) / np.hypot(*offset[:2]), atol=1e-6
    )
    before = made.position
    level(made)
    np.testing.assert_allclose(made.position, before)  # again: nothing


@pytest.mark.parametrize("height", [4.0, -4.0])
def test_a_camera_straight_above_or_below_keeps_its_up_direction(height: float) -> None:
    made = camera([0, 0, height], up=(0.6, 0.8, 0.0))
    level(made)
    assert elevation(made) == pytest.approx(np.copysign(88.0, height))
    away = np.array(made.position) - FOCUS
    assert np.linalg.norm(away) == pytest.approx(4.0)
    right = np.cross(-away, [0, 0, 1])
    expected = np.cross([0, 0, -np.sign(height)], [0.6, 0.8, 0])
    np.testing.assert_allclose(right / np.linalg.norm(right), expected, atol=1e-9)


def test_a_camera_straight_above_without_any_heading_looks_along_y() -> None:
    made = camera([0, 0, 2.0], up=(0, 0, 1))
    level(made)
    assert elevation(made) == pytest.approx(88.0)
    assert made.position[1] < FOCUS[1]


@pytest.mark.parametrize("parallel", [False, True])
def test_rays_through_a_pixel_start_at_the_eye_or_beside_it_where_they_are_parallel(
    parallel: bool,
) -> None:
    eye = np.array([0.0, -3.0, 1.0])
    direction = np.array([0.0, 1.0, 0.0])
    point = np.array([0.5, 2.0, 1.5])
    renderer = SimpleNamespace(
        SetDisplayPoint=lambda *place: None,
        DisplayToWorld=lambda: None,
        GetWorldPoint=lambda: [*(2 * point), 2.0],
        camera=SimpleNamespace(position=eye, direction=direction, parallel_projection=parallel),
    )
    start, along = ray(renderer, 10, 20)
    np.testing.assert_allclose(start, [0.5, -3.0, 1.5] if parallel else eye)
    np.testing.assert_allclose(
        along, direction if parallel else (point - eye) / np.linalg.norm(point - eye)
    )
