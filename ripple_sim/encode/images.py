"""Files of passes: one a frame, NumPy's .npz or OpenEXR, in a folder beside the video."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import EncodingError, VideoError
from ripple_sim.solver.files import final_path

from .exr import check_exr
from .mark import MARK, made_here

PASSES = ("depth", "normal", "segmentation", "flow", "position", "height")
PASS_FORMATS = ("npz", "exr")
_NAME = re.compile(rf"passes_\d{{5,}}\.({'|'.join(PASS_FORMATS)})|segmentation\.json")
_CHANNELS = {"normal": "XYZ", "position": "XYZ", "flow": "XY"}  # of an EXR; one channel has the pass's own name


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
    """

    def __init__(self, video: Path, form: str, geoms: Mapping[int, str]) -> None:
        self._video, self._form = video, form
        self.folder = passes_folder(video)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            for each in self.folder.iterdir():  # of an earlier run; they were looked at
                each.unlink()
            text = json.dumps({"software": MARK, "geoms": {str(k): name for k, name in geoms.items()}}, indent=1)
            self._write(self.folder / "segmentation.json", text.encode())
        except OSError as error:
            raise self._error(error) from error

    def write(self, frame: int, passes: Mapping[str, NDArray]) -> None:
        """Write the passes of a frame, by name, [height, width] or [height, width, 2 or 3].

        Raises
        ------
        EncodingError
            If they cannot be written.
        """
        path = self.folder / f"passes_{frame:05d}.{self._form}"
        unfinished = path.with_name(f".{path.name}")
        try:
            (_write_npz if self._form == "npz" else _write_exr)(unfinished, passes)
            unfinished.replace(path)
        except OSError as error:
            unfinished.unlink(missing_ok=True)
            raise self._error(error) from error

    def _write(self, path: Path, content: bytes) -> None:
        unfinished = path.with_name(f".{path.name}")
        unfinished.write_bytes(content)
        unfinished.replace(path)

    def _error(self, error: OSError) -> EncodingError:
        return EncodingError(f"cannot write passes to {self.folder}: {error.strerror or error}")


def passes_folder(video: Path) -> Path:
    """Folder of the passes of a video."""
    video = final_path(video)
    return video.with_name(f"{video.stem if video.suffix else video.name}.passes")


def check_passes(video: Path, passes: tuple[str, ...], form: str, overwrite: bool) -> None:
    """Make sure that passes can be written beside a video.

    Raises
    ------
    VideoError
        If there is no such pass or format, OpenEXR is missing, or the folder holds anything that was not made here.
    """
    if unknown := [name for name in passes if name not in PASSES]:
        raise VideoError(f"there is no pass {unknown[0]!r}; valid are {', '.join(PASSES)}")
    if form not in PASS_FORMATS:
        raise VideoError(f"pass format is {form!r}; valid is {' or '.join(map(repr, PASS_FORMATS))}")
    if form == "exr":
        check_exr()
    folder = passes_folder(video)
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise VideoError(f"cannot write passes to {folder}: it is not a folder; name another output")
    for each in folder.iterdir() if folder.is_dir() else ():
        named = each.is_file() and not each.is_symlink() and _NAME.fullmatch(each.name.lstrip("."))
        if not named or not (overwrite or made_here(each)):
            raise VideoError(
                f"cannot write passes to {folder}: it holds other files ({each.name}); name another output"
            )


def _write_npz(path: Path, passes: Mapping[str, NDArray]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.comment = MARK.encode()
        for name, values in passes.items():
            # the same passes give the same file: without the time of day
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as file:
                np.lib.format.write_array(file, values)


def _write_exr(path: Path, passes: Mapping[str, NDArray]) -> None:
    import OpenEXR

    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "software": MARK}
    channels = {}
    for name, values in passes.items():
        for index, axis in enumerate(_CHANNELS.get(name, "")):
            channels[f"{name}.{axis}"] = np.ascontiguousarray(values[..., index])
        if name not in _CHANNELS:
            channels[name] = np.ascontiguousarray(values)
    file = io.BytesIO()
    OpenEXR.File(header, channels).write(file)
    path.write_bytes(file.getbuffer())
