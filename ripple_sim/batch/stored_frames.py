"""Frames and passes of a finished scene, read back."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Protocol

import av
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageSequence

from ripple_sim.errors import BatchError


class Files(Protocol):
    """The files of a scene."""

    number: int

    def names(self) -> list[str]:
        """Their names."""

    def read(self, name: str) -> bytes:
        """Content of one of them."""


def stored_frames(scene: Files) -> Iterator[NDArray[np.uint8]]:
    """The frames of a scene's video or folder of PNG frames, [height, width, 3].

    Raises
    ------
    BatchError
        If there are none.
    """
    images = [name for name in scene.names() if name.startswith("frames") and name.endswith(".png")]
    for name in images:
        yield np.asarray(Image.open(io.BytesIO(scene.read(name))).convert("RGB"))
    if images:
        return
    video = next((name for name in scene.names() if name.startswith("video.") and name.count(".") == 1), None)
    if video is None:
        raise BatchError(f"scene {scene.number} has no video and no PNG frames; it has {', '.join(scene.names())}")
    content = io.BytesIO(scene.read(video))
    if video.endswith((".gif", ".webp")):
        for frame in ImageSequence.Iterator(Image.open(content)):
            yield np.asarray(frame.convert("RGB"))
        return
    with av.open(content) as container:
        for decoded in container.decode(video=0):
            yield decoded.to_ndarray(format="rgb24")


def stored_passes(scene: Files) -> Iterator[dict[str, NDArray]]:
    """The passes of each frame of a scene by their names.

    Raises
    ------
    BatchError
        If there are none.
    """
    names = [name for name in scene.names() if "passes" in name and name.endswith(".npz")]
    if not names:
        raise BatchError(f"scene {scene.number} has no passes in .npz files; it has {', '.join(scene.names())}")
    for name in names:
        with np.load(io.BytesIO(scene.read(name))) as arrays:
            yield {each: arrays[each] for each in arrays.files}
