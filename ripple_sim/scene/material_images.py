"""`MaterialImages`: the images of a mesh's materials, decoded, and a note on lost ones."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import shown
from ripple_sim.solver.images import read_image
from ripple_sim.solver.mesh.looks import ImageSource, Paint

# First bytes of KTX2 files, whose images are compressed for graphics cards.
_KTX2 = b"\xabKTX 20\xbb"

# Largest number of lost images that a message names.
_MAX_NAMES = 3


def load_image(source: Any) -> NDArray[np.uint8]:
    """Pixels of an image file or of a PIL image, uint8 [height, width, 3], top row first.

    Raises `SceneError` if the file cannot be read as an image, or is too large.
    """
    return read_image(SceneError, source, "texture", lambda mode: "RGB")


def image_pixels(image: ImageSource) -> NDArray[np.uint8]:
    """Pixels of an image, uint8 [height, width, 4], sRGB and opacity, top row first.

    Raises `SceneError` if the image is missing or cannot be read.
    """
    source = image.source
    if isinstance(source, Path):
        try:
            exists = source.is_file()
        except (OSError, ValueError):  # a name that the system does not allow
            exists = False
        if not exists:
            raise SceneError(f"{shown(image.name)} is missing")
        try:
            source = source.read_bytes()
        except OSError as error:
            raise SceneError(f"{shown(image.name)} cannot be read: {error.strerror}") from error
    if source.startswith(_KTX2):
        raise SceneError(f"{shown(image.name)} is KTX2 (Basis Universal), which is not read")
    return read_image(SceneError, source, f"image {shown(image.name)}", lambda mode: "RGBA")


@dataclasses.dataclass
class MaterialImages:
    """Decodes the images of materials, each once, and records those that are lost."""

    _pixels: dict[ImageSource, NDArray[np.uint8] | None] = dataclasses.field(default_factory=dict)
    _lost: dict[str, str] = dataclasses.field(default_factory=dict)
    _names: set[str] = dataclasses.field(default_factory=set)

    def of(self, paint: Paint) -> NDArray[np.uint8] | None:
        """The image of a material with its opacity, [height, width, 4], or None."""
        color = self._decoded(paint.image)
        mask = self._decoded(paint.opacity)
        if mask is None:
            return color
        if color is None:
            color = np.full((*mask.shape[:2], 4), 255, np.uint8)
        brightness = Image.fromarray(mask).convert("L").resize(color.shape[1::-1])
        return np.dstack([color[..., :3], np.asarray(brightness)])

    def gloss(self, paint: Paint) -> tuple[float, float]:
        """Mean factors of metallic and roughness of a material's image."""
        pixels = self._decoded(paint.gloss)
        if pixels is None:
            return 1.0, 1.0
        _, roughness, metallic, _ = pixels.mean(axis=(0, 1)) / 255
        return float(metallic), float(roughness)

    def _decoded(self, image: ImageSource | None) -> NDArray[np.uint8] | None:
        """Pixels of an image; None without one, or if it is lost."""
        if image is None:
            return None
        self._names.add(image.name)
        if image not in self._pixels:
            try:
                self._pixels[image] = image_pixels(image)
            except SceneError as error:
                self._pixels[image] = None
                self._lost[image.name] = str(error)
        return self._pixels[image]

    def notes(self) -> tuple[str, ...]:
        """One line on the images that are lost, if there are any."""
        if not self._lost:
            return ()
        reasons = list(self._lost.values())
        listed = ", ".join(reasons[:_MAX_NAMES])
        if len(reasons) > _MAX_NAMES:
            listed += ", ..."
        count = len(self._names)
        noun = "image" if count == 1 else "images"
        verb = "is" if len(reasons) == 1 else "are"
        return (f"{len(reasons)} of {count} {noun} {verb} not shown: {listed}",)
