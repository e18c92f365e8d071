"""Writing a scene: its TOML file, and an MJCF for a model that exists only in memory."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import msgspec
import mujoco
import numpy as np
from PIL import Image

from .scene_file import SceneFile

# First line of a saved scene file.
_FIRST_LINE = "# Saved by `ripple-sim view`.\n"

# A list of numbers, which tomli_w writes over several lines.
_NUMBERS = re.compile(r"\[\n(?: *[-+.\dein]+,\n)+ *\]")


def write_scene(content: SceneFile, path: Path) -> None:
    """Write the content of a scene file as TOML, without fields that have their default.

    Raises `OSError` if the file cannot be written.
    """
    import tomli_w

    text = _NUMBERS.sub(_in_one_line, tomli_w.dumps(_table(content)))
    path.write_text(_FIRST_LINE + text, encoding="utf-8")


def write_model(spec: mujoco.MjSpec, path: Path) -> None:
    """Write a specification as MJCF.

    Textures without a file become PNG files beside it, and meshes with texture coordinates of the
    triangles' corners, which MJCF cannot hold, OBJ files.

    Raises
    ------
    OSError
        If a file cannot be written.
    ValueError
        If MuJoCo refuses the specification.
    """
    files = {}
    for number, texture in enumerate(spec.textures, 1):
        if len(texture.data):
            texture.file = f"{path.stem}-{number}.png"
            files[texture.file] = _png(texture)
            texture.data = b""
    for number, mesh in enumerate(spec.meshes, 1):
        if len(mesh.userfacetexcoord):
            mesh.file = f"{path.stem}-{number}.obj"
            files[mesh.file] = _obj(mesh)
            for field in ("uservert", "userface", "usertexcoord", "userfacetexcoord"):
                setattr(mesh, field, [])
    spec.assets = files
    spec.compile()
    for name, content in files.items():
        path.with_name(name).write_bytes(content)
    path.write_text(spec.to_xml(), encoding="utf-8")


def _in_one_line(array: re.Match[str]) -> str:
    """A list of numbers in one line."""
    items = " ".join(array[0][1:-1].split())
    return f"[{items.removesuffix(',')}]"


def _png(texture: mujoco.MjsTexture) -> bytes:
    """The pixels of a texture as a PNG file."""
    shape = (texture.height, texture.width, texture.nchannel)
    file = io.BytesIO()
    Image.fromarray(np.frombuffer(texture.data, np.uint8).reshape(shape)).save(file, "png")
    return file.getvalue()


def _obj(mesh: mujoco.MjsMesh) -> bytes:
    """The triangles of a mesh and the texture coordinates of their corners as an OBJ file."""
    vertices = np.reshape(mesh.uservert, (-1, 3))
    places = np.reshape(mesh.usertexcoord, (-1, 2)) * [1.0, -1.0] + [0.0, 1.0]  # v from below
    triangles = np.reshape(mesh.userface, (-1, 3)) + 1
    corners = np.reshape(mesh.userfacetexcoord, (-1, 3)) + 1
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    lines += [f"vt {u:.9g} {v:.9g}" for u, v in places]
    for (a, b, c), (uv_a, uv_b, uv_c) in zip(triangles, corners, strict=True):
        lines.append(f"f {a}/{uv_a} {b}/{uv_b} {c}/{uv_c}")
    return ("\n".join(lines) + "\n").encode()


def _table(entry: msgspec.Struct) -> dict[str, Any]:
    """The fields of a struct that differ from their defaults, for TOML."""
    table = {}
    for field in msgspec.structs.fields(type(entry)):
        value = getattr(entry, field.name)
        default = field.default
        if field.default_factory is not msgspec.NODEFAULT:
            default = field.default_factory()
        if value is not None and value != default:
            table[field.encode_name] = _plain(value)
    return table


def _plain(value: Any) -> Any:
    """A value of a struct, with tables and lists for structs and tuples."""
    if isinstance(value, msgspec.Struct):
        return _table(value)
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value
