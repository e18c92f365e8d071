"""Types of command line arguments: how a word is parsed, and the message if it is invalid."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable
from typing import Annotated, Any

from tyro.conf import arg
from tyro.constructors import PrimitiveConstructorSpec

from ripple_sim.solver.errors import shown

# Written out, since the modules that have these names take seconds to import; a test compares them.
UP_AXES = ("y", "z")
VIEWS = ("front", "left", "back", "right", "top")
RIMS = ("free", "supported", "clamped", "fixed")
LAYOUTS = ("auto", "cube", "patches")
BASELINES = ("paper", "uncorrected", "dynamic-paint")

_RIM_NAMES = f"{{{','.join(RIMS)}}}"


def parse_size(word: str) -> tuple[int, int]:
    """Read width and height [pixels] from a word such as "1280x720"."""
    match = re.fullmatch(r"([0-9]{1,9})x([0-9]{1,9})", word)
    if match is None:
        raise ValueError(
            f"frame size must be WIDTHxHEIGHT in pixels, such as 1280x720, got {shown(word)}"
        )
    return int(match[1]), int(match[2])


def _reader(
    read: Callable[[str], Any], right: Callable[[Any], bool], valid: str
) -> Callable[[str], Any]:
    """Make a parser: it reads a word, and checks that the value is right.

    Its message says that the word must be `valid`.
    """

    def parse(word: str) -> Any:
        with contextlib.suppress(ValueError):
            value = read(word)
            if right(value):
                return value
        raise ValueError(f"it must be {valid}, got {shown(word)}")

    return parse


def _whole(word: str) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", word):
        raise ValueError
    return int(word)


def _part(word: str) -> tuple[int, int]:
    match = re.fullmatch(r"([0-9]{1,6})/([0-9]{1,6})", word)
    return (int(match[1]), int(match[2])) if match else (0, 0)


def _one_of(names: tuple[str, ...]) -> Callable[[str], Any]:
    *most, last = names
    return _reader(str, lambda word: word in names, f"{', '.join(most)} or {last}")


parse_count = _reader(_whole, lambda number: number >= 1, "a whole number, 1 or more")
parse_seed = _reader(_whole, lambda number: True, "a whole number, 0 or more")
parse_seconds = _reader(
    float, lambda seconds: 0 < seconds < math.inf, "a positive number of seconds"
)
parse_time = _reader(
    float, lambda seconds: 0 <= seconds < math.inf, "a number of seconds, 0 or more"
)
parse_factor = _reader(float, lambda factor: 0 < factor < math.inf, "a positive number, such as 4")
parse_angle = _reader(
    float, lambda angle: 0 <= angle <= 360, "an angle from 0 to 360 degrees, such as 180"
)
parse_diameter = _reader(
    float, lambda metres: 0 <= metres < math.inf, "a number of metres, 0 or more, such as 0.02"
)
parse_elevation = _reader(
    float,
    lambda degrees: -90 <= degrees <= 90,
    "an elevation from -90, straight down, to 90 degrees, such as -30",
)
parse_supersample = _reader(_whole, lambda number: 1 <= number <= 4, "1, 2, 3 or 4")
parse_shard = _reader(
    _part, lambda part: 1 <= part[0] <= part[1], "a part of how many, such as 1/4, 2/4, 3/4 or 4/4"
)
parse_axis, parse_layout, parse_rim = map(_one_of, (UP_AXES, LAYOUTS, RIMS))


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
    read = _reader(
        float, lambda metres: 0 < metres < math.inf, "auto, or a positive number of metres"
    )
    return read(word)


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


def parse_overlay(word: str) -> tuple[str, ...]:
    """Read a list of overlays or passes, separated by commas; the names are checked later."""
    return tuple(part.strip() for part in word.split(",")) if word.strip() else ()


def parse_material(word: str) -> tuple[str, dict[str, float]]:
    """Read a material's name and parameters, such as "steel-plate,thickness=0.002"."""
    name, *pairs = (part.strip() for part in word.split(","))
    found = [re.fullmatch(r"(\w+) *= *(.+)", pair) for pair in pairs]
    with contextlib.suppress(ValueError, TypeError):
        return name, {match[1]: float(match[2]) for match in found}  # type: ignore[index]
    raise ValueError(
        f"it must be a name, such as steel-plate, or steel-plate,thickness=0.002, got {shown(word)}"
    )


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


Size = Annotated[
    tuple[int, int], _one_word(parse_size, "WIDTHxHEIGHT", lambda size: f"{size[0]}x{size[1]}")
]
Count = Annotated[int, _one_word(parse_count, "N")]
Seed = Annotated[int, _one_word(parse_seed, "N")]
SceneSeed = Annotated[
    int | None, _one_word(parse_seed, "N"), arg(help_behavior_hint="(default: the scene's)")
]
FrameRate = Annotated[
    int | None, _one_word(parse_count, "FPS"), arg(help_behavior_hint="(default: 60, for a GIF 25)")
]
Duration = Annotated[
    float | None, _one_word(parse_seconds, "S"), arg(help_behavior_hint="(default: the scene's)")
]
CameraName = Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(default: the scene's)")]
Time = Annotated[
    float | None, _one_word(parse_time, "S"), arg(help_behavior_hint="(default: the end)")
]
HeightColors = Annotated[
    Any, _one_word(parse_height_colors, "auto|M"), arg(help_behavior_hint="(optional)")
]
Resolution = Annotated[
    int | None, _one_word(parse_count, "N"), arg(help_behavior_hint="(default: the scene's)")
]
_names = _one_word(parse_overlay, "NAME[,NAME ...]", lambda words: ",".join(words or ()))
Overlay = Annotated[
    tuple[str, ...] | None, _names, arg(help_behavior_hint="(default: the scene's, or none)")
]
Passes = Annotated[tuple[str, ...], _names, arg(help_behavior_hint="(optional)")]
Baseline = Annotated[
    str | None,
    _one_word(str, "{" + ",".join(BASELINES) + "}", lambda name: name or ""),
    arg(help_behavior_hint="(optional)"),
]
Factor = Annotated[float, _one_word(parse_factor, "F")]
Supersample = Annotated[int, _one_word(parse_supersample, "N")]
Shutter = Annotated[
    float | None,
    _one_word(parse_angle, "DEGREES"),
    arg(help_behavior_hint="(default: the scene's)"),
]
Aperture = Annotated[
    float | None, _one_word(parse_diameter, "M"), arg(help_behavior_hint="(default: the scene's)")
]
Focus = Annotated[
    float | str | None,
    _one_word(parse_focus, "M|NAME"),
    arg(help_behavior_hint="(default: the scene's, or what the camera looks at)"),
]
Exposures = Annotated[
    int | None, _one_word(parse_count, "N"), arg(help_behavior_hint="(default: the scene's, or 32)")
]
Shard = Annotated[
    tuple[int, int] | None, _one_word(parse_shard, "I/N"), arg(help_behavior_hint="(default: all)")
]
Gigabytes = Annotated[float, _one_word(parse_factor, "GB")]
Limit = Annotated[int | None, _one_word(parse_count, "N"), arg(help_behavior_hint="(optional)")]
Device = Annotated[
    int | None,
    _one_word(parse_seed, "N"),
    arg(help_behavior_hint="(default: the first that works)"),
]
View = Annotated[
    float | str | None,
    _one_word(parse_view, "{" + ",".join(VIEWS) + ",DEGREES}"),
    arg(help_behavior_hint="(default: one that shows the front and where bodies land)"),
]
Elevation = Annotated[
    float | None,
    _one_word(parse_elevation, "DEGREES"),
    arg(help_behavior_hint="(default: the steeper, the flatter the mesh)"),
]
RGB = Annotated[
    tuple[float, float, float] | None,
    _one_word(parse_color, "R,G,B|#RRGGBB"),
    arg(help_behavior_hint="(default: the mesh's, or the look's)"),
]
Shapes = Annotated[
    tuple[str, ...] | None,
    _one_word(parse_overlay, "NAME[,NAME ...]", lambda words: ",".join(words or ())),
    arg(help_behavior_hint="(default: all)"),
]
UpAxis = Annotated[
    str | None,
    _one_word(parse_axis, "{y,z}"),
    arg(help_behavior_hint="(default: z for STL, else y)"),
]
LayoutName = Annotated[str, _one_word(parse_layout, "{auto,cube,patches}")]
SceneLayout = Annotated[
    str | None,
    _one_word(parse_layout, "{auto,cube,patches}"),
    arg(help_behavior_hint="(default: the scene's)"),
]
RimName = Annotated[str, _one_word(parse_rim, _RIM_NAMES)]
NamedMaterial = Annotated[
    tuple[str, dict[str, float]], _one_word(parse_material, "NAME[,PARAMETER=VALUE ...]")
]
Rim = Annotated[
    str | None, _one_word(parse_rim, _RIM_NAMES), arg(help_behavior_hint="(default: the scene's)")
]
