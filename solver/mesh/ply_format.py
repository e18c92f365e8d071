"""PLY files as triangles, text or binary: polygons of any size, texture coordinates of vertices or of corners.

trimesh, which reads the other formats, fails on binary PLY files in which polygons of several sizes are mixed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError
from .ply import Element, read_binary, read_text
from .polygons import Soup, too_small, triangulate

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))


def read_ply(content: bytes) -> Soup:
    """Triangles of a PLY file.

    Raises
    ------
    MeshError
        If the file is not a PLY file, ends early, or refers to a vertex that does not exist.
    """
    order, elements, data = _header(content)
    columns: dict[str, dict[str, Any]] = {}
    for element in elements:
        read = read_text if order == "" else read_binary
        columns[element.name], data = read(element, data, order)
        if "face" in columns and "vertex" in columns:
            break
    vertex, faces = columns.get("vertex", {}), columns.get("face", {})
    if any(name not in vertex for name in "xyz"):
        raise MeshError("it has no vertices with x, y and z")
    V = np.stack([np.asarray(vertex[name], dtype=np.float64) for name in "xyz"], axis=1)
    polygons = faces.get("vertex_indices", faces.get("vertex_index", []))
    sizes = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    corners = np.concatenate([np.empty(0), *polygons])
    if len(corners) and not (corners.min() >= 0 and corners.max() < len(V)):
        raise MeshError(
            f"its faces refer to vertices {corners.min():g} to {corners.max():g}; valid is 0 to {len(V) - 1}"
        )
    index = corners.astype(np.int64)
    triangles = triangulate(V[index], sizes)
    uv = _corner_uv(vertex, faces, index, sizes)
    return Soup(V, index[triangles], None if uv is None else uv[triangles], too_small(sizes))


def _corner_uv(
    vertex: dict[str, Any], faces: dict[str, Any], index: NDArray[np.int64], sizes: NDArray[np.int64]
) -> NDArray[np.float64] | None:
    pairs = faces.get("texcoord")
    if pairs is not None and all(len(pair) == 2 * size for pair, size in zip(pairs, sizes, strict=True)):
        return np.concatenate([np.empty(0), *pairs]).reshape(-1, 2)
    for u, v in _UV_NAMES:
        if u in vertex and v in vertex:
            return np.stack([vertex[u], vertex[v]], axis=1).astype(np.float64)[index]
    return None


def _header(content: bytes) -> tuple[str, list[Element], bytes]:
    head, found, data = content.partition(b"end_header")
    lines = [line.split() for line in head.decode("ascii", errors="replace").splitlines()]
    if not found or not lines or lines[0] != ["ply"]:
        raise MeshError("it has no header from ply to end_header, as a PLY file does")
    order, elements = None, []
    try:
        for words in lines[1:]:
            match words:
                case ["format", name, *_]:
                    order = _ORDERS[name]
                case ["element", name, rows]:
                    elements.append(Element(name, int(rows)))
                case ["property", "list", length, kind, name]:
                    elements[-1].names.append(name)
                    elements[-1].types.append(_TYPES[kind])
                    elements[-1].lengths.append(_TYPES[length])
                case ["property", kind, name]:
                    elements[-1].names.append(name)
                    elements[-1].types.append(_TYPES[kind])
                    elements[-1].lengths.append(None)
    except (KeyError, ValueError, IndexError) as error:
        raise MeshError(f"the line {' '.join(words)[:60]!r} of its header is not understood") from error
    if order is None or any(element.rows < 0 for element in elements):
        raise MeshError("its header gives no format or a negative number of rows")
    return order, elements, data[2:] if data.startswith(b"\r\n") else data[1:]
