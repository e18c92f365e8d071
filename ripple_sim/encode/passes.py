"""The passes of a video: one file a frame, .npz or OpenEXR, in a folder beside the video."""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import EncodingError, VideoError
from ripple_sim.solver.files import final_path

from .exr import _write_channels, check_exr
from .replace import MARK, check_folder, made_here, read_object

PASSES = ("depth", "normal", "segmentation", "flow", "position", "height")
PASS_FORMATS = ("npz", "exr")

# File that says whose passes a folder holds, and what the numbers of the segmentation mean.
_CONTENTS = "segmentation.json"

# Names of the files in a folder of passes.
_NAME = re.compile(rf"passes_\d{{5,}}\.({'|'.join(PASS_FORMATS)})|{re.escape(_CONTENTS)}")

# Channels of a pass in an EXR file. A pass with one channel gives it its own name.
_CHANNELS = {"normal": "XYZ", "position": "XYZ", "flow": "XY"}


class PassFiles:
    """Writes the passes of frames.

    Parameters
    ----------
    video : Path
        Beside which the folder `NAME.passes` stands, NAME without an ending.
    form : str
        One of `PASS_FORMATS`.
    geoms : mapping
        Name of what each number of the segmentation stands for.
    frames : int
        Frames that the video has already, where its render is resumed: their passes stay.
    overwrite : bool
        Replace what `check_passes` would refuse.

    Attributes
    ----------
    complete : int
        The first so many frames have their passes.
    """

    def __init__(
        self,
        video: Path,
        form: str,
        geoms: Mapping[int, str],
        frames: int = 0,
        overwrite: bool = False,
    ) -> None:
        self._video = video
        self._form = form
        self._geoms = geoms
        self._overwrite = overwrite
        self.folder = passes_folder(video)
        self.complete = 0
        while self.complete < frames and self._path(self.complete).exists():
            self.complete += 1

    def begin(self) -> None:
        """Remove the passes of an earlier run, and record whose passes come now.

        Call it before the first frame that has passes.

        Raises `VideoError` if the folder has become another's since `check_passes`, and
        `EncodingError` if it cannot be written.
        """
        _check_folder(self._video, self._overwrite)  # again: to set up a scene takes long
        complete = {self._path(frame) for frame in range(self.complete)}
        contents = {
            "software": MARK,
            "video": final_path(self._video).name,
            "geoms": {str(number): name for number, name in self._geoms.items()},
        }
        text = json.dumps(contents, indent=1)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            for file in {*self.folder.iterdir()} - complete:
                file.unlink()
        except OSError as error:
            raise self._error(error) from error
        self._write(self.folder / _CONTENTS, lambda path: path.write_text(text, encoding="utf-8"))

    def write(self, frame: int, passes: Mapping[str, NDArray]) -> None:
        """Write the passes of a frame, by name, [height, width] or [height, width, 2 or 3].

        Raises `EncodingError` if they cannot be written.
        """
        write = _write_npz if self._form == "npz" else _write_exr
        self._write(self._path(frame), lambda path: write(path, passes))

    def _path(self, frame: int) -> Path:
        return self.folder / f"passes_{frame:05d}.{self._form}"

    def _write(self, path: Path, write: Callable[[Path], object]) -> None:
        unfinished = path.with_name(f".{path.name}")
        try:
            write(unfinished)
            unfinished.replace(path)
        except OSError as error:
            unfinished.unlink(missing_ok=True)
            raise self._error(error) from error

    def _error(self, error: OSError) -> EncodingError:
        return EncodingError(f"cannot write passes to {self.folder}: {error.strerror or error}")


def passes_folder(video: Path) -> Path:
    """Folder of the passes of a video."""
    video = final_path(video)
    return video.with_name(f"{video.stem if video.suffix else video.name}.passes")


def check_passes(video: Path, passes: tuple[str, ...], form: str, overwrite: bool) -> None:
    """Make sure that passes can be written beside a video.

    Raises `VideoError` if there is no such pass or format, OpenEXR is missing, or the folder holds
    the passes of another video or anything that was not made here.
    """
    unknown = [name for name in passes if name not in PASSES]
    if unknown:
        raise VideoError(f"there is no pass {unknown[0]!r}; passes are {', '.join(PASSES)}")
    if form not in PASS_FORMATS:
        raise VideoError(
            f"pass format must be {' or '.join(map(repr, PASS_FORMATS))}, got {form!r}"
        )
    if form == "exr":
        check_exr()
    _check_folder(video, overwrite)


def _check_folder(video: Path, overwrite: bool) -> None:
    """Check that a folder of passes holds only passes of this video that were made here.

    Raises `VideoError` otherwise.
    """
    folder = passes_folder(video)

    def is_ours(file: Path) -> bool:
        if _NAME.fullmatch(file.name.lstrip(".")) is None:
            return False
        is_unfinished = file.name.startswith(".")  # a kill left it, perhaps without its mark
        return is_unfinished or overwrite or made_here(file)

    check_folder(VideoError, "passes", folder, is_ours)
    # None: the folder does not say whose it is
    owner = read_object(folder / _CONTENTS).get("video")
    if owner not in (None, final_path(video).name) and not overwrite:
        raise VideoError(
            f"cannot write passes to {folder}: they are those of {owner}; name another output, or "
            "add --overwrite"
        )


def _write_npz(path: Path, passes: Mapping[str, NDArray]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.comment = MARK.encode()
        for name, values in passes.items():
            # the same passes give the same file: without the time of day
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as file:
                np.lib.format.write_array(file, values)


def _write_exr(path: Path, passes: Mapping[str, NDArray]) -> None:
    channels = {}
    for name, values in passes.items():
        for index, axis in enumerate(_CHANNELS.get(name, "")):
            channels[f"{name}.{axis}"] = values[..., index]
        if name not in _CHANNELS:
            channels[name] = values
    _write_channels(path, channels)
