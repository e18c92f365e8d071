"""OBJ and OFF files as triangles: polygons of any size, and each corner's own texture coordinates.

The other formats are left to trimesh. Its readers of these two fail on polygons of more than four corners in OFF files
and on indices that count backwards in OBJ files, both of which are common.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError
from .polygons import Soup, too_small, triangulate

_CORNER = re.compile(r"(-?\d{1,15})(?:/(-?\d{1,15})?(?:/(?:-?\d+)?)?)?", flags=re.ASCII)
_WHOLE = re.compile(r"-?\d{1,15}", flags=re.ASCII)


def read_obj(content: bytes) -> Soup:
    """Triangles of a Wavefront OBJ file: all its objects, groups and materials together.

    Raises
    ------
    MeshError
        For a line that cannot be read, or a vertex that does not exist.
    """
    places: list[str] = []
    pairs: list[str] = []
    corners: list[tuple[int, int]] = []
    sizes: list[int] = []
    lines: list[int] = []
    known: dict[str, tuple[int, int]] = {}
    text = _decoded(content).replace("\\\r\n", " ").replace("\\\n", " ")
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        if words[0] == "v":
            places += _three(words[1:], number)
        elif words[0] == "vt":
            pairs += (*words[1:3], "0", "0")[:2]
        elif words[0] == "f":
            for word in words[1:]:
                # a negative index counts back from here, so it means something else on every line
                corner = known.get(word) or _corner(word, len(places) // 3, len(pairs) // 2, number)
                if "-" not in word:
                    known[word] = corner
                corners.append(corner)
            sizes.append(len(words) - 1)
            lines.append(number)
    V = _numbers(places).reshape(-1, 3)
    vertex, pair = np.array(corners, dtype=np.int64).reshape(-1, 2).T
    wrong = (vertex < 0) | (vertex >= len(V))
    if wrong.any():
        number = int(np.repeat(lines, sizes)[np.argmax(wrong)])
        raise MeshError(
            f"line {number} refers to vertex {vertex[np.argmax(wrong)] + 1}; valid is 1 to {len(V)}, the vertices given"
        )
    counts = np.array(sizes, dtype=np.int64)
    triangles = triangulate(V[vertex], counts)
    uv = _numbers(pairs).reshape(-1, 2)
    given = (pair >= 0) & (pair < len(uv))
    corner_uv = None
    if given.any():
        corner_uv = np.where(given[:, None], uv[np.where(given, pair, 0)], 0.0)[triangles]
    return Soup(V, vertex[triangles], corner_uv, too_small(counts))


def read_off(content: bytes) -> Soup:
    """Triangles of an OFF file in text form, with or without colours and normals.

    Raises
    ------
    MeshError
        If the file is not an OFF file in text form, ends early, or refers to a vertex that does not exist.
    """
    rows = [words for line in _decoded(content).splitlines() if (words := line.partition("#")[0].split())]
    if not rows or not re.fullmatch(r"(ST)?C?N?OFF", rows[0][0].upper()) or "BINARY" in rows[0]:
        raise MeshError("it does not start with OFF, as an OFF file in text form does")
    counts = rows[0][1:] or (rows[1] if len(rows) > 1 else [])
    lines_left = rows[1:] if rows[0][1:] else rows[2:]
    if len(counts) < 2 or not all(word.isdecimal() for word in counts[:2]):
        raise MeshError("the numbers of vertices and faces are missing after OFF")
    vertices, faces = int(counts[0]), int(counts[1])
    if len(lines_left) < vertices + faces:
        raise MeshError(
            f"it ends early: {vertices} vertices and {faces} faces are announced, {len(lines_left)} lines follow"
        )
    # the numbers of the lines are lost with the comments, so vertices are counted instead
    places = [_three(words, number, "vertex") for number, words in enumerate(lines_left[:vertices], 1)]
    V = _numbers([word for row in places for word in row]).reshape(-1, 3)
    polygons = []
    for words in lines_left[vertices : vertices + faces]:
        size = _whole(words[0])
        corners = [_whole(word) for word in words[1 : 1 + max(size, 0)]]
        if len(corners) != size:
            raise MeshError(f"the face {' '.join(words)[:40]!r} has {len(corners)} corners instead of {size}")
        if any(not 0 <= corner < vertices for corner in corners):
            raise MeshError(f"the face {' '.join(words)[:40]!r} refers to a vertex outside 0 to {vertices - 1}")
        polygons.append(corners)
    vertex = np.array(list(itertools.chain.from_iterable(polygons)), dtype=np.int64)
    sizes = np.array([len(corners) for corners in polygons], dtype=np.int64)
    return Soup(V, vertex[triangulate(V[vertex], sizes)], None, too_small(sizes))


def _decoded(content: bytes) -> str:
    # only names and comments can be other than UTF-8; Windows may put a byte order mark in front
    return content.decode("utf-8-sig", errors="replace")


def _corner(word: str, places: int, pairs: int, line: int) -> tuple[int, int]:
    """Vertex and texture coordinate, counted from 0, of a corner: 3, 3/1, 3//2 or 3/1/2."""
    match = _CORNER.fullmatch(word)
    if match is None:
        raise MeshError(
            f"line {line}: {word[:40]!r} is not a corner of a face; valid are 3, 3/1, 3//2 and 3/1/2, for example"
        )
    vertex, pair = int(match[1]), int(match[2] or 0)
    return (vertex - 1 if vertex >= 0 else places + vertex), (pair - 1 if pair >= 0 else pairs + pair)


def _three(words: Sequence[str], number: int, unit: str = "line") -> Sequence[str]:
    if len(words) < 3:
        raise MeshError(f"{unit} {number} has {len(words)} coordinates; valid are 3")
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
