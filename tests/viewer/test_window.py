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
from ripple_sim.viewer.canvas import CONTROLS, MOUSE, add_sliders, help_text
from ripple_sim.viewer.session import OPERATORS, SLIDERS
from ripple_sim.viewer.window import Actions, Input, check_display, display_problem

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


class Interactor:
    """The part of a plotter's window that sends events: here the test does."""

    def __init__(self) -> None:
        self.at, self.key = (0, 0), ""
        self.observers: dict = {}
        self.interactor = SimpleNamespace(GetKeySym=lambda: self.key)
        self.style = SimpleNamespace(AddObserver=lambda event, call: None)

    def clear_key_event_callbacks(self) -> None:
        pass

    def add_observer(self, event: str, call: object) -> None:
        self.observers[event] = call

    def get_event_position(self) -> tuple[int, int]:
        return self.at

    def send(self, event: str, at: tuple[int, int] = (0, 0), key: str = "") -> None:
        self.at, self.key = at, key
        self.observers[event](None, event)


@pytest.fixture
def seen() -> SimpleNamespace:
    iren = Interactor()
    pointer = Input(SimpleNamespace(iren=iren))
    found = SimpleNamespace(iren=iren, pointer=pointer, keys=[], clicks=[])
    pointer.observe(found.keys.append, lambda x, y: found.clicks.append((x, y)))
    return found


@pytest.mark.parametrize(
    ("released", "click"),
    [((50, 60), True), ((54, 56), True), ((55, 60), False), ((50, 65), False), ((45, 60), False)],
)
def test_a_click_may_move_by_four_pixels_and_no_more(
    seen: SimpleNamespace, released: tuple[int, int], click: bool
) -> None:
    seen.iren.send("LeftButtonPressEvent", (50, 60))
    seen.iren.send("LeftButtonReleaseEvent", released)
    assert seen.clicks == ([released] if click else [])


def test_a_release_without_a_press_is_no_click(seen: SimpleNamespace) -> None:
    seen.iren.send("LeftButtonReleaseEvent", (0, 0))
    seen.iren.send("LeftButtonPressEvent", (9, 9))
    seen.iren.send("LeftButtonReleaseEvent", (9, 9))
    seen.iren.send("LeftButtonReleaseEvent", (9, 9))
    assert seen.clicks == [(9, 9)]


def test_keys_come_by_name_and_the_pointer_has_a_place_once_it_was_there(seen: SimpleNamespace) -> None:
    assert seen.pointer.place() is None
    for key in ("space", "q"):
        seen.iren.send("KeyPressEvent", (3, 4), key)
    assert seen.keys == ["space", "q"]
    assert seen.pointer.place() == (3, 4)


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


class Knob:
    """A slider's knob that the test moves."""

    def __init__(self) -> None:
        self.value, self.released = 0.0, lambda *_: None

    def GetRepresentation(self) -> "Knob":  # noqa: N802
        return self

    def GetValue(self) -> float:  # noqa: N802
        return self.value

    def AddObserver(self, event: str, call: object) -> None:  # noqa: N802
        assert event == "EndInteractionEvent"
        self.released = call

    def __getattr__(self, name: str) -> object:
        return lambda *_: SimpleNamespace(SetColor=lambda *_: None)


def test_each_slider_sets_its_own_value_when_it_is_released() -> None:
    set_to: dict[str, float] = {}
    start = {"speed": 3.0, "damping": 0.0, "stiffness": 6.0}
    session = SimpleNamespace(poke_impulse=0.5, material=start.get, set_material=lambda **one: set_to.update(one))
    ranges, titles = [], []

    def add(call: object, limits: tuple[float, float], *, value: float, title: str, **look: object) -> Knob:
        ranges.append((*limits, value))
        titles.append(title)
        return Knob()

    knobs = add_sliders(SimpleNamespace(add_slider_widget=add), session)
    assert ranges == [(0, 1.5, 0.5), (0, 9, 3), (0, 1, 0), (0, 18, 6)]
    assert titles == ["poke [N s]", *(f"{name} [{unit}]" for name, unit in SLIDERS.items())]
    for number, knob in enumerate(knobs):
        knob.value = 10.0 + number
        knob.released()
    assert session.poke_impulse == 10.0
    assert set_to == {"speed": 11.0, "damping": 12.0, "stiffness": 13.0}


def test_without_a_display_the_alternatives_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("DISPLAY", "")
    assert display_problem() == "the environment variable DISPLAY is not set"
    with pytest.raises(DisplayError, match=r"DISPLAY is not set; add --web .*ripple-sim render"):
        check_display()
    monkeypatch.setattr("sys.platform", "darwin")
    check_display()
