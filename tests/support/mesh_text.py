"""Mesh files written by hand: polygons as OBJ, OFF and PLY."""

import struct
from pathlib import Path

QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]

CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]


def obj(vertices, faces, *between: str) -> str:
    """OBJ text of polygons given by indices from 0."""
    lines = [f"v {' '.join(f'{x:g}' for x in v)}" for v in vertices]
    return (
        "\n".join([*lines, *between, *(f"f {' '.join(str(i + 1) for i in f)}" for f in faces)])
        + "\n"
    )


def off(vertices, faces, header: str = "OFF") -> str:
    lines = [
        header,
        f"{len(vertices)} {len(faces)} 0",
        *(" ".join(f"{x:g}" for x in v) for v in vertices),
    ]
    return "\n".join([*lines, *(f"{len(f)} {' '.join(map(str, f))}" for f in faces)]) + "\n"


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
    order = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}[layout]
    codes = {"float": "f", "double": "d", "uchar": "B", "ushort": "H", "int": "i"}
    header = ["ply", f"format {layout} 1.0", "comment made here", f"element vertex {len(vertices)}"]
    header += [f"property {kind} {name}" for name in "xyz"] + ["property uchar red"]
    header += [
        "element edge 1",
        "property int vertex1",
        "property int vertex2",
        f"element face {len(faces)}",
    ]
    header += [f"property list {length} int vertex_indices"]
    header += ["property list uchar float texcoord"] * texcoord + [
        "property uchar flags",
        "end_header",
    ]
    rows = [[(codes[kind], [*v]), ("B", [255])] for v in vertices] + [[("i", [0, 1])]]
    for k, face in enumerate(faces):
        rows.append([(codes[length], [len(face)]), ("i", [*face])])
        if texcoord:
            rows[-1] += [
                ("B", [2 * len(face)]),
                ("f", [x for j in range(len(face)) for x in (k, j)]),
            ]
        rows[-1].append(("B", [7]))
    if order is None:
        body = "".join(
            " ".join(f"{x:g}" for _, values in row for x in values) + "\n" for row in rows
        ).encode()
    else:
        body = b"".join(
            struct.pack(f"{order}{len(values)}{code}", *values)
            for row in rows
            for code, values in row
        )
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


L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
