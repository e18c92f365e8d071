"""OBJ and OFF files as triangles: polygons of any size, and texture coordinates of every corner.

trimesh reads both formats too, but fails on OFF files with polygons of more than four corners and
on OBJ files with indices that count backwards. Both are common.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError
from .soup import Soup, too_small, triangulate

# A corner of a face in an OBJ file: vertex, vertex/texture, vertex//normal or
# vertex/texture/normal.
_CORNER = re.compile(r"(-?\d{1,15})(?:/(-?\d{1,15})?(?:/(?:-?\d+)?)?)?", flags=re.ASCII)

# A whole number that fits an int64.
_WHOLE = re.compile(r"-?\d{1,15}", flags=re.ASCII)


def read_obj(content: bytes) -> Soup:
    """Triangles of a Wavefront OBJ file: all its objects, groups and materials together.

    Raises `MeshError` for a line that cannot be read, or a vertex that does not exist.
    """
    statements = _obj_statements(content)
    V = _numbers(statements.coordinates).reshape(-1, 3)
    vertex, pair = np.array(statements.corners, dtype=np.int64).reshape(-1, 2).T
    wrong = (vertex < 0) | (vertex >= len(V))
    if wrong.any():
        first_wrong = np.argmax(wrong)
        number = np.repeat(statements.face_lines, statements.face_sizes)[first_wrong]
        raise MeshError(
            f"line {number} refers to vertex {vertex[first_wrong] + 1}: it must be one of the "
            f"vertices given, 1 to {len(V)}"
        )
    sizes = np.array(statements.face_sizes, dtype=np.int64)
    triangles = triangulate(V[vertex], sizes)
    uv = _numbers(statements.uv_coordinates).reshape(-1, 2)
    has_uv = (pair >= 0) & (pair < len(uv))
    corner_uv = None
    if has_uv.any():
        uv_of_corner = np.where(has_uv[:, None], uv[np.where(has_uv, pair, 0)], 0.0)
        corner_uv = uv_of_corner[triangles]
    return Soup(V, vertex[triangles], corner_uv, too_small(sizes))


class _ObjStatements(NamedTuple):
    """Vertices, texture coordinates and faces of an OBJ file, in the order of the file."""

    coordinates: list[str]  # x, y and z of vertex after vertex
    uv_coordinates: list[str]  # u and v of pair after pair
    corners: list[tuple[int, int]]  # vertex and texture coordinate, from 0, face after face
    face_sizes: list[int]  # corners of each face
    face_lines: list[int]  # number of the line of each face, from 1


def _obj_statements(content: bytes) -> _ObjStatements:
    coordinates: list[str] = []
    uv_coordinates: list[str] = []
    corners: list[tuple[int, int]] = []
    sizes: list[int] = []
    lines: list[int] = []
    corner_by_word: dict[str, tuple[int, int]] = {}
    text = _decoded(content).replace("\\\r\n", " ").replace("\\\n", " ")
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        if words[0] == "v":
            coordinates += _three(words[1:], number)
        elif words[0] == "vt":
            uv_coordinates += (*words[1:3], "0", "0")[:2]
        elif words[0] == "f":
            for word in words[1:]:
                corner = corner_by_word.get(word)
                if corner is None:
                    corner = _corner(word, len(coordinates) // 3, len(uv_coordinates) // 2, number)
                # a negative index counts back from here, so it means something else on every line
                if "-" not in word:
                    corner_by_word[word] = corner
                corners.append(corner)
            sizes.append(len(words) - 1)
            lines.append(number)
    return _ObjStatements(coordinates, uv_coordinates, corners, sizes, lines)


def read_off(content: bytes) -> Soup:
    """Triangles of an OFF file in text form, with or without colours and normals.

    Raises `MeshError` if the file is not an OFF file in text form, ends early, or refers to a
    vertex that does not exist.
    """
    rows = []
    for line in _decoded(content).splitlines():
        words = line.partition("#")[0].split()
        if words:
            rows.append(words)
    if not rows or not re.fullmatch(r"(ST)?C?N?OFF", rows[0][0].upper()) or "BINARY" in rows[0]:
        raise MeshError("it does not start with OFF, as an OFF file in text form does")
    # the counts may stand behind the word OFF, or on the next line
    if rows[0][1:]:
        counts = rows[0][1:]
        content_rows = rows[1:]
    else:
        counts = rows[1] if len(rows) > 1 else []
        content_rows = rows[2:]
    if len(counts) < 2 or not all(word.isdecimal() for word in counts[:2]):
        raise MeshError("the numbers of vertices and faces are missing after OFF")
    vertex_count = int(counts[0])
    face_count = int(counts[1])
    if len(content_rows) < vertex_count + face_count:
        raise MeshError(
            f"it ends early: {vertex_count} vertices and {face_count} faces are announced, "
            f"{len(content_rows)} lines follow"
        )
    # the numbers of the lines are lost with the comments, so messages count vertices instead
    coordinates: list[str] = []
    for number, words in enumerate(content_rows[:vertex_count], 1):
        coordinates += _three(words, number, "vertex")
    V = _numbers(coordinates).reshape(-1, 3)
    polygons = [
        _off_face(words, vertex_count)
        for words in content_rows[vertex_count : vertex_count + face_count]
    ]
    vertex = np.array(list(itertools.chain.from_iterable(polygons)), dtype=np.int64)
    sizes = np.array([len(corners) for corners in polygons], dtype=np.int64)
    return Soup(V, vertex[triangulate(V[vertex], sizes)], None, too_small(sizes))


def _off_face(words: list[str], vertex_count: int) -> list[int]:
    """Vertices of a face of an OFF file: its row has their number, then the vertices."""
    size = _whole(words[0])
    corners = [_whole(word) for word in words[1 : 1 + max(size, 0)]]
    if len(corners) != size:
        raise MeshError(
            f"the face {' '.join(words)[:40]!r} has {len(corners)} corners instead of {size}"
        )
    if any(not 0 <= corner < vertex_count for corner in corners):
        raise MeshError(
            f"the face {' '.join(words)[:40]!r} refers to a vertex outside 0 to {vertex_count - 1}"
        )
    return corners


def _decoded(content: bytes) -> str:
    """Text of a file; bytes that are not UTF-8 can only stand in names and comments.

    Windows may put a byte order mark in front.
    """
    return content.decode("utf-8-sig", errors="replace")


def _corner(word: str, vertices: int, pairs: int, line: int) -> tuple[int, int]:
    """Vertex and texture coordinate, counted from 0, of a corner such as 3, 3/1, 3//2 or 3/1/2.

    `vertices` and `pairs` are the numbers of vertices and texture coordinates above the line: a
    negative index counts back from there.
    """
    match = _CORNER.fullmatch(word)
    if match is None:
        raise MeshError(
            f"line {line}: a corner of a face must be written like 3, 3/1, 3//2 or 3/1/2, got "
            f"{word[:40]!r}"
        )
    vertex = int(match[1])
    vertex = vertex - 1 if vertex >= 0 else vertices + vertex
    pair = int(match[2] or 0)
    pair = pair - 1 if pair >= 0 else pairs + pair
    return vertex, pair


def _three(words: Sequence[str], number: int, unit: str = "line") -> Sequence[str]:
    """The first three words; `unit` and `number` say in the message where they stand."""
    if len(words) < 3:
        raise MeshError(f"{unit} {number} must have 3 coordinates, got {len(words)}")
    return words[:3]


def _numbers(words: list[str]) -> NDArray[np.float64]:
    try:
        return np.array(words, dtype=np.float64)
    except ValueError as error:
        raise MeshError(f"a coordinate is not a number: {error}") from error


def _whole(word: str) -> int:
    if not _WHOLE.fullmatch(word):
        raise MeshError(f"expected a whole number, found {word[:40]!r}")
    return int(word)
