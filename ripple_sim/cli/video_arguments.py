"""The command line's form of `VideoOptions`: its fields, defaults and help, with the words that the user types."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

from ripple_sim.video.options import VideoOptions

from .arguments import (
    Aperture,
    Baseline,
    Duration,
    Exposures,
    Factor,
    Focus,
    FrameRate,
    Overlay,
    Passes,
    Resolution,
    Rim,
    SceneLayout,
    Shutter,
    Size,
    Supersample,
)

# By field: how its word on the command line is read. The others are read as their types say.
_WORDS: dict[str, Any] = {
    "size": Size,
    "fps": FrameRate,
    "duration": Duration,
    "slow_motion": Factor,
    "supersample": Supersample,
    "shutter": Shutter,
    "aperture": Aperture,
    "focus": Focus,
    "exposures": Exposures,
    "overlay": Overlay,
    "passes": Passes,
    "compare": Baseline,
    "resolution": Resolution,
    "layout": SceneLayout,
    "rim": Rim,
}

if TYPE_CHECKING:
    _VideoFields = VideoOptions
else:
    _VideoFields = dataclasses.make_dataclass(
        "_VideoFields", list(_WORDS.items()), bases=(VideoOptions,), frozen=True, kw_only=True
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class _Output:
    output: Annotated[Path, arg(aliases=["-o"], metavar="FILE")]
    """Output file ending in .mp4, .webm, .gif or .webp, or a name without ending for a folder of frames."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class VideoArguments(_VideoFields, _Output):
    """The arguments of every command that renders a video."""

    def options(self) -> VideoOptions:
        """Options that the user chose."""
        return VideoOptions(**{field.name: getattr(self, field.name) for field in dataclasses.fields(VideoOptions)})
