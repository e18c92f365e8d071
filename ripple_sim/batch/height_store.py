"""The heights of a scene's targets over time: a Zarr group in a zip file."""

from __future__ import annotations

import io
import re
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

HEIGHTS = "heights.zarr.zip"

_ALWAYS = (1980, 1, 1, 0, 0, 0)  # the time of every file in the zip file: the same heights, the same bytes


class HeightWriter:
    """Writes `heights.zarr.zip`: an array `height_TARGET` a target, [frames, C, n, n] float32, in metres.

    Parameters
    ----------
    folder : path
        Of the scene.
    frames : int
        How many there will be.
    rate : float
        Frames in a second of the scene's time.
    """

    def __init__(self, folder: Path, frames: int, rate: float) -> None:
        import zarr

        self._folder, self._frames = folder / "heights.zarr", frames
        self._group = zarr.open_group(str(self._folder), mode="w", zarr_format=2)
        self._arrays: dict[str, Any] = {}
        self._create("time", np.arange(frames) / rate, (frames,), ["time"], "s")[...] = np.arange(frames) / rate

    def write(self, frame: int, heights: Mapping[str, NDArray]) -> None:
        """Add the heights of a frame, by target."""
        for name, height in heights.items():
            array = self._arrays.get(name)
            if array is None:
                suffix = re.sub(r"\W", "_", name)
                dimensions = ["time", *(f"{each}_{suffix}" for each in ("chart", "row", "column"))]
                array = self._create(f"height_{suffix}", height, (self._frames, *height.shape), dimensions, "m")
                array.attrs["target"] = name
                self._arrays[name] = array
            array[frame] = height

    def finish(self) -> None:
        """Complete the file."""
        import zarr

        zarr.consolidate_metadata(self._group.store)
        with zipfile.ZipFile(self._folder.with_name(HEIGHTS), "w") as file:
            for path in sorted(path for path in self._folder.rglob("*") if path.is_file()):
                file.writestr(zipfile.ZipInfo(path.relative_to(self._folder).as_posix(), _ALWAYS), path.read_bytes())
        shutil.rmtree(self._folder)

    def _create(self, name: str, like: NDArray, shape: tuple[int, ...], dimensions: list[str], unit: str) -> Any:
        """An array with a frame a chunk, so that memory does not grow with the scene."""
        chunks = (1, *shape[1:]) if len(shape) > 1 else shape
        array = self._group.create_array(name, shape=shape, dtype=like.dtype, chunks=chunks, fill_value=None)
        array.attrs.update({"_ARRAY_DIMENSIONS": dimensions, "units": unit})
        return array


def read_heights(content: bytes) -> dict[str, NDArray]:
    """The heights in a `heights.zarr.zip`, [frames, C, n, n] in metres, by target."""
    import zarr
    from zarr.buffer import cpu

    with zipfile.ZipFile(io.BytesIO(content)) as file:
        stored = {name: cpu.Buffer.from_bytes(file.read(name)) for name in file.namelist()}
    group = zarr.open_group(zarr.storage.MemoryStore(stored), mode="r", zarr_format=2)
    return {str(array.attrs["target"]): array[...] for name, array in group.arrays() if name != "time"}
