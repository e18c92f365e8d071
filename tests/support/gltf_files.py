"""Small glTF files, written by hand: a square of two triangles, or what a test adds."""

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
SQUARE_UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)
TRIANGLES = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint8)

_COMPONENTS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def png(pixels: Any) -> bytes:
    """A PNG file of pixels."""
    file = io.BytesIO()
    Image.fromarray(np.asarray(pixels, np.uint8)).save(file, "PNG")
    return file.getvalue()


class Gltf:
    """A file that grows: each method adds an entry and returns its index."""

    def __init__(self, **root: Any) -> None:
        self.root: dict[str, Any] = {"asset": {"version": "2.0"}, **root}
        self.data = b""

    def add(self, kind: str, **entry: Any) -> int:
        self.root.setdefault(kind, []).append(entry)
        return len(self.root[kind]) - 1

    def view(self, data: bytes, **more: Any) -> int:
        self.data += bytes(-len(self.data) % 4)
        offset = len(self.data)
        self.data += data
        return self.add("bufferViews", buffer=0, byteOffset=offset, byteLength=len(data), **more)

    def accessor(self, elements: Any, **more: Any) -> int:
        array = np.asarray(elements)
        array = array[:, None] if array.ndim == 1 else array
        return self.add(
            "accessors",
            bufferView=self.view(array.tobytes()),
            componentType=_COMPONENTS[array.dtype.str[1:]],
            count=len(array),
            type=_TYPES[array.shape[1]],
            **more,
        )

    def texture(self, pixels: Any, **sampler: int) -> int:
        image = self.add("images", bufferView=self.view(png(pixels)), mimeType="image/png")
        return self.add("textures", source=image, sampler=self.add("samplers", **sampler))

    def primitive(
        self, points: Any = SQUARE, triangles: Any = TRIANGLES, mode: int = 4, **more: Any
    ) -> dict[str, Any]:
        """A primitive; `more` are attributes in capitals, and other entries."""
        attributes = {"POSITION": self.accessor(np.asarray(points, np.float32))}
        attributes |= {name: value for name, value in more.items() if name.isupper()}
        others = {name: value for name, value in more.items() if not name.isupper()}
        primitive: dict[str, Any] = {"attributes": attributes, "mode": mode, **others}
        if triangles is not None:
            primitive["indices"] = self.accessor(triangles)
        return primitive

    def show(self, *primitives: dict[str, Any], mesh: dict | None = None, **node: Any) -> int:
        """A node of the scene with a mesh of primitives."""
        number = self.add("meshes", primitives=list(primitives), **(mesh or {}))
        index = self.add("nodes", mesh=number, **node)
        self.root.setdefault("scenes", [{"nodes": []}])[0]["nodes"].append(index)
        return index

    def write(self, path: Path) -> Path:
        """Write the binary container."""
        self.root["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(self.root).encode()
        text += b" " * (-len(text) % 4)
        data = self.data + bytes(-len(self.data) % 4)
        length = 12 + 8 + len(text) + 8 + len(data)
        path.write_bytes(
            struct.pack("<4sII", b"glTF", 2, length)
            + struct.pack("<I4s", len(text), b"JSON")
            + text
            + struct.pack("<I4s", len(data), b"BIN\0")
            + data
        )
        return path
