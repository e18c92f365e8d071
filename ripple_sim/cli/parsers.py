"""Parsers of command line words: the value of a word, and the message if the word is invalid."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable
from typing import Any

from ripple_sim.solver.errors import shown

# Written out, since the modules that have these names take seconds to import; a test compares them.
UP_AXES = ("y", "z")
VIEWS = ("front", "left", "back", "right", "top")
RIMS = ("free", "supported", "clamped", "fixed")
LAYOUTS = ("auto", "cube", "patches")
BASELINES = ("paper", "uncorrected", "dynamic-paint")


def _parser(
    read: Callable[[str], Any], is_valid: Callable[[Any], bool], valid: str
) -> Callable[[str], Any]:
    """Make a parser: it reads a word, and checks the value.

    The message for an invalid word says that it must be `valid`.
    """

    def parse(word: str) -> Any:
        with contextlib.suppress(ValueError):
            value = read(word)
            if is_valid(value):
                return value
        raise ValueError(f"it must be {valid}, got {shown(word)}")

    return parse


def _read_whole(word: str) -> int:
    """Read a whole number that is not negative."""
    if not re.fullmatch(r"[0-9]{1,9}", word):
        raise ValueError
    return int(word)


def _read_shard(word: str) -> tuple[int, int]:
    """Read a part and the number of parts from a word such as "1/4"; (0, 0) from any other."""
    match = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", word)
    return (int(match[1]), int(match[2])) if match else (0, 0)


def _one_of(names: tuple[str, ...]) -> Callable[[str], Any]:
    """Make a parser for one of some names."""
    *first_names, last_name = names
    valid = f"{', '.join(first_names)} or {last_name}"
    return _parser(str, lambda word: word in names, valid)


parse_count = _parser(_read_whole, lambda number: number >= 1, "a whole number, 1 or more")
parse_seed = _parser(_read_whole, lambda number: True, "a whole number, 0 or more")
parse_seconds = _parser(
    float, lambda seconds: 0 < seconds < math.inf, "a positive number of seconds"
)
parse_time = _parser(
    float, lambda seconds: 0 <= seconds < math.inf, "a number of seconds, 0 or more"
)
parse_factor = _parser(float, lambda factor: 0 < factor < math.inf, "a positive number, such as 4")
parse_angle = _parser(
    float, lambda angle: 0 <= angle <= 360, "an angle from 0 to 360 degrees, such as 180"
)
parse_diameter = _parser(
    float, lambda metres: 0 <= metres < math.inf, "a number of metres, 0 or more, such as 0.02"
)
parse_elevation = _parser(
    float,
    lambda degrees: -90 <= degrees <= 90,
    "an elevation from -90, straight down, to 90 degrees, such as -30",
)
parse_supersample = _parser(_read_whole, lambda number: 1 <= number <= 4, "1, 2, 3 or 4")
parse_shard = _parser(
    _read_shard,
    lambda shard: 1 <= shard[0] <= shard[1],
    "a part of how many, such as 1/4, 2/4, 3/4 or 4/4",
)
parse_axis = _one_of(UP_AXES)
parse_layout = _one_of(LAYOUTS)
parse_rim = _one_of(RIMS)


def parse_size(word: str) -> tuple[int, int]:
    """Read width and height [pixels] from a word such as "1280x720"."""
    match = re.fullmatch(r"([0-9]{1,9})x([0-9]{1,9})", word)
    if match is None:
        raise ValueError(
            f"frame size must be WIDTHxHEIGHT in pixels, such as 1280x720, got {shown(word)}"
        )
    return int(match[1]), int(match[2])


def parse_focus(word: str) -> float | str:
    """Read a distance [m], or a name."""
    try:
        distance = float(word)
    except ValueError:
        return word
    return word if math.isnan(distance) else distance


def parse_height_colors(word: str) -> float | str:
    """Read "auto", or a height [m]."""
    if word == "auto":
        return word
    parse = _parser(
        float, lambda metres: 0 < metres < math.inf, "auto, or a positive number of metres"
    )
    return parse(word)


def parse_view(word: str) -> float | str:
    """Read the name of a view, or an azimuth [degrees]."""
    if word in VIEWS:
        return word
    with contextlib.suppress(ValueError):
        azimuth = float(word)
        if math.isfinite(azimuth):
            return azimuth
    raise ValueError(
        f"it must be {', '.join(VIEWS)}, or an azimuth in degrees, such as 120, got {shown(word)}"
    )


def parse_color(word: str) -> tuple[float, float, float]:
    """Read a colour, such as "#ff8800" or "1,0.5,0", as sRGB from 0 to 1."""
    code = re.fullmatch(r"#([0-9a-fA-F]{2})([0-9a-fA-F]{2})([0-9a-fA-F]{2})", word)
    if code is not None:
        red, green, blue = (int(channel, 16) / 255 for channel in code.groups())
        return red, green, blue
    with contextlib.suppress(ValueError):
        red, green, blue = (float(channel) for channel in word.split(","))
        if all(0 <= channel <= 1 for channel in (red, green, blue)):
            return red, green, blue
    raise ValueError(
        f"it must be three numbers from 0 to 1, such as 0.9,0.5,0.1, or #RRGGBB, got {shown(word)}"
    )


def parse_names(word: str) -> tuple[str, ...]:
    """Read names that are separated by commas; what they stand for is checked later."""
    if not word.strip():
        return ()
    return tuple(name.strip() for name in word.split(","))


def parse_material(word: str) -> tuple[str, dict[str, float]]:
    """Read a material's name and parameters, such as "steel-plate,thickness=0.002"."""
    name, *pairs = (item.strip() for item in word.split(","))
    matches = [re.fullmatch(r"(\w+) *= *(.+)", pair) for pair in pairs]
    # a pair without a match is a TypeError
    with contextlib.suppress(ValueError, TypeError):
        return name, {match[1]: float(match[2]) for match in matches}  # type: ignore[index]
    raise ValueError(
        f"it must be a name, such as steel-plate, or steel-plate,thickness=0.002, got {shown(word)}"
    )
