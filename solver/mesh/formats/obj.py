"""Wavefront OBJ files as triangles, with materials, texture coordinates and vertex colours.

Lines and points are left out. The materials are read in `mtl`.
"""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import MeshError
from ..clean import counted
from ..looks import Looks, Paint, linear_light, unit_range, with_opacity
from ..soup import Soup, too_small, triangulate
from .mtl import ObjMaterial, read_libraries
from .text import decoded, numbers, three

# A corner of a face in an OBJ file: vertex, vertex/texture, vertex//normal or
# vertex/texture/normal.
_CORNER = re.compile(r"(-?\d{1,15})(?:/(-?\d{1,15})?(?:/(?:-?\d+)?)?)?", flags=re.ASCII)

# Words of a vertex with a colour: v, three coordinates, perhaps a weight, and three colours.
_COLORED_VERTEX = 7


def read_obj(path: Path) -> Soup:
    """Triangles of a Wavefront OBJ file: all its objects, groups and materials together.

    Raises `MeshError` for a line that cannot be read, or a vertex that does not exist.
    """
    statements = _obj_statements(path.read_bytes())
    V = numbers(statements.coordinates).reshape(-1, 3)
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
    uv = numbers(statements.uv_coordinates).reshape(-1, 2)
    has_uv = (pair >= 0) & (pair < len(uv))
    corner_uv = None
    if has_uv.any():
        uv_of_corner = np.where(has_uv[:, None], uv[np.where(has_uv, pair, 0)], 0.0)
        corner_uv = uv_of_corner[triangles]
    face = np.repeat(np.arange(len(sizes)), sizes)[triangles[:, 0]]
    material = np.array(statements.face_materials, dtype=np.int64)[face]
    F = vertex[triangles]
    libraries = read_libraries(path, statements.libraries)
    looks, corner_uv = _looks(statements, libraries, F, material, corner_uv)
    return Soup(V, F, corner_uv, (*too_small(sizes), *statements.left_out()), looks)


@dataclasses.dataclass
class _ObjStatements:
    """What an OBJ file says, in the order of the file."""

    coordinates: list[str] = dataclasses.field(default_factory=list)  # x, y, z of each vertex
    colors: list[str] = dataclasses.field(default_factory=list)  # of `colored`
    colored: list[int] = dataclasses.field(default_factory=list)  # vertices that have a colour
    uv_coordinates: list[str] = dataclasses.field(default_factory=list)  # u and v of each pair
    # vertex and texture coordinate, from 0, of each corner, face after face
    corners: list[tuple[int, int]] = dataclasses.field(default_factory=list)
    face_sizes: list[int] = dataclasses.field(default_factory=list)  # corners of each face
    face_lines: list[int] = dataclasses.field(default_factory=list)  # its line, from 1
    face_materials: list[int] = dataclasses.field(default_factory=list)  # index of `materials`
    materials: list[str] = dataclasses.field(default_factory=lambda: [""])  # "" before the first
    libraries: list[str] = dataclasses.field(default_factory=list)  # rest of each mtllib line
    thin: int = 0  # lines and points

    def add_face(
        self,
        words: list[str],
        number: int,
        material: int,
        corner_by_word: dict[str, tuple[int, int]],
    ) -> None:
        """Add the face of a line's words; `corner_by_word` has corners that were read before."""
        for word in words:
            corner = corner_by_word.get(word)
            if corner is None:
                vertices = len(self.coordinates) // 3
                corner = _corner(word, vertices, len(self.uv_coordinates) // 2, number)
            # a negative index counts back from here, so it means something else on every line
            if "-" not in word:
                corner_by_word[word] = corner
            self.corners.append(corner)
        self.face_sizes.append(len(words))
        self.face_lines.append(number)
        self.face_materials.append(material)

    def left_out(self) -> tuple[str, ...]:
        """Note on the lines and points."""
        return (f"{counted(self.thin, 'line or point')} left out",) if self.thin else ()


def _obj_statements(content: bytes) -> _ObjStatements:
    read = _ObjStatements()
    corner_by_word: dict[str, tuple[int, int]] = {}
    material_by_name = {"": 0}
    material = 0
    text = decoded(content).replace("\\\r\n", " ").replace("\\\n", " ")
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        if words[0] == "v":
            if len(words) >= _COLORED_VERTEX:
                read.colored.append(len(read.coordinates) // 3)
                read.colors += words[-3:]
            read.coordinates += three(words[1:], number)
        elif words[0] == "vt":
            read.uv_coordinates += (*words[1:3], "0", "0")[:2]
        elif words[0] == "f":
            read.add_face(words[1:], number, material, corner_by_word)
        elif words[0] in ("l", "p"):
            read.thin += 1
        elif words[0].lower() == "usemtl":
            name = _rest(line)
            material = material_by_name.setdefault(name, len(material_by_name))
        elif words[0].lower() == "mtllib":
            read.libraries.append(_rest(line))
    read.materials = list(material_by_name)
    return read


def _rest(line: str) -> str:
    """What follows the keyword of a line: a name, which may have blanks."""
    _, _, rest = line.strip().replace("\t", " ").partition(" ")
    return rest.strip()


def _looks(
    statements: _ObjStatements,
    libraries: tuple[dict[str, ObjMaterial], list[str]],
    F: NDArray[np.int64],
    material: NDArray[np.int64],
    corner_uv: NDArray[np.float64] | None,
) -> tuple[Looks | None, NDArray[np.float64] | None]:
    """Looks of triangles, and their texture coordinates, moved as their materials say."""
    defined, lost = libraries
    used = [statements.materials[i] for i in np.unique(material)]
    definitions = {name: defined.get(name, defined.get(name.lower())) for name in used}
    missing = [name for name in used if name and definitions[name] is None]
    notes = list(lost)
    if missing and defined:
        names = ", ".join(missing[:3]) + (", ..." if len(missing) > 3 else "")
        notes.append(f"{counted(len(missing), 'material')} not defined: {names}")
    materials = [definition for definition in definitions.values() if definition is not None]
    words: set[str] = set()
    for definition in materials:
        words |= definition.not_shown
    if words:
        notes.append(f"not shown of its materials: {', '.join(sorted(words))}")
    colors = _colors(statements, F)
    if colors is None and not materials:
        bare = Looks((), np.zeros(len(F), np.int64), None, tuple(notes)) if notes else None
        return bare, corner_uv
    place = {statements.materials.index(name): k for k, name in enumerate(used)}
    paint = np.array([place[i] for i in material.tolist()], dtype=np.int64)
    paints = []
    for k, name in enumerate(used):
        material_of_name = definitions[name]
        if material_of_name is None:
            paints.append(Paint())
            continue
        paints.append(material_of_name.paint)
        if corner_uv is not None and not material_of_name.keeps_uv:
            moved_uv = corner_uv * material_of_name.uv_scale + material_of_name.uv_offset
            corner_uv = np.where((paint == k)[:, None, None], moved_uv, corner_uv)
    return Looks(tuple(paints), paint, colors, tuple(notes)), corner_uv


def _colors(statements: _ObjStatements, F: NDArray[np.int64]) -> NDArray[np.float64] | None:
    """Colours of corners, of the vertices that have one; the others are white."""
    if not statements.colored:
        return None
    colors = np.ones((len(statements.coordinates) // 3, 4))
    srgb = unit_range(numbers(statements.colors).reshape(-1, 3))
    colors[statements.colored] = with_opacity(linear_light(srgb))
    return colors[F]


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
