"""The image that belongs to a mesh file's texture coordinates."""

from __future__ import annotations

import logging
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.errors import RippleWarning, SceneError
from ripple_sim.solver.files import read_image

_SUFFIXES = (".png", ".jpg", ".jpeg")
_SCENES = (".glb", ".gltf")


def mesh_image(mesh_path: str | Path) -> NDArray[np.uint8] | None:
    """Image of a mesh file, or None: named in an OBJ's material library or in a GLB, or NAME_texture.png beside it.

    If several images colour one mesh, none is used, with a warning.

    Returns
    -------
    uint8 [height, width, 3], top row first, or None
    """
    mesh_path = Path(mesh_path)
    if mesh_path.suffix.lower() in _SCENES:
        found: list[Any] = _embedded(mesh_path)
    else:
        named = _of_materials(mesh_path) if mesh_path.suffix.lower() == ".obj" else []
        beside = [mesh_path.with_name(f"{mesh_path.stem}_texture{suffix}") for suffix in _SUFFIXES]
        found = named or [path for path in beside if path.is_file()][:1]
    if len(found) > 1:
        warnings.warn(
            f"{mesh_path.name} is coloured by {len(found)} images, but a mesh can show only one: none is used; join "
            "them into one image, or choose one with --texture",
            RippleWarning,
            stacklevel=3,
        )
    return load_image(found[0]) if len(found) == 1 else None


def load_image(source: Any) -> NDArray[np.uint8]:
    """Pixels of an image file or of a PIL image, uint8 [height, width, 3], top row first.

    Raises
    ------
    SceneError
        If the file cannot be read as an image, or is too large.
    """
    return read_image(SceneError, source, "texture", lambda mode: "RGB")


def _of_materials(mesh_path: Path) -> list[Path]:
    """Existing images (map_Kd) of the materials that an OBJ file uses."""
    libraries, used = [], set()
    for words in _statements(mesh_path):
        if words[0] == "mtllib":
            libraries.append(mesh_path.parent / words[1])
        elif words[0] == "usemtl":
            used.add(words[1])
    images: dict[Path, None] = {}
    for library in filter(Path.is_file, libraries):
        material = ""
        for words in _statements(library):
            if words[0] == "newmtl":
                material = words[1]
            elif words[0] == "map_Kd" and (material in used or not used):
                # options come first, and the file's name may have spaces and backslashes
                name = words[1].replace("\\", "/")
                path = library.parent / (name if not name.startswith("-") else name.split()[-1])
                if path.is_file():
                    images[path] = None
    return list(images)


def _statements(path: Path) -> list[tuple[str, str]]:
    """Keyword and rest of every line that has both."""
    text = path.read_text(encoding="utf-8", errors="replace")
    pairs = (line.strip().split(maxsplit=1) for line in text.splitlines() if line[:1] not in "vf#")
    return [(pair[0], pair[1].strip()) for pair in pairs if len(pair) == 2]


def _embedded(mesh_path: Path) -> list[Image.Image]:
    """Base colour images in a GLB or glTF file."""
    bombs, log = _Bombs(), logging.getLogger("trimesh")
    level = log.level
    log.addHandler(bombs)
    log.setLevel(logging.DEBUG)
    try:
        parts = trimesh.load_scene(mesh_path).geometry.values()
    finally:
        log.removeHandler(bombs)
        log.setLevel(level)
    if bombs.first is not None:
        raise SceneError(f"an image in {mesh_path.name} cannot be read: {bombs.first} Scale it down")
    materials = {
        id(material): material for part in parts if (material := getattr(part.visual, "material", None)) is not None
    }
    images = (getattr(material, "baseColorTexture", None) for material in materials.values())
    return list({id(image): image for image in images if image is not None}.values())


class _Bombs(logging.Handler):
    """Hears of images beyond pillow's limit, which trimesh logs and leaves out."""

    first: BaseException | None = None

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the first."""
        error = record.exc_info[1] if record.exc_info else None
        if self.first is None and isinstance(error, Image.DecompressionBombError):
            self.first = error
