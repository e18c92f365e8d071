"""The check of an output before its first frame is rendered: its place, size, rate and format."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

from ripple_sim.errors import EncodingError, VideoError
from ripple_sim.solver.files import NO_NAME, final_path

from .exr import check_exr
from .formats import ENDINGS, FRAME_FORMATS, video_format
from .replace import MARK, is_plain, made_here

# Shortest and longest side of a frame [pixels].
MIN_SIZE = 16
MAX_SIZE = 8192

# Highest frame rate [frames/s]. Browsers slow a GIF to 10 frames/s if a frame lasts less than
# 0.02 s.
MAX_FPS = 240
MAX_GIF_FPS = 50

# Blocks of 16x16 pixels in a frame of H.264's highest level, 6.2.
_MAX_H264_BLOCKS = 139_264

# Name of a frame's file in a folder.
_FRAME_PATTERN = re.compile(rf"frame_\d{{5,}}\.({'|'.join(FRAME_FORMATS)})")

# Formats with half the resolution in colour, and formats that can be transparent.
_SUBSAMPLED = (".mp4", ".webm")
_WITH_OPACITY = (".webp", *FRAME_FORMATS)


def check_output(
    path: str | Path,
    width: int,
    height: int,
    fps: int,
    *,
    transparent: bool = False,
    frame_format: str = "png",
    overlaid: bool = False,
    overwrite: bool = False,
) -> None:
    """Check that a video of this size and frame rate [1/s] can be written to `path`.

    The check leaves nothing behind.

    Raises
    ------
    VideoError
        If the ending is unknown, the size or rate is out of range, the size is odd in a format of
        halved colour resolution, the format supports no transparency or no overlays, EXR frames are
        not for a folder, the path cannot be a file name, or something that was not made here
        stands in the output's place. With `overwrite` such a file or frames are no obstacle.
    EncodingError
        If the output cannot be written.
    """
    path = Path(path)
    try:
        form = video_format(path, frame_format)
        if frame_format != "png" and form != frame_format:
            raise VideoError(
                f"cannot write {frame_format.upper()} frames to {path}: name a folder, without an "
                "ending"
            )
        if form == "exr":
            check_exr()
            if overlaid:
                raise VideoError(
                    "EXR frames are linear light, without overlays and comparisons; leave these "
                    "out (--overlay '', and no --compare), or write PNG frames"
                )
        if transparent and form not in _WITH_OPACITY:
            raise VideoError(f"{path} cannot be transparent: write .webp or a folder of frames")
        check_size(width, height)
        if form == ".mp4" and -(-width // 16) * -(-height // 16) > _MAX_H264_BLOCKS:
            raise VideoError(
                f"frame size is {width}x{height}; .mp4 is H.264, whose highest level (6.2) ends "
                f"at {_MAX_H264_BLOCKS} blocks of 16x16, such as 8192x4352: make it smaller, or "
                "write .webm, .gif, .webp or a folder of frames"
            )
        if form in _SUBSAMPLED and (width % 2 or height % 2):
            raise VideoError(
                f"frame size is {width}x{height}; {form} needs an even width and height, such as "
                f"{width + width % 2}x{height + height % 2}"
            )
        highest = MAX_GIF_FPS if form == ".gif" else MAX_FPS
        if not isinstance(fps, int) or not 1 <= fps <= highest:
            rate = "a GIF's frame rate" if form == ".gif" else "frame rate"
            raise VideoError(
                f"{rate} must be a whole number from 1 to {highest} frames per second, got {fps}"
            )
        _check_place(path, form, overwrite)
    except OSError as error:
        kind = VideoError if error.errno in NO_NAME else EncodingError
        raise kind(
            f"cannot write {path}: {error.strerror}; name a file in a folder you can write to"
        ) from error


def check_size(width: int, height: int) -> None:
    """Make sure that frames of this size [pixels] can be drawn.

    Raises `VideoError` if a side is shorter than `MIN_SIZE` or longer than `MAX_SIZE`.
    """
    if not all(isinstance(side, int) and MIN_SIZE <= side <= MAX_SIZE for side in (width, height)):
        raise VideoError(
            f"frame size must be {MIN_SIZE} to {MAX_SIZE} pixels along each side, got "
            f"{width}x{height}"
        )


def check_replaceable(path: Path, overwrite: bool) -> None:
    """Check that a file was made here, or that a folder holds only frames made here.

    Raises
    ------
    VideoError
        If it is, or holds, anything else; with `overwrite` anything but a file or files with the
        names of frames.
    """
    if path.is_file():
        if not (overwrite or made_here(path)):
            raise VideoError(
                f"cannot write {path}: it exists and was not {MARK}; name another file, or add "
                "--overwrite"
            )
        return
    other_files = [
        entry.name
        for entry in path.iterdir()
        if not (is_plain(entry) and _FRAME_PATTERN.fullmatch(entry.name))
    ]
    if other_files:
        raise VideoError(
            f"cannot write frames to {path}: it holds other files ({min(other_files)}); name a new "
            "folder"
        )
    if overwrite:
        return
    other_frames = [entry.name for entry in path.iterdir() if not made_here(entry)]
    if other_frames:
        raise VideoError(
            f"cannot write frames to {path}: it holds frames that were not {MARK} "
            f"({min(other_frames)}); name a new folder, or add --overwrite"
        )


def _check_place(path: Path, form: str, overwrite: bool) -> None:
    """Check that the output can be written at its path.

    Raises `VideoError` if something is in the way, and `OSError` if nothing can be written there.
    """
    is_file = form in ENDINGS
    if path.is_dir():
        if is_file:
            raise VideoError(f"cannot write {path}: it is a folder; name a file")
        if path.is_symlink():  # which no finished folder can replace
            raise VideoError(
                f"cannot write frames to {path}: it is a link; name the folder {final_path(path)}"
            )
        check_replaceable(path, overwrite)
    elif path.exists():
        if not (is_file and path.is_file()):
            raise VideoError(
                f"cannot write {path}: it exists and is not a {'file' if is_file else 'folder'}"
            )
        check_replaceable(final_path(path), overwrite)
    # A link is written through. A file is tried, since permission bits do not tell the truth for
    # root or on a read-only disk.
    folder = next(parent for parent in final_path(path).parents if parent.exists())
    with tempfile.TemporaryFile(dir=folder):
        pass
