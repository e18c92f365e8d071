"""The container of a glTF 2.0 file: its JSON, buffers, accessors and images.

Section numbers are those of the glTF 2.0 specification (Khronos, ISO/IEC 12113:2022).
"""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from ...errors import MeshError
from ...memory import require_memory
from ..looks import ImageSource

# The first bytes of the binary container, and the types of its chunks (section 4.4).
_MAGIC = b"glTF"
_JSON_CHUNK = 0x4E4F534A
_BINARY_CHUNK = 0x004E4942

# NumPy's name of each component type, and the components of each type of element (section 3.6.2.2).
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}

# Extensions that compress a buffer view.
_MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")

# Commands that write a file again, for messages.
UNCOMPRESS = "npx @gltf-transform/cli copy IN.glb OUT.glb"
_UPGRADE = "npx gltf-pipeline -i IN -o OUT.glb"


class Document:
    """A glTF file.

    Parameters
    ----------
    content : bytes
        Of a .glb or .gltf file.
    folder : Path
        Of the files that it names.

    Attributes
    ----------
    root : dict
        The JSON.
    """

    def __init__(self, content: bytes, folder: Path) -> None:
        self._folder = folder
        self._binary: bytes | None = None
        self._buffers: dict[int, bytes] = {}
        text = content
        if content.startswith(_MAGIC):
            text = self._chunks(content)
        try:
            root = json.loads(text.decode("utf-8-sig", errors="replace"))
        except (ValueError, RecursionError) as error:
            raise MeshError(f"its JSON is damaged: {error}") from error
        if not isinstance(root, dict):
            raise MeshError("its JSON is not an object, as that of a glTF file is")
        self.root = root
        asset = root.get("asset", {})
        version = str(asset.get("version", "1.0")) if isinstance(asset, dict) else "1.0"
        if not version.startswith("2."):
            raise _other_version(version)

    def _chunks(self, content: bytes) -> bytes:
        """The JSON of a binary container; its buffer is kept."""
        if len(content) < 20:
            raise MeshError("it ends within its header")
        _, version, _ = struct.unpack_from("<4sII", content)
        if version != 2:
            raise _other_version(f"{version}.0")
        text = None
        at = 12
        while at + 8 <= len(content):
            length, kind = struct.unpack_from("<II", content, at)
            chunk = content[at + 8 : at + 8 + length]
            if len(chunk) < length:
                raise MeshError(f"it ends early: a chunk has {len(chunk)} of {length} bytes")
            if kind == _JSON_CHUNK and text is None:
                text = chunk
            elif kind == _BINARY_CHUNK and self._binary is None:
                self._binary = chunk
            at += 8 + length
        if text is None:
            raise MeshError("it has no JSON chunk")
        return text

    def entry(self, kind: str, index: Any) -> dict[str, Any]:
        """An entry of one of the JSON's lists, such as "nodes"; raises `MeshError` without it."""
        entries = self.root.get(kind, [])
        if (
            not isinstance(entries, list)
            or not isinstance(index, int)
            or not 0 <= index < len(entries)
            or not isinstance(entries[index], dict)
        ):
            raise MeshError(f"it refers to {kind}[{index!r}], which it does not have")
        return entries[index]

    def count(self, kind: str) -> int:
        """Number of entries of one of the JSON's lists."""
        return len(self.root.get(kind, []))

    def accessor(self, index: Any) -> NDArray:
        """Elements of an accessor as they are stored, [count, components]."""
        accessor = self.entry("accessors", index)
        dtype = np.dtype(_component(accessor))
        size = _SIZES.get(str(accessor.get("type")))
        if size is None:
            raise MeshError(f"accessors[{index}] has the unknown type {accessor.get('type')!r}")
        count = _whole(accessor, "count")
        if "bufferView" in accessor:
            elements = self._elements(accessor, _whole(accessor, "byteOffset"), count, dtype, size)
        else:
            need = count * size * dtype.itemsize
            require_memory(MeshError, need, f"accessors[{index}]", "take a coarser mesh")
            elements = np.zeros((count, size), dtype)
        if "sparse" in accessor:
            elements = self._with_sparse(elements, accessor["sparse"])
        return elements

    def numbers(self, index: Any) -> NDArray[np.float64]:
        """Elements of an accessor as numbers: normalized integers are 0 to 1, or -1 to 1."""
        elements = self.accessor(index)
        numbers = elements.astype(np.float64)
        if self.entry("accessors", index).get("normalized"):
            numbers = unit_numbers(elements)
        return numbers

    def _with_sparse(self, elements: NDArray, sparse: dict[str, Any]) -> NDArray:
        """Elements with those that a sparse accessor replaces (section 3.6.2.3)."""
        count = _whole(sparse, "count")
        where = sparse["indices"]
        kind = np.dtype(_component(where))
        indices = self._elements(where, _whole(where, "byteOffset"), count, kind, 1)[:, 0]
        if count and not 0 <= int(indices.max()) < len(elements):
            raise MeshError(
                f"a sparse accessor replaces element {int(indices.max())} of {len(elements)}"
            )
        values = sparse["values"]
        changed = elements.copy()
        changed[indices] = self._elements(
            values, _whole(values, "byteOffset"), count, elements.dtype, elements.shape[1]
        )
        return changed

    def _elements(
        self, holder: dict[str, Any], offset: int, count: int, dtype: np.dtype, size: int
    ) -> NDArray:
        """Elements [count, size] of the buffer view of an accessor, from an offset [bytes] on."""
        view = self.entry("bufferViews", holder.get("bufferView"))
        data = self.view(holder.get("bufferView"))
        row = size * dtype.itemsize
        stride = _whole(view, "byteStride") or row
        last = offset + stride * (count - 1) + row
        if count and (last > len(data) or stride < row):
            raise MeshError(
                f"it ends early: {count} elements of {row} bytes need {last} bytes of "
                f"bufferViews[{holder.get('bufferView')}], which has {len(data)}"
            )
        if not count:
            return np.zeros((0, size), dtype)
        return np.ndarray((count, size), dtype, data, offset, (stride, dtype.itemsize))

    def view(self, index: Any) -> bytes:
        """Bytes of a buffer view."""
        view = self.entry("bufferViews", index)
        if any(name in view.get("extensions", {}) for name in _MESHOPT):
            raise MeshError(
                "it is compressed with meshopt (EXT_meshopt_compression); undo that with "
                f"{UNCOMPRESS}"
            )
        data = self._buffer(view.get("buffer"))
        offset = _whole(view, "byteOffset")
        length = _whole(view, "byteLength")
        if offset + length > len(data):
            raise MeshError(
                f"it ends early: bufferViews[{index}] ends at byte {offset + length} of a buffer "
                f"of {len(data)} bytes"
            )
        return data[offset : offset + length]

    def _buffer(self, index: Any) -> bytes:
        if index not in self._buffers:
            uri = self.entry("buffers", index).get("uri")
            if uri is None:
                if self._binary is None:
                    raise MeshError(f"the data of buffers[{index}] are missing")
                self._buffers[index] = self._binary
            else:
                source = self._resource(str(uri))
                if isinstance(source, Path):
                    if not source.is_file():
                        raise MeshError(
                            f"it names {str(uri)[:80]!r}, which does not exist or is not a "
                            "regular file"
                        )
                    source = source.read_bytes()
                self._buffers[index] = source
        return self._buffers[index]

    def image(self, index: Any) -> ImageSource:
        """An image of the file; the file that it names may be missing."""
        image = self.entry("images", index)
        name = str(image.get("name") or f"image {index}")
        if "uri" not in image:
            return ImageSource(self.view(image.get("bufferView")), name)
        uri = str(image["uri"])
        source = self._resource(uri)
        return ImageSource(source, name if isinstance(source, bytes) else unquote(uri)[:80])

    def _resource(self, uri: str) -> Path | bytes:
        """The file that a URI names, or the data that it holds."""
        if not uri.startswith("data:"):
            return self._folder / unquote(uri).replace("\\", "/")
        head, _, data = uri.partition(",")
        try:
            return base64.b64decode(data) if head.endswith(";base64") else unquote_to_bytes(data)
        except ValueError as error:
            raise MeshError(f"the data of a URI are damaged: {error}") from error


def unit_numbers(elements: NDArray) -> NDArray[np.float64]:
    """Numbers from 0 to 1, or from -1 to 1, that integers stand for (section 3.6.2.2)."""
    if elements.dtype.kind == "f":
        return elements.astype(np.float64)
    return np.maximum(elements / np.iinfo(elements.dtype).max, -1.0)


def _component(holder: dict[str, Any]) -> str:
    kind = holder.get("componentType")
    if kind not in _COMPONENTS:
        raise MeshError(f"an accessor has the unknown component type {kind!r}")
    return _COMPONENTS[kind]


def _whole(holder: dict[str, Any], name: str) -> int:
    """A number of bytes or elements, from 0; 0 without one."""
    value = holder.get(name, 0)
    if not isinstance(value, int) or value < 0:
        raise MeshError(f"its {name} is {value!r}, but must be a whole number from 0")
    return value


def _other_version(version: str) -> MeshError:
    return MeshError(f"it is glTF {version}, but must be glTF 2.0; convert it with {_UPGRADE}")
