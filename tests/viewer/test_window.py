"""The viewer's window in its own process, and `ripple-sim view`, with and without display."""

import ctypes
import os
import re
import socket
from pathlib import Path

import pytest
from programs import ended

from ripple_sim.cli import main as cli
from ripple_sim.errors import DisplayError
from ripple_sim.viewer import CONTROLS, MOUSE, Window, check_display, display_problem, help_text

CHECKS = Path(__file__).with_name("window_checks.py")


def check(display: str | None, *options: str) -> None:
    # off screen some of them are skipped, in CI too
    environment = {
        name: value for name, value in os.environ.items() if name not in ("DISPLAY", "CI")
    }
    if display is not None:
        environment["DISPLAY"] = display
    result = ended(
        "-m", "pytest", "-q", "-p", "no:cacheprovider", CHECKS, *options, env=environment
    )
    assert result.returncode == 0, result.stdout + result.stderr


def test_window_checks_pass_off_screen() -> None:
    check(None)


def test_checks_pass_on_a_screen(screen: str) -> None:
    # a kind of its events each
    check(screen, "-k", "click_pokes or drag_turns or one_quits or knob or loop")


def test_every_control_is_a_method_with_a_key_and_a_line_of_help() -> None:
    assert len({key for key, *_ in CONTROLS}) == len(CONTROLS)
    for _, action, _ in CONTROLS:
        assert callable(getattr(Window, action))
    lines = help_text().splitlines()
    assert len(lines) == len(MOUSE) + len(CONTROLS)
    assert all(f"{key}: {label}" in lines for key, _, label in CONTROLS)


def test_without_a_display_the_alternatives_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("DISPLAY", "")
    assert display_problem() == "the environment variable DISPLAY is not set"
    with pytest.raises(
        DisplayError, match=r"DISPLAY is not set; leave out --window .*ripple-sim render"
    ):
        check_display()
    monkeypatch.setattr("sys.platform", "darwin")
    check_display()


@pytest.fixture(autouse=True)
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)


def complaint(capsys: pytest.CaptureFixture[str], status: int, *argv: str) -> str:
    assert cli.main(["view", *argv]) == status
    out, err = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(r"ripple-sim: [^\n]+\n", err)
    return err


def test_the_help_lists_every_key_and_what_the_mouse_does(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert cli.main(["view", "--help"]) == 0
    text = re.sub(r"[\s│]+", " ", capsys.readouterr().out)
    for key, *_ in CONTROLS:
        assert re.search(rf"\b{key.capitalize()}: ", text), key
    for does in ("poke", "orbit", "pan", "zoom"):
        assert does in text
    assert "--benchmark" in text


def test_a_display_without_a_server_is_named(capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":4242")
    assert "no X server at DISPLAY=:4242" in complaint(capsys, 1, "sphere", "--window")


def test_a_missing_x11_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise OSError(name)

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(ctypes, "CDLL", missing)
    with pytest.raises(DisplayError, match=r"libX11.so.6 is missing .*apt-get install libx11-6"):
        check_display()


@pytest.mark.parametrize(
    ("argv", "named"),
    [
        ([], "SCENE"),
        (["sphere", "--size", "wide"], "'wide'"),
        (["sphere", "--resolution", "0"], "--resolution.*'0'"),
        (["sphere", "--bodies", "-1"], "--bodies"),
        (["sphere", "--port", "http"], "--port.*'http'"),
        (["sphere", "--size", "0x0"], "must be 16 to 8192 .*, got 0x0"),
        (
            ["sphere", "--benchmark", "--size", "999999x999999"],
            "must be 16 to 8192 .*, got 999999x999999",
        ),
    ],
)
def test_wrong_arguments_are_bad_input(
    capsys: pytest.CaptureFixture[str], argv: list[str], named: str
) -> None:
    assert re.search(named, complaint(capsys, 2, *argv))


def test_an_invalid_mesh_is_bad_input(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    assert "flat.obj" in complaint(capsys, 2, str(tmp_path / "flat.obj"), "--benchmark")


def test_a_port_in_use_and_an_address_of_another_machine_are_named(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        for option, value in (("--port", str(taken.getsockname()[1])), ("--host", "192.0.2.1")):
            line = complaint(capsys, 1, "sphere", option, value)
            assert option in line and value in line
