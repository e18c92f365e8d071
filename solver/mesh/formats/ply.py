"""PLY files as triangles, text or binary, with the names under which programs store their looks.

Colours and texture coordinates may belong to vertices or to faces; MeshLab names images in
comments.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import MeshError
from ..looks import ImageSource, Looks, Paint, alpha_of, linear_light, unit_range, with_opacity
from ..soup import Soup, too_small, triangulate
from .mtl import found_file

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
_UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))

# Names under which programs store a colour, and its opacity.
_COLOR_NAMES = (
    ("red", "green", "blue", "alpha"),
    ("diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"),
    ("r", "g", "b", "a"),
)

# The comment with which MeshLab names an image, in lower case.
_IMAGE_COMMENT = "texturefile"

# Names of the vertices of a face, and the property that chooses an image.
_CORNER_NAMES = ("vertex_indices", "vertex_index")
_IMAGE_NUMBER = "texnumber"

# What separates strips of triangles in their list of vertices.
_STRIP_END = -1


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
    readers = [
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
            for column, kind, length in readers:
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


def read_ply(path: Path) -> Soup:
    """Triangles of a PLY file.

    Raises `MeshError` if the file is not a PLY file, ends early, or refers to a vertex that does
    not exist.
    """
    order, elements, comments, data = _header(path.read_bytes())
    columns: dict[str, dict[str, Any]] = {}
    for element in elements:
        read = read_binary if order else read_text
        columns[element.name], data = read(element, data, order)
        if "vertex" in columns and ("face" in columns or "tristrips" in columns):
            break
    vertex = columns.get("vertex", {})
    faces = columns.get("face", {})
    if any(name not in vertex for name in "xyz"):
        raise MeshError("it has no vertices with x, y and z")
    V = np.stack([np.asarray(_flat(vertex[name]), dtype=np.float64) for name in "xyz"], axis=1)
    polygons: Any = next((faces[name] for name in _CORNER_NAMES if name in faces), [])
    if "tristrips" in columns:
        polygons = _of_strips(columns["tristrips"])
        faces = {}
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
    F = index[triangles]
    face = np.repeat(np.arange(len(sizes)), sizes)[triangles[:, 0]]
    kinds = {}
    for element in elements:
        kinds[element.name] = {name: kind for name, kind, _ in element.columns}
    colors = _corner_colors(vertex, faces, kinds, F, face)
    looks = _looks(path, comments, faces, face, colors)
    return Soup(V, F, None if uv is None else uv[triangles], too_small(sizes), looks)


def _of_strips(columns: dict[str, Any]) -> list[NDArray[np.int64]]:
    """Triangles of strips, as polygons; every second one is wound the other way."""
    triangles: list[NDArray[np.int64]] = []
    for row in next((columns[name] for name in _CORNER_NAMES if name in columns), []):
        strip = np.asarray(row).astype(np.int64)
        for part in np.split(strip, np.flatnonzero(strip == _STRIP_END)):
            part = part[part != _STRIP_END]
            F = np.stack([part[:-2], part[1:-1], part[2:]], axis=1)
            F[1::2] = F[1::2, ::-1]
            triangles.extend(F)
    return triangles


def _flat(column: Any) -> NDArray:
    """A column of numbers, which may be stored as one list a row."""
    return column if isinstance(column, np.ndarray) else np.concatenate([np.empty(0), *column])


def _corner_colors(
    vertex: dict[str, Any],
    faces: dict[str, Any],
    kinds: dict[str, dict[str, str]],
    F: NDArray[np.int64],
    face: NDArray[np.int64],
) -> NDArray[np.float64] | None:
    """Colours of the corners of triangles, [m, 3, 4]: of their faces, or else of the vertices.

    Faces that are all alike say nothing beside coloured vertices.
    """
    of_faces = _colors(faces, kinds.get("face", {}))
    of_vertices = _colors(vertex, kinds.get("vertex", {}))
    if of_faces is not None and (of_vertices is None or np.ptp(of_faces, axis=0).any()):
        return np.repeat(of_faces[face][:, None], 3, axis=1)
    return None if of_vertices is None else of_vertices[F]


def _colors(columns: dict[str, Any], kinds: dict[str, str]) -> NDArray[np.float64] | None:
    """Linear light and opacity of the rows of an element, [n, 4]; None without colours."""
    for names in _COLOR_NAMES:
        if columns.keys() >= set(names[:3]) and len(columns[names[0]]):
            channels = [
                _flat(columns[name]).astype(kinds[name]) for name in names if name in columns
            ]
            return with_opacity(linear_light(unit_range(np.stack(channels, axis=1))))
    return None


def _looks(
    path: Path,
    comments: list[str],
    faces: dict[str, Any],
    face: NDArray[np.int64],
    colors: NDArray[np.float64] | None,
) -> Looks | None:
    """Looks of triangles: the images that comments name, and colours."""
    names = []
    for comment in comments:
        keyword, _, name = comment.partition(" ")
        if keyword.lower() == _IMAGE_COMMENT and name.strip():
            names.append(name.strip())
    paints = tuple(
        Paint(image=ImageSource(found_file([path.parent], name) or path.parent / name, name))
        for name in names
    )
    paint = np.zeros(len(face), dtype=np.int64)
    if len(names) > 1 and _IMAGE_NUMBER in faces:
        numbers = np.nan_to_num(np.asarray(_flat(faces[_IMAGE_NUMBER]), dtype=np.float64))
        # a face without an image has the number -1
        paint = np.clip(numbers, -1, len(names) - 1).astype(np.int64)[face]
        paints = (*paints, Paint())
        paint = np.where(paint < 0, len(names), paint)
    if paints:
        # beside an image, programs store colours that are not meant to tint it
        return Looks(paints, paint)
    return None if colors is None else Looks((Paint(alpha=alpha_of(colors)),), paint, colors)


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
    if (
        pairs is not None
        and len(pairs) == len(sizes)
        and all(len(pair) == 2 * size for pair, size in zip(pairs, sizes, strict=True))
    ):
        return np.concatenate([np.empty(0), *pairs]).reshape(-1, 2)
    for names in _UV_NAMES:
        if vertex.keys() >= set(names):
            uv_of_vertex = np.stack([_flat(vertex[name]) for name in names], axis=1)
            uv_of_vertex = uv_of_vertex.astype(np.float64)
            return uv_of_vertex[index]
    return None


def _header(content: bytes) -> tuple[str, list[Element], list[str], bytes]:
    """Byte order, elements, comments, and the data behind the header."""
    head, end, data = content.partition(b"end_header")
    text = head.decode("utf-8", errors="replace").splitlines()
    lines = [line.split() for line in text]
    comments = [line[len("comment ") :].strip() for line in text if line.startswith("comment ")]
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
    return order, elements, comments, data[2:] if data.startswith(b"\r\n") else data[1:]
