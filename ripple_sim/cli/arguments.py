"""Types of command line arguments: each says how its word is parsed, and what the help shows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from tyro.conf import arg
from tyro.constructors import PrimitiveConstructorSpec

from . import parsers

_RIM_NAMES = f"{{{','.join(parsers.RIMS)}}}"
_LAYOUT_NAMES = f"{{{','.join(parsers.LAYOUTS)}}}"
_AXIS_NAMES = f"{{{','.join(parsers.UP_AXES)}}}"


def _one_word(
    parse: Callable[[str], Any], metavar: str, show: Callable[[Any], str] = str
) -> PrimitiveConstructorSpec[Any]:
    """How tyro reads an argument of one word.

    The help has `metavar` for the word, and shows a default by `show`.
    """
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=metavar,
        instance_from_str=lambda words: parse(words[0]),
        is_instance=lambda value: True,
        str_from_instance=lambda value: [show(value)],
    )


Size = Annotated[
    tuple[int, int],
    _one_word(parsers.parse_size, "WIDTHxHEIGHT", lambda size: f"{size[0]}x{size[1]}"),
]
Count = Annotated[int, _one_word(parsers.parse_count, "N")]
Seed = Annotated[int, _one_word(parsers.parse_seed, "N")]
SceneSeed = Annotated[
    int | None, _one_word(parsers.parse_seed, "N"), arg(help_behavior_hint="(default: the scene's)")
]
FrameRate = Annotated[
    int | None,
    _one_word(parsers.parse_count, "FPS"),
    arg(help_behavior_hint="(default: 60, for a GIF 25)"),
]
Duration = Annotated[
    float | None,
    _one_word(parsers.parse_seconds, "S"),
    arg(help_behavior_hint="(default: the scene's)"),
]
CameraName = Annotated[str | None, arg(metavar="NAME", help_behavior_hint="(default: the scene's)")]
Time = Annotated[
    float | None, _one_word(parsers.parse_time, "S"), arg(help_behavior_hint="(default: the end)")
]
HeightColors = Annotated[
    Any, _one_word(parsers.parse_height_colors, "auto|M"), arg(help_behavior_hint="(optional)")
]
Resolution = Annotated[
    int | None,
    _one_word(parsers.parse_count, "N"),
    arg(help_behavior_hint="(default: the scene's)"),
]
_NAMES = _one_word(parsers.parse_names, "NAME[,NAME ...]", lambda names: ",".join(names or ()))
Overlay = Annotated[
    tuple[str, ...] | None, _NAMES, arg(help_behavior_hint="(default: the scene's, or none)")
]
Passes = Annotated[tuple[str, ...], _NAMES, arg(help_behavior_hint="(optional)")]
Baseline = Annotated[
    str | None,
    _one_word(str, "{" + ",".join(parsers.BASELINES) + "}", lambda name: name or ""),
    arg(help_behavior_hint="(optional)"),
]
Factor = Annotated[float, _one_word(parsers.parse_factor, "F")]
Supersample = Annotated[int, _one_word(parsers.parse_supersample, "N")]
Shutter = Annotated[
    float | None,
    _one_word(parsers.parse_angle, "DEGREES"),
    arg(help_behavior_hint="(default: the scene's)"),
]
Aperture = Annotated[
    float | None,
    _one_word(parsers.parse_diameter, "M"),
    arg(help_behavior_hint="(default: the scene's)"),
]
Focus = Annotated[
    float | str | None,
    _one_word(parsers.parse_focus, "M|NAME"),
    arg(help_behavior_hint="(default: the scene's, or what the camera looks at)"),
]
Exposures = Annotated[
    int | None,
    _one_word(parsers.parse_count, "N"),
    arg(help_behavior_hint="(default: the scene's, or 32)"),
]
Shard = Annotated[
    tuple[int, int] | None,
    _one_word(parsers.parse_shard, "I/N"),
    arg(help_behavior_hint="(default: all)"),
]
Gigabytes = Annotated[float, _one_word(parsers.parse_factor, "GB")]
Limit = Annotated[
    int | None, _one_word(parsers.parse_count, "N"), arg(help_behavior_hint="(optional)")
]
Device = Annotated[
    int | None,
    _one_word(parsers.parse_seed, "N"),
    arg(help_behavior_hint="(default: the first that works)"),
]
View = Annotated[
    float | str | None,
    _one_word(parsers.parse_view, "{" + ",".join(parsers.VIEWS) + ",DEGREES}"),
    arg(help_behavior_hint="(default: one that shows the front and where bodies land)"),
]
Elevation = Annotated[
    float | None,
    _one_word(parsers.parse_elevation, "DEGREES"),
    arg(help_behavior_hint="(default: the steeper, the flatter the mesh)"),
]
RGB = Annotated[
    tuple[float, float, float] | None,
    _one_word(parsers.parse_color, "R,G,B|#RRGGBB"),
    arg(help_behavior_hint="(default: the mesh's, or the look's)"),
]
Shapes = Annotated[
    tuple[str, ...] | None,
    _NAMES,
    arg(help_behavior_hint="(default: all)"),
]
UpAxis = Annotated[
    str | None,
    _one_word(parsers.parse_axis, _AXIS_NAMES),
    arg(help_behavior_hint="(default: z for STL, else y)"),
]
LayoutName = Annotated[str, _one_word(parsers.parse_layout, _LAYOUT_NAMES)]
SceneLayout = Annotated[
    str | None,
    _one_word(parsers.parse_layout, _LAYOUT_NAMES),
    arg(help_behavior_hint="(default: the scene's)"),
]
RimName = Annotated[str, _one_word(parsers.parse_rim, _RIM_NAMES)]
NamedMaterial = Annotated[
    tuple[str, dict[str, float]], _one_word(parsers.parse_material, "NAME[,PARAMETER=VALUE ...]")
]
Rim = Annotated[
    str | None,
    _one_word(parsers.parse_rim, _RIM_NAMES),
    arg(help_behavior_hint="(default: the scene's)"),
]
