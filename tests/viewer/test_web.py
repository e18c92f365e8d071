"""The viewer's page in a headless browser: the surface moves; pause and reset work."""

import io
import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image

for name in ("trame", "trame_vtk"):
    pytest.importorskip(name)
from chromium import PATIENCE, launched  # noqa: E402

Page = Any  # playwright's
MIDDLE = (200, 130)  # of the sphere in the picture [pixels]


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Address of a page that shows the scene "sphere"."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        number = probe.getsockname()[1]
    words = (
        f"-m ripple_sim view sphere --web --port {number} --size 400x300 --resolution 16".split()
    )
    env = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    server = subprocess.Popen([sys.executable, *words], env=env, **streams)
    try:
        line = server.stdout.readline()
        assert line.startswith(f"http://127.0.0.1:{number}/?secret=")
        yield line.split()[0]
    finally:
        server.terminate()
        server.wait(PATIENCE)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with launched("--disable-gpu") as made:
        yield made


@pytest.fixture
def port(address: str) -> int:
    return urlsplit(address).port


def opened(browser: Any, address: str) -> Page:
    page = browser.new_page(viewport={"width": 500, "height": 500})
    page.set_default_timeout(1000 * PATIENCE)  # [ms]
    page.goto(address)
    return page


@pytest.fixture
def page(browser: Any, address: str) -> Iterator[Page]:
    page = opened(browser, address)
    wait_for(lambda: colors(page) > 50)  # the first picture has come
    yield page
    page.close()


def wait_for(done: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.05)


def seconds(page: Page) -> float:
    """Simulated time that the page shows."""
    found = re.match(r"([0-9.]+) s", page.inner_text("#status"))
    return float(found[1]) if found else -1.0


def stands(page: Page) -> bool:
    """Whether the time that the page shows is the same for half a second."""
    before = seconds(page)
    time.sleep(0.5)
    return seconds(page) == before


def picture(page: Page) -> np.ndarray:
    box = page.locator("#picture").bounding_box()
    return np.asarray(Image.open(io.BytesIO(page.screenshot(clip=box))).convert("RGB")).astype(int)


def colors(page: Page) -> int:
    return len(np.unique(picture(page).reshape(-1, 3), axis=0))


def blueness(page: Page) -> int:
    """How much bluer than red the middle of the sphere is: pressed in."""
    red, _, blue = picture(page)[MIDDLE[1], MIDDLE[0]]
    return int(blue - red)


def test_the_run_waits_for_the_first_browser_and_the_page_has_the_scenes_name(
    browser: Any, address: str
) -> None:
    """The first balls had fallen before anybody saw them.

    This test comes first: later pages join a run.
    """
    time.sleep(1.0)
    begun = time.monotonic()
    page = opened(browser, address)
    wait_for(lambda: seconds(page) >= 0)
    assert seconds(page) < time.monotonic() - begun + 0.1
    assert page.title() == "sphere - ripple-sim"
    page.close()


def test_pause_holds_the_time_and_reset_sets_it_back(page: Page) -> None:
    page.click("#pause")
    wait_for(lambda: "paused" in page.inner_text("#status"))
    wait_for(lambda: stands(page))  # once what was on its way has arrived
    held = seconds(page)
    assert stands(page) and seconds(page) == held
    page.click("#step")
    wait_for(lambda: seconds(page) > held)
    page.click("#reset")
    wait_for(lambda: seconds(page) == 0)
    page.keyboard.press("Space")  # keys work as well
    wait_for(lambda: seconds(page) > 0.1)


def test_the_surface_moves_after_a_poke(page: Page) -> None:
    # pause, then reset: the other way round a slow machine lets balls fall before the pause arrives
    if "paused" not in page.inner_text("#status"):
        page.click("#pause")
    wait_for(lambda: "paused" in page.inner_text("#status"))
    page.click("#reset")
    wait_for(lambda: seconds(page) == 0)
    assert blueness(page) > 60  # the scene's own colour
    page.click("#colors")
    wait_for(lambda: blueness(page) < 30)  # pictures come after the numbers
    before = picture(page)
    box = page.locator("#picture").bounding_box()
    page.mouse.click(box["x"] + MIDDLE[0], box["y"] + MIDDLE[1])
    for _ in range(3):
        held = seconds(page)
        page.click("#step")
        wait_for(lambda held=held: seconds(page) > held)
    wait_for(lambda: blueness(page) > 40)
    wait_for(lambda: (np.abs(picture(page) - before).max(axis=-1) > 30).mean() > 0.003)
    page.click("#pause")


def test_operator_and_colours_can_be_changed(page: Page) -> None:
    page.click("#operator")
    wait_for(lambda: "operator uncorrected" in page.inner_text("#status"))
    page.click("#colors")
    wait_for(lambda: blueness(page) > 60)  # the scene's own colour
    page.click("#colors")
    wait_for(lambda: blueness(page) < 60)


def test_the_picture_fits_into_a_low_window(page: Page) -> None:
    page.set_viewport_size({"width": 500, "height": 300})
    box = page.locator("#status").bounding_box()
    assert box["y"] + box["height"] <= 300
    page.set_viewport_size({"width": 500, "height": 500})
    wait_for(lambda: page.locator("#picture").bounding_box()["height"] == 300)


def test_a_drag_turns_the_camera(page: Page) -> None:
    page.click("#reset")
    before = picture(page)
    box = page.locator("#picture").bounding_box()
    x = box["x"] + 60
    y = box["y"] + 60
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(8):
        page.mouse.move(x + 5 * step, y - 12 * step)
    page.mouse.up()
    # the horizon comes into view, or goes
    wait_for(lambda: (np.abs(picture(page) - before).max(axis=-1) > 12).mean() > 0.05)


def test_the_page_is_served_on_the_loopback_address_alone(port: int) -> None:
    connections = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()]
    addresses = {fields[1] for fields in connections if fields[3] == "0A"}  # those that listen
    assert f"0100007F:{port:04X}" in addresses
    assert f"00000000:{port:04X}" not in addresses


def test_quit_ends_the_program(page: Page, port: int) -> None:
    page.click("#quit")

    def closed() -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", port)) != 0

    wait_for(closed)
