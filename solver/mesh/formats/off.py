"""OFF files in text form as triangles, with colours of vertices or faces.

The format is tokens, not lines: the numbers of a face may stand on several lines. Only the colour
of a face, which has no fixed length, ends with its line.
"""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import MeshError
from ..looks import Looks, Paint, alpha_of, linear_light, unit_range, with_opacity
from ..soup import Soup, too_small, triangulate
from .text import decoded, numbers, three, whole

# The first word of the file: what a vertex has besides its place.
_HEADER = re.compile(r"(?P<pairs>ST)?(?P<colors>C)?(?P<normals>N)?OFF(?P<count>\d*)")

# Numbers of a colour.
_COLOR_SIZES = (3, 4)


def read_off(path: Path) -> Soup:
    """Triangles of an OFF file in text form, with or without colours and normals.

    Raises `MeshError` if the file is not an OFF file in text form, ends early, or refers to a
    vertex that does not exist.
    """
    header, vertex_count, face_count, rows = _opened(path.read_bytes())
    if not _one_a_row(rows, vertex_count, face_count):
        rows = _rows_of_tokens(rows, _vertex_size(header), vertex_count, face_count) or rows
    if len(rows) < vertex_count + face_count:
        raise MeshError(
            f"it ends early: {vertex_count} vertices and {face_count} faces are announced, "
            f"{len(rows)} lines follow"
        )
    # the numbers of the lines are lost with the comments, so messages count vertices instead
    vertices = rows[:vertex_count]
    coordinates: list[str] = []
    for number, words in enumerate(vertices, 1):
        coordinates += three(words, number, "vertex")
    V = numbers(coordinates).reshape(-1, 3)
    faces, face_colors = _faces(rows[vertex_count:], face_count, vertex_count)
    vertex = np.array(list(itertools.chain.from_iterable(faces)), dtype=np.int64)
    sizes = np.array([len(corners) for corners in faces], dtype=np.int64)
    triangles = triangulate(V[vertex], sizes)
    F = vertex[triangles]
    corner_uv = None
    if header.pairs:
        pairs: list[str] = []
        for words in vertices:
            pairs += words[-2:]
        corner_uv = numbers(pairs).reshape(-1, 2)[F]
    face = np.repeat(np.arange(len(sizes)), sizes)[triangles[:, 0]]
    colors = _face_colors(face_colors)
    if colors is not None:
        colors = np.repeat(colors[face][:, None], 3, axis=1)
    else:
        of_vertices = _vertex_colors(vertices, header)
        colors = None if of_vertices is None else of_vertices[F]
    looks = None
    if colors is not None:
        paint = Paint(alpha=alpha_of(colors))
        looks = Looks((paint,), np.zeros(len(F), np.int64), colors)
    return Soup(V, F, corner_uv, too_small(sizes), looks)


class _Header(NamedTuple):
    """What a vertex has besides its place, in this order: a normal, a colour, coordinates."""

    pairs: bool
    colors: bool
    normals: bool


def _opened(content: bytes) -> tuple[_Header, int, int, list[list[str]]]:
    """Header, numbers of vertices and faces, and the rows after them, without comments."""
    rows = []
    for line in decoded(content).splitlines():
        words = line.partition("#")[0].split()
        if words:
            rows.append(words)
    match = _HEADER.fullmatch(rows[0][0].upper()) if rows else None
    if match is None or "BINARY" in [word.upper() for word in rows[0]]:
        raise MeshError("it does not start with OFF, as an OFF file in text form does")
    # the counts may stand behind the word OFF, even without a blank, or on the next lines
    rows[0] = [word for word in (match["count"], *rows[0][1:]) if word]
    counts: list[str] = []
    while rows and len(counts) < 2:
        counts += rows.pop(0)
    if len(counts) < 2 or not all(word.isdecimal() for word in counts[:2]):
        raise MeshError("the numbers of vertices and faces are missing after OFF")
    if len(counts) == 2 and rows and len(rows[0]) == 1:  # the number of edges, on its own line
        rows.pop(0)
    header = _Header(*(match[name] is not None for name in _Header._fields))
    return header, int(counts[0]), int(counts[1]), rows


def _vertex_size(header: _Header) -> int:
    """Numbers of a vertex; a colour has four."""
    return 3 + 3 * header.normals + 4 * header.colors + 2 * header.pairs


def _one_a_row(rows: list[list[str]], vertex_count: int, face_count: int) -> bool:
    """Whether every row has a whole vertex or a whole face."""
    faces = rows[vertex_count : vertex_count + face_count]
    return (
        len(rows) >= vertex_count + face_count
        and all(len(words) >= 3 for words in rows[:vertex_count])
        and all(len(words) > whole(words[0]) for words in faces)
    )


def _rows_of_tokens(
    rows: list[list[str]], size: int, vertex_count: int, face_count: int
) -> list[list[str]] | None:
    """Rows of a vertex or a face each, of rows that are broken elsewhere; None if they are not.

    Faces have no colours, or colours that end with their lines: what uses up all tokens counts.
    """
    tokens = list(itertools.chain.from_iterable(rows))
    lengths = [len(words) for words in rows]
    # where the line of each token ends
    line_ends = np.repeat(np.cumsum(lengths), lengths).tolist()
    at = size * vertex_count
    vertices = [tokens[i : i + size] for i in range(0, min(at, len(tokens)), size)]
    for colored in (False, True):
        faces, end = _faces_of_tokens(tokens, at, face_count, line_ends if colored else None)
        if len(faces) == face_count and (colored or end == len(tokens)):
            return vertices + faces
    return None


def _faces_of_tokens(
    tokens: list[str], at: int, face_count: int, line_ends: list[int] | None
) -> tuple[list[list[str]], int]:
    """The faces from a token on, as many as are whole, and the token after them.

    With the ends of the tokens' lines, the rest of a line is the colour of its face.
    """
    faces: list[list[str]] = []
    while len(faces) < face_count and at < len(tokens):
        end = at + 1 + max(whole(tokens[at]), 0)
        if end > len(tokens):
            break
        if line_ends is not None:
            end = line_ends[end - 1]
        faces.append(tokens[at:end])
        at = end
    return faces, at


def _faces(
    rows: list[list[str]], face_count: int, vertex_count: int
) -> tuple[list[list[int]], list[list[str]]]:
    """Vertices of each face, and the words of its colour.

    A row has the number of vertices, the vertices and the colour.
    """
    faces = []
    colors = []
    for words in rows[:face_count]:
        size = whole(words[0])
        corners = [whole(word) for word in words[1 : 1 + max(size, 0)]]
        if len(corners) != size:
            raise MeshError(
                f"the face {' '.join(words)[:40]!r} has {len(corners)} corners instead of {size}"
            )
        if any(not 0 <= corner < vertex_count for corner in corners):
            raise MeshError(
                f"the face {' '.join(words)[:40]!r} refers to a vertex outside 0 to "
                f"{vertex_count - 1}"
            )
        faces.append(corners)
        colors.append(words[1 + size :])
    return faces, colors


def _face_colors(words: list[list[str]]) -> NDArray[np.float64] | None:
    """Colours of faces [face_count, 4]; None unless some have three or four numbers."""
    colored = [i for i, row in enumerate(words) if len(row) in _COLOR_SIZES]
    if not colored:
        return None
    colors = np.ones((len(words), 4))
    colors[colored] = _colors([words[i] for i in colored])
    return colors


def _vertex_colors(rows: list[list[str]], header: _Header) -> NDArray[np.float64] | None:
    """Colours of vertices [vertex_count, 4], or None; some files have them without saying so."""
    first = 3 + 3 * header.normals
    last = -2 if header.pairs else None
    words = [row[first:last] for row in rows]
    sizes = {len(row) for row in words}
    if not sizes or not sizes <= set(_COLOR_SIZES):
        return None
    # without a header that says so, three more numbers may be a normal
    has_negative = any("-" in word for word in itertools.chain.from_iterable(words))
    if not header.colors and has_negative:
        return None
    return _colors(words)


def _colors(words: list[list[str]]) -> NDArray[np.float64]:
    """Linear light and opacity [n, 4] of three or four numbers each."""
    values = np.ones((len(words), 4))
    rgb = itertools.chain.from_iterable(color[:3] for color in words)
    flat = numbers(list(rgb)).reshape(-1, 3)
    values[:, :3] = unit_range(flat)
    with_alpha = [i for i, color in enumerate(words) if len(color) == 4]
    values[with_alpha, 3] = unit_range(numbers([words[i][3] for i in with_alpha]))
    return with_opacity(linear_light(values))
