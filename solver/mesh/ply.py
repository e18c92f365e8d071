"""PLY files as triangles, text or binary, with texture coordinates of vertices or of corners.

trimesh reads PLY files too, but fails on binary ones that mix polygons of several sizes, which are
common.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError
from .soup import Soup, too_small, triangulate

# NumPy's name of each number type of a PLY file.
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

# NumPy's name of the byte order of each format; "" is text.
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}

# Names under which programs store the texture coordinates of a vertex.
_UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))


@dataclasses.dataclass
class Element:
    """A table of the file: rows of named values.

    A value is a number, or a list that begins with its length.
    """

    name: str
    rows: int
    # name, type, and type of the list's length (None for a number) of each column
    columns: list[tuple[str, str, str | None]] = dataclasses.field(default_factory=list)


def read_text(element: Element, data: bytes, order: str) -> tuple[dict[str, Any], bytes]:
    """Columns of an element by name, and the data after it.

    Raises `MeshError` if the data end early, or a row has something other than numbers.
    """
    parts = data.split(b"\n", element.rows) if element.rows <= len(data) else []
    if len(parts) < element.rows or (
        len(parts) == element.rows and element.rows and not parts[-1].strip()
    ):
        raise _ends_early(element)
    rest = parts[element.rows] if len(parts) > element.rows else b""
    rows = [part.split() for part in parts[: element.rows]]
    columns: dict[str, Any] = {}
    try:
        if not any(length for _, _, length in element.columns):
            width = len(element.columns)
            table = np.array([row[:width] for row in rows], dtype=np.float64).reshape(
                element.rows, width
            )
            return {name: table[:, k] for k, (name, _, _) in enumerate(element.columns)}, rest
        at = [0] * len(rows)
        for name, _, length in element.columns:
            sizes = (
                [1] * len(rows)
                if length is None
                else [int(row[i]) for row, i in zip(rows, at, strict=True)]
            )
            first = [i + (length is not None) for i in at]
            at = [i + size for i, size in zip(first, sizes, strict=True)]
            if any(not i <= j <= len(row) for i, j, row in zip(first, at, rows, strict=True)):
                raise _ends_early(element)
            columns[name] = [
                np.array(row[i:j], dtype=np.float64)
                for row, i, j in zip(rows, first, at, strict=True)
            ]
    except (ValueError, IndexError) as error:
        raise MeshError(f"a row of its element {element.name} is not understood") from error
    return columns, rest


def read_binary(element: Element, data: bytes, order: str) -> tuple[dict[str, Any], bytes]:
    """Columns of an element by name, and the data after it; `order` is "<" or ">".

    Rows that are all of one length are read in one go. Raises `MeshError` if the data end early.
    """
    if not element.columns:
        return {}, data
    fields: list[Any] = []
    sizes: dict[str, int] = {}
    for name, kind, length in element.columns:
        if length is None:
            fields.append((name, order + kind))
            continue
        first = np.dtype(fields).itemsize if fields else 0
        kind_of_length = np.dtype(order + length)
        if len(data) < first + kind_of_length.itemsize:
            return _read_rows(element, data, order)
        sizes[name] = int(np.frombuffer(data, kind_of_length, 1, first)[0])
        if not 0 <= sizes[name] * np.dtype(kind).itemsize <= len(data):
            return _read_rows(element, data, order)
        fields += [(f"{name} length", kind_of_length), (name, order + kind, (sizes[name],))]
    row = np.dtype(fields)
    if element.rows * row.itemsize > len(data):
        if sizes:
            return _read_rows(element, data, order)
        raise _ends_early(element)
    table = np.frombuffer(data, row, element.rows)
    if any((table[f"{name} length"] != size).any() for name, size in sizes.items()):
        return _read_rows(element, data, order)
    return {name: table[name] for name, _, _ in element.columns}, data[
        element.rows * row.itemsize :
    ]


def _read_rows(element: Element, data: bytes, order: str) -> tuple[dict[str, Any], bytes]:
    columns: dict[str, list[NDArray]] = {name: [] for name, _, _ in element.columns}
    given = [
        (
            columns[name],
            np.dtype(order + kind),
            None if length is None else np.dtype(order + length),
        )
        for name, kind, length in element.columns
    ]
    at = 0
    try:
        for _ in range(element.rows):
            for column, kind, length in given:
                size = 1
                if length is not None:
                    size = int(np.frombuffer(data, length, 1, at)[0])
                    at += length.itemsize
                if not 0 <= size <= len(data):
                    raise _ends_early(element)
                column.append(np.frombuffer(data, kind, size, at))
                at += size * kind.itemsize
    except ValueError as error:  # numpy, where bytes are missing
        raise _ends_early(element) from error
    return dict(columns), data[at:]


def _ends_early(element: Element) -> MeshError:
    return MeshError(f"it ends before the {element.rows} rows of its element {element.name}")


def read_ply(content: bytes) -> Soup:
    """Triangles of a PLY file.

    Raises `MeshError` if the file is not a PLY file, ends early, or refers to a vertex that does
    not exist.
    """
    order, elements, data = _header(content)
    columns: dict[str, dict[str, Any]] = {}
    for element in elements:
        read = read_binary if order else read_text
        columns[element.name], data = read(element, data, order)
        if "face" in columns and "vertex" in columns:
            break
    vertex = columns.get("vertex", {})
    faces = columns.get("face", {})
    if any(name not in vertex for name in "xyz"):
        raise MeshError("it has no vertices with x, y and z")
    V = np.stack([np.asarray(vertex[name], dtype=np.float64) for name in "xyz"], axis=1)
    polygons = faces.get("vertex_indices", faces.get("vertex_index", []))
    sizes = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    corners = np.concatenate([np.empty(0), *polygons])
    if len(corners) and not (corners.min() >= 0 and corners.max() < len(V)):
        raise MeshError(
            f"the vertices of faces must be 0 to {len(V) - 1}, got {corners.min():g} to "
            f"{corners.max():g}"
        )
    index = corners.astype(np.int64)
    triangles = triangulate(V[index], sizes)
    uv = _corner_uv(vertex, faces, index, sizes)
    return Soup(V, index[triangles], None if uv is None else uv[triangles], too_small(sizes))


def _corner_uv(
    vertex: dict[str, Any],
    faces: dict[str, Any],
    index: NDArray[np.int64],
    sizes: NDArray[np.int64],
) -> NDArray[np.float64] | None:
    """Texture coordinates of all corners [corner_count, 2], stored with the faces or the vertices.

    Parameters
    ----------
    vertex, faces
        Columns of the vertices and of the faces, by name.
    index : [corner_count]
        Vertex of each corner, polygon after polygon.
    sizes : [polygon_count]
        Corners of each polygon.
    """
    pairs = faces.get("texcoord")
    if pairs is not None and all(
        len(pair) == 2 * size for pair, size in zip(pairs, sizes, strict=True)
    ):
        return np.concatenate([np.empty(0), *pairs]).reshape(-1, 2)
    for names in _UV_NAMES:
        if vertex.keys() >= set(names):
            uv_of_vertex = np.stack([vertex[name] for name in names], axis=1).astype(np.float64)
            return uv_of_vertex[index]
    return None


def _header(content: bytes) -> tuple[str, list[Element], bytes]:
    """Byte order, elements, and the data behind the header."""
    head, end, data = content.partition(b"end_header")
    lines = [line.split() for line in head.decode("ascii", errors="replace").splitlines()]
    if not end or not lines or lines[0] != ["ply"]:
        raise MeshError("it has no header from ply to end_header, as a PLY file does")
    order = None
    elements = []
    try:
        for words in lines[1:]:
            match words:
                case ["format", name, *_]:
                    order = _ORDERS[name]
                case ["element", name, rows]:
                    elements.append(Element(name, int(rows)))
                case ["property", "list", length, kind, name]:
                    elements[-1].columns.append((name, _TYPES[kind], _TYPES[length]))
                case ["property", kind, name]:
                    elements[-1].columns.append((name, _TYPES[kind], None))
    except (KeyError, ValueError, IndexError) as error:
        raise MeshError(
            f"the line {' '.join(words)[:60]!r} of its header is not understood"
        ) from error
    if order is None or any(element.rows < 0 for element in elements):
        raise MeshError("its header gives no format or a negative number of rows")
    return order, elements, data[2:] if data.startswith(b"\r\n") else data[1:]
