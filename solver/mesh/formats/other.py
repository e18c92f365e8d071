"""Mesh files of other formats, such as FBX, COLLADA, 3DS and X3D, by assimp, or else by trimesh.

assimp-py is an optional package. It runs in a process of its own, see `assimp_program`. trimesh
gives the triangles alone.
"""

from __future__ import annotations

import importlib.util
import json
import logging
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from ...errors import MeshError
from ..looks import BLEND, OPAQUE, ImageSource, Looks, Paint, linear_light
from ..soup import Soup
from .mtl import found_file

# Endings of formats that assimp reads and that are seen.
ASSIMP_ENDINGS = (
    ".3ds",
    ".3mf",
    ".ac",
    ".amf",
    ".ase",
    ".b3d",
    ".bvh",
    ".cob",
    ".dae",
    ".fbx",
    ".iqm",
    ".lwo",
    ".lws",
    ".lxo",
    ".md2",
    ".md3",
    ".md5mesh",
    ".mdl",
    ".ms3d",
    ".nff",
    ".pmx",
    ".q3o",
    ".sib",
    ".smd",
    ".ter",
    ".x",
    ".x3d",
    ".xgl",
)

# How to install assimp-py, for messages.
_INSTALL = "pip install 'ripple-sim[formats]'"

# Time that assimp may take [s]: a hundred megabytes take a few seconds.
_TIME_LIMIT = 120

# Archives are refused: a few kilobytes may unpack to any number of gigabytes.
_ARCHIVES = ("zip", "bz2", "tar.gz", "tar.bz2")

# trimesh logs whole tracebacks; without a handler Python prints them to stderr
logging.getLogger("trimesh").addHandler(logging.NullHandler())


def read_other(path: Path) -> Soup:
    """Triangles of a file that assimp or trimesh reads.

    Raises `MeshError` if the format is unknown, its package is missing, or the file is damaged.
    """
    ending = path.suffix.lower()
    if ending in ASSIMP_ENDINGS:
        if importlib.util.find_spec("assimp_py") is not None:
            return _by_assimp(path)
        if ending[1:] not in trimesh.available_formats():
            raise MeshError(f"{ending} files need the package assimp-py: run {_INSTALL}")
    if ending[1:] not in trimesh.available_formats() or ending[1:] in _ARCHIVES:
        raise MeshError(
            f"mesh file {str(path)!r} has an unknown ending: mesh files must end in .obj, .off, "
            f".ply, .stl, .glb or .gltf, unpacked, or with {_INSTALL} in "
            f"{', '.join(ASSIMP_ENDINGS)}"
        )
    with path.open("rb"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return _parts(trimesh.load_scene(path, process=False))


def _by_assimp(path: Path) -> Soup:
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "target.npz"
        # -P: modules beside the program must not hide the standard library's
        program = str(Path(__file__).with_name("assimp_program.py"))
        command = [sys.executable, "-P", program, str(path.resolve()), str(target)]
        try:
            subprocess.run(
                command,
                check=True,
                capture_output=True,
                stdin=subprocess.DEVNULL,
                timeout=_TIME_LIMIT,
            )
        except subprocess.TimeoutExpired as error:
            raise MeshError(f"assimp did not finish within {_TIME_LIMIT} s") from error
        except subprocess.CalledProcessError as error:
            reason = _reason(error.stderr.decode(errors="replace"))
            raise MeshError(f"assimp cannot read it: {reason}") from error
        with np.load(target) as arrays:
            return _soup(path, dict(arrays))


def _reason(said: str) -> str:
    """Why assimp failed, of what the program wrote to stderr."""
    lines = said.strip().splitlines()
    if not lines:
        return "it is damaged"
    _, _, message = lines[-1].partition(": ")
    if "triangulated faces" in message:
        return "it holds points or lines"
    if message.startswith("Assimp error loading"):  # and the path
        message = message.partition("': ")[2]
    return message.strip()[:200] or "it holds no mesh"


def _soup(path: Path, arrays: dict[str, NDArray]) -> Soup:
    """Triangles of what the program wrote."""
    F = arrays["F"]
    uv = arrays["uv"][F]
    corner_uv = np.nan_to_num(uv) if np.isfinite(uv).any() else None
    colors = None
    if np.isfinite(arrays["colors"]).any():
        white = np.where(np.isfinite(arrays["colors"]), arrays["colors"], 1.0)
        colors = linear_light(white)[F]
    materials = json.loads(str(arrays["materials"]))
    paints = tuple(_paint(path, material) for material in materials)
    words = sorted({word for material in materials for word in material["not_shown"]})
    notes = (f"not shown of its materials: {', '.join(words)}",) if words else ()
    looks = Looks(paints, arrays["material"], colors, notes) if paints and len(F) else None
    return Soup(arrays["V"], F, corner_uv, (), looks)


def _paint(path: Path, material: dict[str, Any]) -> Paint:
    image = _image(path, material["image"])
    red, green, blue = linear_light(np.array(material["color"])).tolist()
    if image is not None and max(red, green, blue) == 0:
        red = green = blue = 1.0
    # files of several programs say 0 where they mean nothing
    opacity = material["opacity"] or 1.0
    emission_red, emission_green, emission_blue = linear_light(
        np.clip(material["emission"], 0.0, 1.0)
    ).tolist()
    return Paint(
        (red, green, blue, opacity),
        image,
        alpha=BLEND if opacity < 1 else OPAQUE,
        emission=(emission_red, emission_green, emission_blue),
        emission_image=_image(path, material["emission_image"]),
    )


def _image(path: Path, name: str | None) -> ImageSource | None:
    """The image of a name in a file, if there is one."""
    if name is None:
        return None
    source = found_file([path.parent], name) or path.parent / name.replace("\\", "/")
    return ImageSource(source, name if not name.startswith("*") else f"inside the file ({name})")


def _parts(scene: trimesh.Scene) -> Soup:
    """All triangle meshes of a scene, each where its node puts it, without their looks."""
    V = [np.empty((0, 3))]
    F = [np.empty((0, 3), np.int64)]
    vertex_count = 0
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        part = scene.geometry[name]
        triangles = np.asarray(getattr(part, "faces", ()), dtype=np.int64).reshape(-1, 3)
        vertices = np.asarray(part.vertices, dtype=np.float64).reshape(-1, 3)
        if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(vertices):
            raise MeshError(
                f"the vertices of triangles must be 0 to {len(vertices) - 1}, got {triangles.max()}"
            )
        F.append(triangles + vertex_count)
        # transforming by the identity would still round
        if not np.array_equal(transform, np.eye(4)):
            vertices = trimesh.transform_points(vertices, transform)
        V.append(vertices)
        vertex_count += len(vertices)
    return Soup(np.concatenate(V), np.concatenate(F))
