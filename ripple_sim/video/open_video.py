"""`open_video`: starts a video, or continues one, as its options say."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ripple_sim.encode import FrameWriter, open_writer

from .options import VideoOptions


def open_video(
    output: Path, options: VideoOptions, settings: Mapping[str, str | int | float] | None = None
) -> FrameWriter:
    """Writer of a video with settled options; see `open_writer`."""
    return open_writer(
        output,
        width=options.size[0],
        height=options.size[1],
        fps=options.fps or 0,
        transparent=options.transparent,
        frame_format=options.frame_format,
        settings=settings,
        resume=options.resume,
        overwrite=options.overwrite,
    )
