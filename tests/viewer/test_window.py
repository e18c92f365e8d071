"""The viewer's window, off screen and on a virtual screen; each in a process of its own.

Clicks are told from drags, and every control has a method, a key of its own and a line of help.
"""

import os
import select
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from ripple_sim.errors import DisplayError
from ripple_sim.viewer.canvas import CONTROLS, MOUSE, help_text
from ripple_sim.viewer.session import OPERATORS
from ripple_sim.viewer.window import Actions, check_display, display_problem

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


def test_every_control_is_a_method_with_a_key_and_a_line_of_help() -> None:
    assert len({control.key for control in CONTROLS}) == len(CONTROLS)
    for control in CONTROLS:
        assert callable(getattr(Actions, control.action))
    lines = help_text().splitlines()
    assert len(lines) == len(MOUSE) + len(CONTROLS)
    assert all(f"{control.key}: {control.label}" in lines for control in CONTROLS)


def test_operators_follow_one_another_round() -> None:
    session = SimpleNamespace(operator=OPERATORS[0], paused=False)
    session.set_operator = lambda name: setattr(session, "operator", name)
    actions = Actions(SimpleNamespace(session=session, say=lambda message: None), SimpleNamespace())
    chosen = []
    for _ in range(len(OPERATORS) + 1):
        chosen.append(session.operator)
        actions.operator()
    assert chosen == [*OPERATORS, OPERATORS[0]]
    actions.pause()
    assert session.paused
    actions.pause()
    assert not session.paused


def test_without_a_display_the_alternatives_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("DISPLAY", "")
    assert display_problem() == "the environment variable DISPLAY is not set"
    with pytest.raises(DisplayError, match=r"DISPLAY is not set; add --web .*ripple-sim render"):
        check_display()
    monkeypatch.setattr("sys.platform", "darwin")
    check_display()
