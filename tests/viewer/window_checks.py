"""Checks of the viewer's window.

A plotter makes other OpenGL contexts of its process unusable, so that
`test_window.py` runs these in processes of their own: off screen, and on a virtual screen where
Xvfb is there.
"""

import functools
import gc
import os
import re
import weakref
from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
import pytest
import pyvista
from PIL import Image

from ripple_sim.cli import main as cli
from ripple_sim.viewer import (
    BALLS,
    OPERATORS,
    SLIDERS,
    Session,
    Window,
    benchmark,
    run,
    window as viewing,
)
from ripple_sim.viewer.stage import Stage

OFF_SCREEN = "DISPLAY" not in os.environ
MIDDLE = (200, 160)  # of the sphere in the window, from the lower left [pixels]


@pytest.fixture
def closed(scene, tmp_path) -> Iterator[Window]:
    made = Window(
        Session(scene, resolution=16), size=(400, 300), off_screen=OFF_SCREEN, folder=tmp_path
    )
    yield made
    made.close()


@pytest.fixture
def window(closed) -> Window:
    closed.open()
    closed.tick()
    return closed


def press(window: Window, key: str) -> None:
    interactor = window.plotter.iren.interactor
    interactor.SetKeySym(key)
    interactor.KeyPressEvent()
    interactor.CharEvent()


def drag(window: Window, start: tuple[int, int], *places: tuple[int, int]) -> None:
    iren = window.plotter.iren
    iren._mouse_left_button_press(*start)
    for place in places:
        iren._mouse_move(*place)
    iren._mouse_left_button_release(*(places[-1] if places else start))


def difference(
    one: np.ndarray, other: np.ndarray, region: tuple[slice, slice] = np.s_[:, :]
) -> float:
    """Share of the pixels that have changed."""
    return float((np.abs(one[region].astype(int) - other[region]).max(axis=-1) > 12).mean())


def test_the_first_picture_shows_the_scene(window: Window) -> None:
    picture = window.pixels()
    assert picture.shape == (300, 400, 3)
    # the sphere is blue, the scene's colour, before a bright floor, upright
    red, _, blue = picture[300 - MIDDLE[1], MIDDLE[0]].astype(int)
    assert blue > red + 60
    assert picture[10, 200].min() > 120
    assert difference(picture, np.full_like(picture, picture[5, 200])) > 0.2


def test_a_click_pokes_what_is_under_it(window: Window) -> None:
    press(window, "c")
    window.tick()
    before = window.pixels().copy()
    drag(window, MIDDLE)
    for _ in range(3):
        assert window.tick()
    skin = window.session.skins["sphere"]
    assert skin.height.min() < -1e-3
    # blue, in the middle of the picture
    red, _, blue = window.pixels()[300 - MIDDLE[1], MIDDLE[0]].astype(int)
    assert blue > red + 40
    assert difference(before, window.pixels()) > 0.005


def test_a_click_beside_the_surface_and_a_drag_poke_nothing(window: Window) -> None:
    drag(window, (15, 150))
    drag(window, MIDDLE, (220, 165), (250, 170))
    window.tick()
    assert np.abs(window.session.skins["sphere"].height).max() < 1e-6


def test_a_drag_turns_the_camera_and_the_horizon_stays_level(window: Window) -> None:
    camera = window.plotter.camera
    before = np.array(camera.position)
    distance = camera.distance
    for height in (170, 299, 5, 299):
        drag(window, MIDDLE, (260, height), (300, height), (340, height))
        window.tick()
        assert tuple(camera.up) == (0.0, 0.0, 1.0)
        assert camera.distance == pytest.approx(distance, rel=1e-6)
        assert np.isfinite(camera.position).all()
    assert np.linalg.norm(np.array(camera.position) - before) > 0.3


def test_pause_step_and_reset_by_keys(window: Window) -> None:
    session = window.session
    press(window, "space")
    time = session.time
    window.tick()
    assert session.paused
    assert session.time == time
    assert not window.tick()  # nothing new: nothing drawn
    press(window, "N")  # with the caps lock on as well
    assert session.time == pytest.approx(time + 1 / 30)
    assert window.tick()
    press(window, "r")
    assert session.time == 0
    press(window, "space")
    window.tick()
    assert session.time > 0


def test_a_ball_is_thrown_at_the_pointer_and_seen(window: Window) -> None:
    press(window, "space")
    window.tick()
    before = window.pixels().copy()
    window.plotter.iren._mouse_move(*MIDDLE)
    press(window, "t")
    assert len(window.session.parked) == BALLS - 1
    press(window, "space")
    for _ in range(6):
        window.tick()
    assert difference(before, window.pixels()) > 0.002
    hit = []
    for _ in range(12):
        window.tick()
        hit += [
            impulse
            for impulse in window.session.simulation.impulses
            if impulse.other.startswith("thrown")
        ]
    assert hit


def test_keys_change_operator_and_colours_and_hide_the_help(window: Window) -> None:
    press(window, "space")
    for operator in (*OPERATORS[1:], OPERATORS[0]):
        press(window, "o")
        assert window.session.operator == operator
        assert f"operator {operator}" in window.status()
    window.tick()
    own = window.pixels().copy()
    press(window, "c")
    window.tick()
    heights = window.pixels().copy()
    assert np.ptp(heights[300 - MIDDLE[1], MIDDLE[0]].astype(int)) < 40  # grey: no height
    assert difference(heights, own) > 0.1
    press(window, "c")
    press(window, "h")
    window.tick()
    assert difference(own, window.pixels(), np.s_[:150, 250:]) > 0.01


def test_other_keys_do_nothing_and_one_quits(window: Window) -> None:
    for key in ("w", "e", "p", "3", "f", "j", "Escape"):
        press(window, key)
    assert not window.closed
    assert window.tick()
    press(window, "q")
    assert window.closed


def test_sliders_set_the_poke_and_the_material(window: Window) -> None:
    session = window.session
    for slider, name in zip(window._sliders, ("poke", *SLIDERS), strict=True):
        look = slider.GetRepresentation()
        # what a drag of the knob does, in the end
        look.SetValue(0.5 * look.GetMaximumValue())
        slider.InvokeEvent("EndInteractionEvent")
        wanted = pytest.approx(0.5 * look.GetMaximumValue())
        assert (session.poke_impulse if name == "poke" else session.material(name)) == wanted


def test_a_knob_can_be_dragged_without_poking_or_turning(window: Window) -> None:
    slider = window._sliders[1]
    look = slider.GetRepresentation()
    camera = tuple(window.plotter.camera.position)
    share = look.GetValue() / look.GetMaximumValue()
    left, right = (
        c.GetValue()[0] for c in (look.GetPoint1Coordinate(), look.GetPoint2Coordinate())
    )
    x = round(400 * (left + share * (right - left)))
    y = round(300 * look.GetPoint1Coordinate().GetValue()[1])
    drag(window, (x, y), (x + 10, y), (x + 25, y))
    window.tick()
    assert window.session.material("speed") > 0.55
    assert tuple(window.plotter.camera.position) == camera
    assert np.abs(window.session.skins["sphere"].height).max() < 1e-6


def test_screenshots_and_recordings_are_of_the_frames(window: Window, tmp_path: Path) -> None:
    press(window, "s")
    picture = np.asarray(Image.open(tmp_path / "sphere-1.png"))
    assert picture.shape == (300, 400, 3)
    assert difference(picture, window.pixels()) < 0.05
    assert "sphere-1.png" in window.message
    press(window, "v")
    assert "recording" in window.status()
    for _ in range(8):
        window.tick()
    press(window, "v")
    with av.open(tmp_path / "sphere-1.mp4") as container:
        [stream] = container.streams.video
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert (stream.width, stream.height, float(stream.average_rate)) == (400, 300, 30)
    assert len(frames) == 8
    assert difference(frames[-1], window.pixels()) < 0.05


def test_a_recording_ends_with_the_window(closed: Window, tmp_path: Path) -> None:
    closed.open()
    closed.tick()
    closed.record()
    closed.tick()
    closed.close()
    assert (tmp_path / "sphere-1.mp4").stat().st_size > 0
    assert [path.name for path in tmp_path.iterdir()] == ["sphere-1.mp4"]


def test_a_window_that_is_dropped_is_closed_and_nothing_keeps_it(scene, tmp_path: Path) -> None:
    window = Window(
        Session(scene, resolution=8), size=(64, 48), off_screen=OFF_SCREEN, folder=tmp_path
    )
    window.open()
    window.tick()
    kept = {
        type(each): weakref.ref(each)
        for each in (window, window.plotter, window.stage, window.session)
    }
    del window
    gc.collect()
    assert [kind for kind, each in kept.items() if each() is not None] == []


def test_an_unwritable_folder_is_reported_and_the_window_stays_open(window: Window) -> None:
    window.recorder.folder = Path("/proc/nowhere")
    press(window, "s")
    assert "cannot write /proc/nowhere/sphere-1.png" in window.message
    press(window, "v")
    assert "cannot write" in window.message
    assert window.tick()


@pytest.mark.skipif(OFF_SCREEN, reason="needs a screen")
def test_the_loop_runs_until_the_user_quits(
    closed: Window, monkeypatch: pytest.MonkeyPatch
) -> None:
    ticks = []

    def tick() -> bool:
        ticks.append(Window.tick(closed))
        if len(ticks) == 4:
            press(closed, "q")
        return ticks[-1]

    monkeypatch.setattr(closed, "tick", tick)
    run(closed)
    assert ticks == [True] * 4
    assert closed.session.time == pytest.approx(4 / 30)


def test_shadows_darken_as_bodies_come_down_on_a_level_floor_alone(window: Window) -> None:
    session = window.session
    model = session.simulation.model
    data = session.simulation.data
    ball = model.geom("ball").id
    shadow = window.stage.shadows._actors[ball]
    darkness = []
    for height in (1.5, 0.3, 0.07):
        data.geom_xpos[ball] = 1.0, 0.5, height
        window.stage.shadows.update()
        darkness.append(shadow.prop.opacity if shadow.GetVisibility() else 0.0)
    assert 0 == darkness[0] < darkness[1] < darkness[2]
    np.testing.assert_allclose(shadow.GetCenter(), [1.0, 0.5, 0.0], atol=2e-3)
    data.geom_xmat[model.geom("floor").id, 8] = 0.9
    assert Stage(pyvista.Plotter(off_screen=True), session).shadows is None


@pytest.mark.skipif(not OFF_SCREEN, reason="has a window of its own, without a display")
def test_the_benchmark_reports_and_closes(capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewing, "benchmark", functools.partial(benchmark, updates=3, tries=1))
    assert (
        cli.main(["view", "sphere", "--benchmark", "--resolution", "8", "--size", "160x120"]) == 0
    )
    out, err = capsys.readouterr()
    assert err == ""
    times = r"simulation [0-9.]+ ms, drawing [0-9.]+ ms; [0-9.]+ ms of processor time"
    assert re.fullmatch(rf"[0-9.]+ updates/s: {times} \(.+\)\n", out)
