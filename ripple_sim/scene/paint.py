"""The colours of a mesh file on a target: an image, or a colour at each vertex."""

from __future__ import annotations

import logging.handlers
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import cKDTree

from ripple_sim.errors import SceneError
from ripple_sim.render.tone_mapping import linear_to_srgb
from ripple_sim.solver import Mesh
from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.images import read_image

# Endings of formats that hold several meshes, and images.
_SCENE_SUFFIXES = (".glb", ".gltf")


def mesh_image(mesh_path: str | Path) -> NDArray[np.uint8] | None:
    """Image of a mesh file, or None.

    It is named in an OBJ's material library or in a GLB, or is the file NAME_texture.png beside the
    mesh. If several images colour one mesh, none is used, with a warning.

    Returns
    -------
    uint8 [height, width, 3], top row first, or None
    """
    mesh_path = Path(mesh_path)
    if mesh_path.suffix.lower() in _SCENE_SUFFIXES:
        images: list[Any] = _embedded(mesh_path)
    else:
        images = _of_materials(mesh_path) if mesh_path.suffix.lower() == ".obj" else []
        images = images or _beside(mesh_path)
    if len(images) > 1:
        warn_caller(
            f"{mesh_path.name} is coloured by {len(images)} images, but a mesh can show only one: "
            "none is used; join them into one image, or choose one with --texture"
        )
    return load_image(images[0]) if len(images) == 1 else None


def _beside(mesh_path: Path) -> list[Path]:
    """The image beside a mesh file that its name belongs to, if there is one."""
    for suffix in (".png", ".jpg", ".jpeg"):
        path = mesh_path.with_name(f"{mesh_path.stem}_texture{suffix}")
        if path.is_file():
            return [path]
    return []


def load_image(source: Any) -> NDArray[np.uint8]:
    """Pixels of an image file or of a PIL image, uint8 [height, width, 3], top row first.

    Raises `SceneError` if the file cannot be read as an image, or is too large.
    """
    return read_image(SceneError, source, "texture", lambda mode: "RGB")


def _of_materials(mesh_path: Path) -> list[Path]:
    """Existing images (map_Kd) of the materials that an OBJ file uses."""
    libraries = []
    used = set()
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


def _statements(path: Path, skipped: str = "vf#") -> Iterator[tuple[str, str]]:
    """Keyword and rest of every line that has both, without those that begin with some letters."""
    with path.open(encoding="utf-8", errors="replace") as lines:
        pairs = (line.split(maxsplit=1) for line in lines if line[:1] not in skipped)
        yield from ((pair[0], pair[1].strip()) for pair in pairs if len(pair) == 2)


def _embedded(mesh_path: Path) -> list[Image.Image]:
    """Base colour images in a GLB or glTF file."""
    # an image beyond pillow's limit is logged, at the lowest level, and left out
    log = logging.getLogger("trimesh")
    heard = logging.handlers.BufferingHandler(sys.maxsize)
    level = log.level
    log.addHandler(heard)
    log.setLevel(logging.DEBUG)
    try:
        parts = trimesh.load_scene(mesh_path).geometry.values()
    finally:
        log.removeHandler(heard)
        log.setLevel(level)
    for error in (record.exc_info[1] for record in heard.buffer if record.exc_info):
        if isinstance(error, Image.DecompressionBombError):
            raise SceneError(f"an image in {mesh_path.name} cannot be read: {error} Scale it down")
    materials = (getattr(part.visual, "material", None) for part in parts)
    images = (getattr(material, "baseColorTexture", None) for material in materials)
    return list({id(image): image for image in images if image is not None}.values())


def vertex_colors(mesh_path: str | Path) -> tuple[NDArray[np.float64], NDArray[np.uint8]] | None:
    """Vertices [n, 3] of a PLY, OBJ, GLB or glTF file, and their colours, sRGB [n, 3], or None.

    A colour of a face counts as a colour of its corners. Parts without colours, in a file that has
    some, are white. Without any colours the result is None.
    """
    mesh_path = Path(mesh_path)
    if not _may_be_coloured(mesh_path):
        return None
    scene = trimesh.load_scene(mesh_path, process=False)
    points = []
    colors = []
    coloured = False
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        part = scene.geometry[name]
        visual = part.visual
        found = visual.vertex_attributes.get("color") if hasattr(visual, "material") else None
        if found is None and visual.kind in ("vertex", "face"):
            found = visual.vertex_colors
        coloured |= found is not None
        points.append(trimesh.transform_points(part.vertices, transform))
        if found is None:
            colors.append(_bytes(np.ones((len(part.vertices), 3))))
        else:
            colors.append(_bytes(np.asarray(found)[:, :3]))
    if not coloured:
        return None
    together = np.concatenate(colors)
    # their colours are linear light (glTF 2.0, section 3.7.2.1)
    if mesh_path.suffix.lower() in _SCENE_SUFFIXES:
        together = _bytes(linear_to_srgb(together / 255))
    return np.concatenate(points), together


def _bytes(colors: NDArray) -> NDArray[np.uint8]:
    """Colours as bytes; integers have their type's range, and floats that from 0 to 1."""
    most = np.iinfo(colors.dtype).max if colors.dtype.kind == "u" else 1
    return np.rint(255 * np.clip(colors / most, 0, 1)).astype(np.uint8)


def _may_be_coloured(mesh_path: Path) -> bool:
    """Whether a file's beginning, or its format, leaves room for colours."""
    kind = mesh_path.suffix.lower()
    if kind == ".obj":
        vertices = (words for words in _statements(mesh_path, skipped="f#") if words[0] == "v")
        return len(next(vertices, ("", ""))[1].split()) >= 6
    with mesh_path.open("rb") as file:
        return kind in _SCENE_SUFFIXES or (kind == ".ply" and b"red" in file.read(4096))


def _baked(
    F: NDArray[np.int64], colors: NDArray[np.uint8]
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """An image of colours at vertices [n, 3], and texture coordinates of the corners, [m, 3, 2].

    Each triangle has four pixels, between whose middles it lies, so that the texture unit blends
    its corners.
    """
    side = int(np.ceil(np.sqrt(len(F))))
    row, column = np.divmod(np.arange(len(F)), side)
    a, b, c = np.moveaxis(colors[F].astype(np.float64), 1, 0)
    pixels = np.zeros((side, 2, side, 2, 3))
    for (down, right), color in zip(np.ndindex(2, 2), (a, b, c, b + c - a), strict=True):
        pixels[row, down, column, right] = color
    corners = np.stack([column, row], axis=1)[:, None] + [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75]]
    image = np.clip(pixels, 0, 255).astype(np.uint8).reshape(2 * side, 2 * side, 3)
    return image, corners / side * [1.0, -1.0] + [0.0, 1.0]


def paint_target(
    spec: mujoco.MjSpec, mesh: Mesh, mesh_path: str | Path, texture: str | Path | None
) -> None:
    """Give the geom "target" its colours.

    They are those of the image that is asked for, of the image that the mesh names, or of the
    mesh's vertices. Raises `SceneError` if an image that is asked for cannot be read, or the mesh
    has no texture coordinates.
    """
    painting = _painting(mesh, mesh_path, texture)
    if painting is None:
        return
    pixels, corner_uv = painting
    asset = spec.mesh("target")
    # MuJoCo counts v from the image's upper edge
    asset.usertexcoord = (corner_uv * [1.0, -1.0] + [0.0, 1.0]).ravel()
    asset.userfacetexcoord = np.arange(mesh.F.size)
    height, width, channels = pixels.shape
    image = spec.add_texture(
        name="target",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        height=height,
        width=width,
        nchannel=channels,
    )
    image.data = pixels.tobytes()
    spec.add_material(name="target").textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "target"
    spec.geom("target").material = "target"


def _painting(
    mesh: Mesh, mesh_path: str | Path, texture: str | Path | None
) -> tuple[NDArray[np.uint8], NDArray[np.float64]] | None:
    """Image and corners' texture coordinates of a mesh, [m, 3, 2]; None if it is uncoloured."""
    pixels = None
    if texture is not None:
        if mesh.corner_uv is None:
            raise SceneError(
                f"texture {str(texture)!r} cannot be shown on {str(mesh_path)!r}, which has no "
                "texture coordinates: choose a mesh that has them (a wrap has none)"
            )
        pixels = load_image(texture)
    elif mesh.corner_uv is not None:
        pixels = mesh_image(mesh_path)
    if pixels is not None and mesh.corner_uv is not None:
        return pixels, mesh.corner_uv
    coloured = vertex_colors(mesh_path)
    if coloured is None:
        return None
    points, colors = coloured
    _, nearest = cKDTree(points).query(mesh.V)
    return _baked(mesh.F, colors[nearest])
