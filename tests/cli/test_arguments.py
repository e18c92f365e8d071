"""Arguments: what they mean, which are refused, and that every option is documented."""

import dataclasses
import re
from pathlib import Path

import pytest

from ripple_sim.cli import (
    COMMANDS as ALL_COMMANDS,
    DropCommand,
    RenderCommand,
    ViewCommand,
    parse,
    parsers,
)
from ripple_sim.overlay import operators
from ripple_sim.scene import drop, drop_view
from ripple_sim.solver.layouts import build
from ripple_sim.solver.operator import plate_rim
from ripple_sim.video import VideoOptions


@pytest.mark.parametrize(
    ("parse", "word", "value"),
    [
        ("size", "16x999999999", (16, 999999999)),
        ("count", "007", 7),
        ("seed", "0", 0),
        ("seconds", "2.5e-1", 0.25),
        ("angle", "0", 0.0),
        ("angle", "360", 360.0),
        ("diameter", "0", 0.0),
        ("focus", "2nd", "2nd"),
        ("names", "height=0.02, contacts ,time", ("height=0.02", "contacts", "time")),
        ("names", "", ()),
        ("names", "  ", ()),
        ("view", "left", "left"),
        ("view", "-40", -40.0),
        ("elevation", "-90", -90.0),
        ("color", "#ff0033", (1.0, 0.0, 0.2)),
        ("color", "1, 0,0.25", (1.0, 0.0, 0.25)),
    ],
)
def test_a_word_is_converted_to_a_value_of_the_right_type(
    parse: str, word: str, value: object
) -> None:
    read = getattr(parsers, f"parse_{parse}")(word)
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize(
    ("parse", "words", "valid"),
    [
        (
            "size",
            ["", "1280", "1280X720", "1280 x 720", "-1x5", "1.5x2", "1x2x3", "٣x٣", "1280x720\n"],
            "WIDTHxHEIGHT",
        ),
        (
            "count",
            ["0", "-1", "1.0", "", "ten", "1e3", "1000000000", "²"],
            "a whole number, 1 or more",
        ),
        ("seed", ["-1", "0.5", ""], "a whole number, 0 or more"),
        ("seconds", ["0", "-0.0", "-1", "nan", "inf", "1s", ""], "a positive number of seconds"),
        ("factor", ["0", "inf", "nan", "4x"], "a positive number, such as 4"),
        ("angle", ["-1", "360.001", "nan", "inf", "half"], "an angle from 0 to 360 degrees"),
        ("diameter", ["-0.01", "inf", "nan", "2mm"], "a number of metres, 0 or more"),
        ("supersample", ["0", "5", "1.0", "11", ""], "1, 2, 3 or 4"),
        ("axis", ["x", "Z", ""], "y or z"),
        ("view", ["Front", "", "nan", "1e400"], "front, left, back, right, top, or an azimuth"),
        ("elevation", ["-91", "nan", "steep"], "from -90, straight down, to 90 degrees"),
        ("color", ["red", "#ff00", "1,1", "1,1,2", "1,1,nan"], "three numbers from 0 to 1"),
    ],
)
def test_invalid_words_are_quoted_with_the_expected_ones(
    parse: str, words: list[str], valid: str
) -> None:
    for word in words:
        with pytest.raises(ValueError, match="must be") as refusal:
            getattr(parsers, f"parse_{parse}")(word)
        assert repr(word) in str(refusal.value)
        assert valid in str(refusal.value)


def test_choices_of_options_are_those_of_the_modules_that_use_them() -> None:
    assert (parsers.UP_AXES, parsers.BASELINES) == (drop.UP_AXES, operators.BASELINES)
    assert tuple(drop_view.VIEWS) == parsers.VIEWS
    assert (parsers.LAYOUTS, parsers.RIMS) == (build.LAYOUTS, plate_rim.RIMS)


WORDS = {
    "size": ("320x180", (320, 180)),
    "fps": ("24", 24),
    "duration": ("0.5", 0.5),
    "slow_motion": ("4", 4.0),
    "supersample": ("2", 2),
    "shutter": ("180", 180.0),
    "aperture": ("0.02", 0.02),
    "focus": ("stone", "stone"),
    "exposures": ("8", 8),
    "transparent": (None, True),
    "frame_format": ("exr", "exr"),
    "passes": ("depth,flow", ("depth", "flow")),
    "pass_format": ("exr", "exr"),
    "overlay": ("height,time", ("height", "time")),
    "sound": (None, True),
    "compare": ("paper", "paper"),
    "resolution": ("48", 48),
    "layout": ("patches", "patches"),
    "rim": ("fixed", "fixed"),
    "backend": ("cpu", "cpu"),
    "camera": ("side", "side"),
    "device": ("1", 1),
    "resume": (None, True),
    "overwrite": (None, True),
}
COMMANDS = {"render": ("duck", RenderCommand), "drop": ("mesh.obj", DropCommand)}


def test_every_option_is_covered_by_this_file() -> None:
    assert set(WORDS) == {field.name for field in dataclasses.fields(VideoOptions)}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("option", WORDS)
def test_an_option_changes_its_own_field_alone(command: str, option: str) -> None:
    (name, kind) = COMMANDS[command]
    (word, value) = WORDS[option]
    flag = [f"--{option.replace('_', '-')}", *([] if word is None else [word])]
    made = parse([command, name, "-o", "clip.mp4", *flag])
    assert (type(made), made.output) == (kind, Path("clip.mp4"))
    assert made.options() == dataclasses.replace(VideoOptions(), **{option: value})


def test_the_commands_have_their_own_arguments() -> None:
    drop = parse(
        [
            "drop",
            "m.obj",
            "-o",
            "a.mp4",
            "--bodies",
            "3",
            "--seed",
            "7",
            "--up",
            "y",
            "--view",
            "-40",
            "--elevation",
            "-30",
            "--color",
            "#ffffff",
            "--shapes",
            "ball,box",
            "--repair",
            "--wrap",
        ]
    )
    assert (drop.mesh, drop.bodies, drop.seed, drop.up) == (Path("m.obj"), 3, 7, "y")
    assert (drop.view, drop.elevation, drop.color) == (-40.0, -30.0, (1.0, 1.0, 1.0))
    assert (drop.shapes, drop.look) == (("ball", "box"), "rubber")
    assert drop.repair and drop.wrap
    render = parse(["render", "duck", "--output", "a.mp4", "--camera", "side", "--device", "1"])
    assert (render.scene, render.camera, render.device) == ("duck", "side", 1)
    view = parse(["view", "duck", "--bodies", "0", "--size", "320x200", "--web", "--port", "9000"])
    assert isinstance(view, ViewCommand)
    assert (view.bodies, view.size, view.web, view.port, view.benchmark) == (
        0,
        (320, 200),
        True,
        9000,
        False,
    )
    assert view.folder == Path()


def test_help_prints_every_option_and_returns_no_command(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert parse(["render", "--help"]) is None
    text = capsys.readouterr().out
    assert all(f"--{option.replace('_', '-')}" in text for option in WORDS)


@pytest.mark.parametrize("command", ALL_COMMANDS)
def test_help_texts_break_only_at_the_edge_of_the_terminal(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "1000")
    assert parse([command, "--help"]) is None
    lines = capsys.readouterr().out.splitlines()
    # a frame of lines if stdout is UTF-8, and of blanks if not
    is_text = [bool(re.match(r"[│ ] {5,}[^ │]", line)) for line in lines]
    continued = [
        line
        for line, before, here in zip(lines[1:], is_text, is_text[1:], strict=False)
        if before and here
    ]
    assert lines
    assert continued == []
