"""Types of command line arguments: how a word is parsed, and the message if it is invalid.

`VideoArguments` is `VideoOptions` with these types: its fields, defaults and help are the options'.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import arg
from tyro.constructors import PrimitiveConstructorSpec

from ripple_sim.solver.errors import shown
from ripple_sim.video.options import VideoOptions

# Written out, since the modules that have these names take seconds to import; a test compares them.
UP_AXES, RIMS = ("y", "z"), ("free", "fixed")
LAYOUTS, BASELINES = ("auto", "cube", "patches"), ("paper", "uncorrected", "dynamic-paint")


def parse_size(word: str) -> tuple[int, int]:
    """Read width and height [pixels] from a word such as "1280x720"."""
    match = re.fullmatch(r"([0-9]{1,9})x([0-9]{1,9})", word)
    if match is None:
        raise ValueError(f"{shown(word)} is not a frame size; valid is WIDTHxHEIGHT in pixels, such as 1280x720")
    return int(match[1]), int(match[2])


def parse_count(word: str) -> int:
    """Read a whole number of 1 or more."""
    return _whole(word, 1)


def parse_seed(word: str) -> int:
    """Read a whole number of 0 or more."""
    return _whole(word, 0)


def _whole(word: str, least: int) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", word) or int(word) < least:
        raise ValueError(f"{shown(word)} is not valid; it must be a whole number, {least} or more")
    return int(word)


def parse_seconds(word: str) -> float:
    """Read a positive, finite time [s]."""
    return _positive(word, "a positive number of seconds")


def parse_factor(word: str) -> float:
    """Read a positive, finite factor."""
    return _positive(word, "a positive number, such as 4")


def parse_angle(word: str) -> float:
    """Read a shutter angle [degrees]."""
    number = _number(word)
    if not 0 <= number <= 360:
        raise ValueError(f"{shown(word)} is not valid; it must be an angle from 0 to 360 degrees, such as 180")
    return number


def parse_diameter(word: str) -> float:
    """Read the diameter of a lens [m]."""
    number = _number(word)
    if not 0 <= number < math.inf:
        raise ValueError(f"{shown(word)} is not valid; it must be a number of metres, 0 or more, such as 0.02")
    return number


def parse_focus(word: str) -> float | str:
    """Read a distance [m], or a name."""
    number = _number(word)
    return word if math.isnan(number) else number


def _positive(word: str, valid: str) -> float:
    number = _number(word)
    if not 0 < number < math.inf:
        raise ValueError(f"{shown(word)} is not valid; it must be {valid}")
    return number


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return math.nan


def parse_supersample(word: str) -> int:
    """Read a supersampling factor."""
    if not re.fullmatch(r"[1-4]", word):
        raise ValueError(f"{shown(word)} is not valid; it must be 1, 2, 3 or 4")
    return int(word)


def parse_shard(word: str) -> tuple[int, int]:
    """Read which part of how many, such as "1/4"."""
    match = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", word)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise ValueError(f"{shown(word)} is not valid; it must be a part of how many, such as 1/4, 2/4, 3/4 or 4/4")
    return int(match[1]), int(match[2])


def parse_axis(word: str) -> str:
    """Read the axis that points up."""
    return _one_of(word, UP_AXES)


def parse_layout(word: str) -> str:
    """Read the name of a layout."""
    return _one_of(word, LAYOUTS)


def parse_rim(word: str) -> str:
    """Read what rims do."""
    return _one_of(word, RIMS)


def _one_of(word: str, names: tuple[str, ...]) -> str:
    if word not in names:
        *most, last = names
        raise ValueError(f"{shown(word)} is not valid; it must be {', '.join(most)} or {last}")
    return word


def parse_overlay(word: str) -> tuple[str, ...]:
    """Read a list of overlays or passes, separated by commas; the names are checked later."""
    return tuple(part.strip() for part in word.split(",")) if word.strip() else ()


def _one_word(
    parse: Callable[[str], Any], metavar: str, show: Callable[[Any], str] = str
) -> PrimitiveConstructorSpec[Any]:
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=metavar,
        instance_from_str=lambda words: parse(words[0]),
        is_instance=lambda value: True,
        str_from_instance=lambda value: [show(value)],
    )


Size = Annotated[tuple[int, int], _one_word(parse_size, "WIDTHxHEIGHT", lambda size: f"{size[0]}x{size[1]}")]
Count = Annotated[int, _one_word(parse_count, "N")]
Seed = Annotated[int, _one_word(parse_seed, "N")]
SceneSeed = Annotated[int | None, _one_word(parse_seed, "N"), arg(help_behavior_hint="(default: the scene's)")]
FrameRate = Annotated[int | None, _one_word(parse_count, "FPS"), arg(help_behavior_hint="(default: 60, for a GIF 25)")]
Duration = Annotated[float | None, _one_word(parse_seconds, "S"), arg(help_behavior_hint="(default: the scene's)")]
Resolution = Annotated[int | None, _one_word(parse_count, "N"), arg(help_behavior_hint="(default: the scene's)")]
Overlay = Annotated[
    tuple[str, ...] | None,
    _one_word(parse_overlay, "NAME[,NAME ...]", lambda words: ",".join(words or ())),
    arg(help_behavior_hint="(default: the scene's, or none)"),
]
Passes = Annotated[
    tuple[str, ...],
    _one_word(parse_overlay, "NAME[,NAME ...]", lambda words: ",".join(words or ())),
    arg(help_behavior_hint="(optional)"),
]
Baseline = Annotated[
    str | None,
    _one_word(str, "{" + ",".join(BASELINES) + "}", lambda name: name or ""),
    arg(help_behavior_hint="(optional)"),
]
Factor = Annotated[float, _one_word(parse_factor, "F")]
Supersample = Annotated[int, _one_word(parse_supersample, "N")]
Shutter = Annotated[float | None, _one_word(parse_angle, "DEGREES"), arg(help_behavior_hint="(default: the scene's)")]
Aperture = Annotated[float | None, _one_word(parse_diameter, "M"), arg(help_behavior_hint="(default: the scene's)")]
Focus = Annotated[
    float | str | None,
    _one_word(parse_focus, "M|NAME"),
    arg(help_behavior_hint="(default: the scene's, or what the camera looks at)"),
]
Exposures = Annotated[int | None, _one_word(parse_count, "N"), arg(help_behavior_hint="(default: the scene's, or 32)")]
Shard = Annotated[tuple[int, int] | None, _one_word(parse_shard, "I/N"), arg(help_behavior_hint="(default: all)")]
Gigabytes = Annotated[float, _one_word(parse_factor, "GB")]
Limit = Annotated[int | None, _one_word(parse_count, "N"), arg(help_behavior_hint="(optional)")]
Device = Annotated[int | None, _one_word(parse_seed, "N"), arg(help_behavior_hint="(default: the first that works)")]
UpAxis = Annotated[str | None, _one_word(parse_axis, "{y,z}"), arg(help_behavior_hint="(default: z for STL, else y)")]
LayoutName = Annotated[str, _one_word(parse_layout, "{auto,cube,patches}")]
SceneLayout = Annotated[
    str | None, _one_word(parse_layout, "{auto,cube,patches}"), arg(help_behavior_hint="(default: the scene's)")
]
Rim = Annotated[str | None, _one_word(parse_rim, "{free,fixed}"), arg(help_behavior_hint="(default: the scene's)")]


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Output:
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """Output file ending in .mp4, .webm, .gif or .webp, or a name without ending for a folder of frames."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class VideoArguments(VideoOptions, _Output):
    """Arguments of every command that renders a video; options not named here are read as their types say."""

    size: Size = VideoOptions.size
    fps: FrameRate = VideoOptions.fps
    duration: Duration = VideoOptions.duration
    slow_motion: Factor = VideoOptions.slow_motion
    supersample: Supersample = VideoOptions.supersample
    shutter: Shutter = VideoOptions.shutter
    aperture: Aperture = VideoOptions.aperture
    focus: Focus = None
    exposures: Exposures = VideoOptions.exposures
    passes: Passes = ()
    overlay: Overlay = None
    compare: Baseline = VideoOptions.compare
    resolution: Resolution = VideoOptions.resolution
    layout: SceneLayout = VideoOptions.layout
    rim: Rim = VideoOptions.rim

    def options(self) -> VideoOptions:
        """Options that the user chose."""
        return VideoOptions(**{field.name: getattr(self, field.name) for field in dataclasses.fields(VideoOptions)})
