"""Mouse, touch and keys on a page: pokes, the camera, full screen, and the size of a phone."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mujoco_models import forwarded
from pages import opened

from ripple_sim import Exporter, Material, Ripples, Scene

PHONE = (360, 640)

# of a part of the egg, in the frame of its geom [m]: where the pointer pokes it
LOG_POKES = """ripplePlayer.ready.then(player => {
    player.playing = false;
    window.pokes = [];
    const poke = player.poke;
    player.poke = (hit, strength) => {
        window.pokes.push([...hit.point, strength]);
        poke.call(player, hit, strength);
    };
})"""


@pytest.fixture(scope="module")
def egg_page(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("gestures") / "run.html"
    material = Material(speed=0.5, density=900.0, damping=1.0)
    ripples = Ripples(scene.model, {"egg": material}, resolution=12, backend="cpu")
    with Exporter(scene.model, ripples, path, fps=60, size=(320, 180)) as exporter:
        exporter.write(forwarded(scene.model))
    return path


@pytest.fixture
def phone(browser: Any, egg_page: Path) -> Iterator[Any]:
    with opened(browser, egg_page, PHONE, has_touch=True, device_scale_factor=3) as tab:
        tab.evaluate(LOG_POKES)
        yield tab


class Fingers:
    """Touches of a screen, as the browser gets them from one."""

    def __init__(self, tab: Any) -> None:
        self._tab = tab
        self._session = tab.context.new_cdp_session(tab)

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        touches = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touches})


def egg_row(tab: Any) -> tuple[list[float], float]:
    """Columns and the row of pixels that lie on the egg, through its middle as it is seen."""
    rows = tab.evaluate("""(() => {
        const {width, height} = ripplePlayer.player.canvas.getBoundingClientRect();
        const rows = [];
        for (let y = 20; y < height; y += 20) {
            const columns = [];
            for (let x = 4; x < width; x += 8)
                if (ripplePlayer.player.pick(2 * x / width - 1, 1 - 2 * y / height))
                    columns.push(x);
            rows.push([columns, y]);
        }
        return rows;
    })()""")
    return max(rows, key=lambda row: len(row[0]))


def test_a_drag_over_the_surface_pokes_it_all_along(phone: Any) -> None:
    columns, y = egg_row(phone)
    fingers = Fingers(phone)
    fingers.touch("touchStart", (columns[1], y))
    for share in np.linspace(0.2, 1, 5):
        fingers.touch("touchMove", (columns[1] + share * (columns[-2] - columns[1]), y))
        before = phone.evaluate("pokes.length")
        phone.wait_for_function(f"pokes.length > {before}")
    fingers.touch("touchEnd")
    phone.evaluate("window.count = pokes.length")
    *places, strengths = np.array(phone.evaluate("pokes")).T
    moved = np.linalg.norm(np.diff(places, axis=1), axis=0)
    assert (moved > 0.01).sum() >= 4
    assert strengths[0] > 2 * strengths[1:].max() > 0  # the first is a click
    assert phone.evaluate("ripplePlayer.player.orbit") is None  # the camera stays
    # the finger has left
    phone.evaluate("ripplePlayer.player.show(0)")
    assert phone.evaluate("pokes.length - count") == 0


def test_two_fingers_zoom_and_shift_and_one_beside_the_surface_turns(phone: Any) -> None:
    columns, _ = egg_row(phone)
    left = columns[0] / 2
    fingers = Fingers(phone)
    distance = phone.evaluate("ripplePlayer.player.view(1).distance")
    fingers.touch("touchStart", (left, 40))
    fingers.touch("touchStart", (left, 40), (left + 100, 40))
    fingers.touch("touchMove", (left, 40), (left + 200, 40))
    fingers.touch("touchEnd")
    orbit = phone.evaluate("ripplePlayer.player.orbit")
    assert orbit["distance"] == pytest.approx(distance / 2, rel=0.02)
    fingers.touch("touchStart", (left, 40), (left + 100, 40))
    fingers.touch("touchMove", (left + 50, 40), (left + 150, 40))
    fingers.touch("touchEnd")
    shifted = phone.evaluate("ripplePlayer.player.orbit")
    assert shifted["distance"] == pytest.approx(orbit["distance"], rel=0.02)
    assert np.linalg.norm(np.subtract(shifted["focus"], orbit["focus"])) > 0.05 * distance / 2
    assert shifted["azimuth"] == orbit["azimuth"]
    fingers.touch("touchStart", (left, 40))
    fingers.touch("touchMove", (left + 30, 40))
    fingers.touch("touchEnd")
    assert phone.evaluate("ripplePlayer.player.orbit.azimuth") != orbit["azimuth"]
    assert phone.evaluate("pokes.length") == 0


def test_a_second_finger_ends_a_poke(phone: Any) -> None:
    columns, y = egg_row(phone)
    fingers = Fingers(phone)
    middle = columns[len(columns) // 2]
    fingers.touch("touchStart", (middle, y))
    fingers.touch("touchStart", (middle, y), (middle + 60, y))
    count = phone.evaluate("pokes.length")
    assert count >= 1  # while the first was alone
    distance = phone.evaluate("ripplePlayer.player.view(1).distance")
    fingers.touch("touchMove", (middle, y), (middle + 120, y))
    fingers.touch("touchEnd")
    assert phone.evaluate("ripplePlayer.player.orbit.distance") < distance
    assert phone.evaluate("pokes.length") == count


def test_every_control_is_in_reach_on_a_phone(phone: Any) -> None:
    phone.tap("#tune")
    faults = phone.evaluate("""(() => {
        const faults = [];
        for (const control of document.querySelectorAll("button, input, select")) {
            if (!control.checkVisibility()) continue;
            control.scrollIntoView();
            const {left, right, top, bottom} = control.getBoundingClientRect();
            if (left < 0 || right > innerWidth || top < 0 || bottom > innerHeight)
                faults.push(`${control.id} is not in view`);
            const named = control.ariaLabel || control.textContent || control.closest("label");
            if (!named) faults.push(`${control.id} has no name`);
        }
        return faults;
    })()""")
    assert faults == []


def test_the_page_fills_the_screen(browser: Any, egg_page: Path) -> None:
    with opened(browser, egg_page) as tab:
        tab.evaluate("ripplePlayer.ready")
        tab.keyboard.press("f")
        tab.wait_for_function("document.fullscreenElement")
        tab.keyboard.press("f")
        tab.wait_for_function("!document.fullscreenElement")


def test_a_picture_that_stands_still_is_lit_pixel_by_pixel(browser: Any, egg_page: Path) -> None:
    """In software, points are lit while something moves."""
    with opened(browser, egg_page) as tab:
        tab.evaluate("ripplePlayer.ready.then(() => 0)")
        tab.wait_for_function("ripplePlayer.player.drawing.fine")  # flat waves rest
        tab.evaluate("ripplePlayer.player.poke(ripplePlayer.player.pick(0, 0.2), 1)")
        tab.wait_for_function("!ripplePlayer.player.drawing.fine")
        tab.keyboard.press("Space")
        assert tab.evaluate("ripplePlayer.player.drawing.fine")


def test_pixels_that_were_given_up_come_back(browser: Any, egg_page: Path) -> None:
    """A browser that is busy for a while shows fewer pixels, and tries more of them again."""
    with opened(browser, egg_page) as tab:
        shares = tab.evaluate("""ripplePlayer.ready.then(player => {
            const detail = new player.detail.constructor();
            const play = (seconds, elapsed) => {
                for (let time = 0; time < seconds; time += elapsed / 1000) detail.add(elapsed, 33);
                return detail.share;
            };
            return [play(3, 33), play(10, 66), play(60, 33)];
        })""")
    first, busy, last = shares
    assert (first, last) == (1, 1)
    assert 0.4 < busy < 0.6
