"""`open_writer`: starts a video, or continues an interrupted one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ripple_sim.errors import EncodingError
from ripple_sim.solver.files import final_path

from .clip import Stream
from .formats import FORMATS
from .output import check_output, video_format
from .part import Part
from .writer import FrameWriter


def open_writer(
    path: str | Path,
    *,
    width: int,
    height: int,
    fps: int,
    transparent: bool = False,
    frame_format: str = "png",
    settings: Mapping[str, str | int | float] | None = None,
    resume: bool = False,
    overwrite: bool = False,
) -> FrameWriter:
    """Start a video, or continue one; the ending of `path` chooses its format.

    `.mp4` is H.264, `.webm` VP9, `.gif` and `.webp` are animated images; a name without ending becomes a folder of PNG
    or EXR frames. Missing parent folders are created. Nothing appears at `path` before the video is complete; an
    earlier file stays until then; one that was not written here is replaced only with `overwrite`. A link is written
    through. Meanwhile the frames are in a folder beside it, `path` with `.part` appended, as
    playable clips or as images. They join to the same video, bit for bit, however often the work was interrupted.

    Parameters
    ----------
    path : str or Path
        Where the video goes.
    width, height : int
        Size of the frames [pixels].
    fps : int
        Frames per second.
    transparent : bool
        Frames have a fourth channel, their opacity; colours are multiplied by it for EXR only.
    frame_format : str
        Of a folder's frames, "png" or "exr".
    settings : mapping, optional
        Everything that decides the pixels, by name. With it, finished segments survive an interruption.
    resume : bool
        Continue an interrupted writer of the same settings: the next frame to write is number `frames`.
    overwrite : bool
        Replace an older file, or older frames, that were not written here.

    Raises
    ------
    VideoError
        If `check_output` refuses the arguments, another process is writing this video, or, with `resume`, the
        interrupted video has other settings.
    EncodingError
        If the folder cannot be written.
    """
    path = Path(path)
    check_output(path, width, height, fps, transparent=transparent, frame_format=frame_format, overwrite=overwrite)
    video = FORMATS[video_format(path, frame_format)]
    try:
        part = Part(
            final_path(path),
            suffix=video.suffix,
            length=video.length,
            settings=settings or {},
            resume=resume,
            overwrite=overwrite,
        )
    except OSError as error:
        raise EncodingError(f"cannot write the video {path}: {error.strerror}") from error
    shape = (height, width, 4 if transparent else 3)
    return FrameWriter(part, video, Stream(width, height, fps), shape, resumable=settings is not None)
