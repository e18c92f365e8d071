"""The viewer's window, off screen and on a virtual screen; each in a process of its own."""

import os
import select
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

CHECKS = Path(__file__).with_name("window_checks.py")


@pytest.fixture
def screen() -> Iterator[str]:
    """Name of a display on a virtual screen."""
    if shutil.which("Xvfb") is None:
        pytest.skip("needs Xvfb (on Debian and Ubuntu: apt-get install xvfb)")
    reading, writing = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writing), "-screen", "0", "800x600x24", "-nolisten", "tcp"],
        pass_fds=[writing],
        stderr=subprocess.DEVNULL,
    )
    os.close(writing)
    try:
        assert select.select([reading], [], [], 20)[0], "Xvfb does not start"
        yield f":{os.read(reading, 16).decode().strip()}"
    finally:
        os.close(reading)
        server.terminate()
        server.wait()


def check(display: str | None, *options: str) -> None:
    # off screen some of them are skipped, in CI too
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "CI")}
    if display is not None:
        environment["DISPLAY"] = display
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(CHECKS), *options],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr


def test_off_screen() -> None:
    check(None)


def test_on_a_screen(screen: str) -> None:
    check(screen, "-k", "click or drag or key or knob or loop")  # what comes from its events
