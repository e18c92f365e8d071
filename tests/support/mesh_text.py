"""Mesh files written by hand: polygons as OBJ, OFF and PLY."""

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]

CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]

L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]


def numbers(values) -> str:
    """Numbers as text, between blanks."""
    return " ".join(f"{value:g}" for value in values)


def indices(values) -> str:
    """Whole numbers as text, between blanks."""
    return " ".join(str(value) for value in values)


def obj(vertices, faces, *between: str) -> str:
    """OBJ text of polygons given by indices from 0."""
    vertex_lines = [f"v {numbers(vertex)}" for vertex in vertices]
    face_lines = [f"f {indices(i + 1 for i in face)}" for face in faces]
    return "\n".join([*vertex_lines, *between, *face_lines]) + "\n"


def off(vertices, faces, header: str = "OFF") -> str:
    counts = f"{len(vertices)} {len(faces)} 0"
    vertex_lines = [numbers(vertex) for vertex in vertices]
    face_lines = [f"{len(face)} {indices(face)}" for face in faces]
    return "\n".join([header, counts, *vertex_lines, *face_lines]) + "\n"


class Values(NamedTuple):
    """Values of one type in a PLY file."""

    code: str  # of the type, as in `struct`
    values: Sequence[float]

    def packed(self, byte_order: str) -> bytes:
        return struct.pack(f"{byte_order}{len(self.values)}{self.code}", *self.values)


BYTE_ORDERS = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}
CODES = {"float": "f", "double": "d", "uchar": "B", "ushort": "H", "int": "i"}


def ply(
    vertices,
    faces,
    layout: str,
    *,
    kind: str = "float",
    length: str = "uchar",
    texcoord: bool = False,
) -> bytes:
    """PLY file with edges between vertices and faces, and unknown properties."""
    header = [
        "ply",
        f"format {layout} 1.0",
        "comment made here",
        f"element vertex {len(vertices)}",
        *(f"property {kind} {name}" for name in "xyz"),
        "property uchar red",
        "element edge 1",
        "property int vertex1",
        "property int vertex2",
        f"element face {len(faces)}",
        f"property list {length} int vertex_indices",
        *["property list uchar float texcoord"] * texcoord,
        "property uchar flags",
        "end_header",
    ]
    rows = [[Values(CODES[kind], vertex), Values("B", [255])] for vertex in vertices]
    rows.append([Values("i", [0, 1])])
    for number, face in enumerate(faces):
        row = [Values(CODES[length], [len(face)]), Values("i", face)]
        if texcoord:
            coordinates = [each for corner in range(len(face)) for each in (number, corner)]
            row += [Values("B", [len(coordinates)]), Values("f", coordinates)]
        row.append(Values("B", [7]))
        rows.append(row)
    byte_order = BYTE_ORDERS[layout]
    if byte_order is None:
        lines = [" ".join(numbers(part.values) for part in row) for row in rows]
        body = "".join(f"{line}\n" for line in lines).encode()
    else:
        body = b"".join(part.packed(byte_order) for row in rows for part in row)
    return "\n".join(header).encode() + b"\n" + body


def prism(outline) -> tuple[list, list]:
    """Vertices and polygons of a prism of height 1 over an outline (x, y), counter-clockwise."""
    n = len(outline)
    vertices = [(x, y, z) for z in (0, 1) for x, y in outline]
    sides = [(i, (i + 1) % n, (i + 1) % n + n, i + n) for i in range(n)]
    return vertices, [tuple(range(n))[::-1], tuple(range(n, 2 * n)), *sides]


def written(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path
