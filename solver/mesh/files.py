"""Mesh files of any format, read and joined to one mesh.

OBJ and OFF files are read here, polygons of any size and each corner's own texture coordinates, PLY
files in `ply`, the others by trimesh. Its readers of these fail on polygons of more than four
corners in OFF files, on indices that count backwards in OBJ files, and on binary PLY files in which
polygons of several sizes are mixed, all of which are common.

On request the holes of a mesh are closed by pymeshfix (Attene 2010, a package of its own under the
GPL).
"""

from __future__ import annotations

import dataclasses
import importlib.util
import itertools
import json
import logging
import re
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import PATH, MeshError, checked
from ..memory import require_memory
from .clean import counted, place
from .mesh import Mesh, many_parts
from .ply import Soup, read_ply, too_small, triangulate
from .wrap import wrap as wrapped

_INSTALL = (
    "pip install 'ripple-sim[repair]' (it adds the package pymeshfix, which is under the GPL)"
)
_TIME_LIMIT = 120  # [s]; a hundred thousand triangles take a few, hopeless cases hours
_TOLD = 8  # holes named one by one

_CORNER = re.compile(r"(-?\d{1,15})(?:/(-?\d{1,15})?(?:/(?:-?\d+)?)?)?", flags=re.ASCII)
_WHOLE = re.compile(r"-?\d{1,15}", flags=re.ASCII)

# A few kilobytes of which may become any number of gigabytes; unpacked files are read.
_ARCHIVES = ("zip", "bz2")

# Memory for a byte of a mesh file [bytes], at least.
_BYTE = 3


def repaired(soup: Soup, name: str) -> Mesh:
    """Make a mesh of a triangle soup, and close the holes of each of its parts by itself.

    Nothing else changes: every part stays, with its texture coordinates; those of a new triangle
    are the ones at the nearest vertex of the rim. Triangles with vertices that are not finite are
    dropped.

    Parameters
    ----------
    name : str
        Its name in messages.

    Raises
    ------
    MeshError
        If no mesh can be made, pymeshfix is not installed, or it fails.
    """
    finite = np.isfinite(soup.V[soup.F]).all(axis=(1, 2))
    if not finite.any():
        raise MeshError(
            f"{name}: nothing is left to repair: every triangle has a vertex that is NaN or "
            f"infinite"
        )
    uv = None if soup.corner_uv is None else soup.corner_uv[finite]
    mesh = Mesh.from_arrays(soup.V, soup.F[finite], uv, name)
    if not finite.all():
        dropped = (
            f"{counted(int((~finite).sum()), 'triangle')} with vertices that are NaN or "
            f"infinite dropped"
        )
        mesh = dataclasses.replace(mesh, notes=(dropped, *mesh.notes))
    if mesh.closed:
        return mesh
    if importlib.util.find_spec("pymeshfix") is None:
        holes = (
            f"{counted(sum(map(len, mesh.rims)), 'boundary edge')} round "
            f"{counted(len(mesh.rims), 'hole')}"
        )
        raise MeshError(f"{mesh.name} is open: {holes}; for --repair, run {_INSTALL}")
    with_rims = np.isin(mesh.F, np.concatenate(mesh.rims)).any(axis=1)
    open_part = np.isin(mesh.components, np.unique(mesh.components[with_rims]))
    vertices, F = np.unique(mesh.F[open_part], return_inverse=True)
    try:
        new_V, lids = _lids(mesh.V[vertices], F.reshape(-1, 3))
    except MeshError as error:
        raise MeshError(f"{mesh.name}: pymeshfix cannot repair it ({error})") from error
    lids = np.append(vertices, len(mesh.V) + np.arange(len(new_V)))[lids]
    V = np.vstack([mesh.V, new_V])
    uv = mesh.corner_uv
    if uv is not None and mesh.uv is not None:
        rim = np.concatenate(mesh.rims)
        uv = np.concatenate([uv, mesh.uv[rim[cKDTree(V[rim]).query(V[lids])[1]]]])
    result = Mesh.from_arrays(V, np.vstack([mesh.F, lids]), uv, mesh.name)
    return dataclasses.replace(result, notes=(*mesh.notes, *_told(mesh, result), *result.notes))


def _told(mesh: Mesh, result: Mesh) -> list[str]:
    """What was closed, hole by hole, and what stays open."""
    left = {tuple(point) for rim in result.rims for point in result.V[rim].tolist()}
    closed = [rim for rim in mesh.rims if not left.issuperset(map(tuple, mesh.V[rim].tolist()))]
    closed.sort(key=len, reverse=True)
    notes = [
        f"hole closed: {counted(len(rim), 'edge')}, {np.ptp(mesh.V[rim], axis=0).max():.3g} m "
        f"wide, "
        f"round {place(mesh.V[rim].mean(axis=0))}"
        for rim in closed[:_TOLD]
    ]
    if len(closed) > _TOLD:
        notes.append(f"{counted(len(closed) - _TOLD, 'smaller hole')} closed")
    if result.rims:
        notes.append(
            f"{counted(len(result.rims), 'rim')} left open, where a lid would lie on other "
            f"triangles"
        )
    return notes


def _lids(
    V: NDArray[np.float64], F: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """New vertices, and triangles of old and new ones that close the holes."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "source.npz"
        target = Path(folder) / "target.npz"
        np.savez(source, V=V, F=F)
        # -P: modules beside the program must not hide the standard library's
        program = [
            sys.executable,
            "-P",
            str(Path(__file__).with_name("meshfix.py")),
            str(source),
            str(target),
        ]
        try:
            subprocess.run(
                program,
                check=True,
                capture_output=True,
                stdin=subprocess.DEVNULL,
                timeout=_TIME_LIMIT,
            )
        except subprocess.TimeoutExpired as error:
            raise MeshError(f"it did not finish within {_TIME_LIMIT} s") from error
        except (OSError, subprocess.CalledProcessError) as error:
            raise MeshError("it failed") from error
        with np.load(target) as arrays:
            filled_V = arrays["V"]
            filled_F = arrays["F"].astype(np.int64)
    # it puts new vertices in front of the old ones, and new triangles anywhere
    added = len(filled_V) - len(V)
    if added < 0 or not np.array_equal(filled_V[added:], V):
        raise MeshError("it changed the surface itself")
    numbers = (filled_F - added) % len(filled_V)
    known = {tuple(triangle) for triangle in np.sort(F, axis=1).tolist()}
    new = [tuple(triangle) not in known for triangle in np.sort(numbers, axis=1).tolist()]
    return filled_V[:added], numbers[np.array(new, dtype=bool)]


def read_obj(content: bytes) -> Soup:
    """Triangles of a Wavefront OBJ file: all its objects, groups and materials together.

    Raises `MeshError` for a line that cannot be read, or a vertex that does not exist.
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
        at = np.argmax(wrong)
        number = np.repeat(lines, sizes)[at]
        raise MeshError(
            f"line {number} refers to vertex {vertex[at] + 1}; valid is 1 to {len(V)}, the "
            f"vertices given"
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

    Raises `MeshError` if the file is not an OFF file in text form, ends early, or refers to a
    vertex that does not exist.
    """
    rows = [
        words
        for line in _decoded(content).splitlines()
        if (words := line.partition("#")[0].split())
    ]
    if not rows or not re.fullmatch(r"(ST)?C?N?OFF", rows[0][0].upper()) or "BINARY" in rows[0]:
        raise MeshError("it does not start with OFF, as an OFF file in text form does")
    counts = rows[0][1:] or (rows[1] if len(rows) > 1 else [])
    left = rows[1:] if rows[0][1:] else rows[2:]
    if len(counts) < 2 or not all(word.isdecimal() for word in counts[:2]):
        raise MeshError("the numbers of vertices and faces are missing after OFF")
    vertices = int(counts[0])
    faces = int(counts[1])
    if len(left) < vertices + faces:
        raise MeshError(
            f"it ends early: {vertices} vertices and {faces} faces are announced, {len(left)} "
            f"lines follow"
        )
    # the numbers of the lines are lost with the comments, so vertices are counted instead
    places = [_three(words, number, "vertex") for number, words in enumerate(left[:vertices], 1)]
    V = _numbers([word for row in places for word in row]).reshape(-1, 3)
    polygons = []
    for words in left[vertices : vertices + faces]:
        size = _whole(words[0])
        corners = [_whole(word) for word in words[1 : 1 + max(size, 0)]]
        if len(corners) != size:
            raise MeshError(
                f"the face {' '.join(words)[:40]!r} has {len(corners)} corners instead of {size}"
            )
        if any(not 0 <= corner < vertices for corner in corners):
            raise MeshError(
                f"the face {' '.join(words)[:40]!r} refers to a vertex outside 0 to {vertices - 1}"
            )
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
            f"line {line}: {word[:40]!r} is not a corner of a face; valid are 3, 3/1, 3//2 and "
            f"3/1/2, for example"
        )
    vertex = int(match[1])
    pair = int(match[2] or 0)
    return (vertex - 1 if vertex >= 0 else places + vertex), (
        pair - 1 if pair >= 0 else pairs + pair
    )


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


# trimesh logs whole tracebacks; without a handler Python prints them to stderr
logging.getLogger("trimesh").addHandler(logging.NullHandler())

_READERS = {".obj": read_obj, ".off": read_off, ".ply": read_ply}


@checked(MeshError, path=PATH)
def load_mesh(path: str | Path, repair: bool = False, wrap: bool = False) -> Mesh:
    """Read a mesh file: OBJ, OFF, PLY, STL, GLB, or any other format that trimesh reads.

    All parts of the file (objects, materials, nodes, each where its transform puts it) make one
    mesh. It may be open, of any genus, and in several parts. `Mesh.from_arrays` says what is done
    to it; the mesh's `notes` tell it.

    Parameters
    ----------
    path : path
    repair : bool
        Close the holes, part by part (needs the package pymeshfix).
    wrap : bool
        Take a closed surface round the mesh in its place, see `wrap`.

    Raises
    ------
    MeshError
        If the file is missing, cannot be read, or holds no triangle with an area.
    """
    path = Path(path)
    check_mesh_file(path)
    soup = _read(path)
    if len(soup.F) == 0:
        points = (
            f", only {counted(len(soup.V), 'point')}; make a surface of them first"
            if len(soup.V)
            else ""
        )
        raise MeshError(f"mesh file {str(path)!r} holds no triangles{points}")
    mesh = (
        repaired(soup, path.name)
        if repair
        else Mesh.from_arrays(soup.V, soup.F, soup.corner_uv, path.name)
    )
    mesh = dataclasses.replace(mesh, notes=(*soup.notes, *mesh.notes))
    if wrap:
        return wrapped(mesh).mesh
    advice = many_parts(mesh)
    return dataclasses.replace(mesh, notes=(*mesh.notes, advice)) if advice else mesh


def check_mesh_file(path: Path) -> None:
    """Make sure, before anything that takes time, that there is a file to read a mesh from; raises `MeshError`."""
    try:
        if path.is_dir():
            raise MeshError(
                f"{str(path)!r} is a folder; give the path of an OBJ, PLY, STL, OFF or GLB file"
            )
        if not path.is_file():
            problem = "is not a regular file" if path.exists() else "does not exist"
            raise MeshError(
                f"mesh file {str(path)!r} {problem}; give the path of an OBJ, PLY, STL, OFF or GLB "
                f"file"
            )
    except OSError as error:  # a name longer than the system's
        raise MeshError(
            f"mesh file {str(path)!r} cannot be read: {error.strerror or error}"
        ) from error


def _read(path: Path) -> Soup:
    kind = path.suffix[1:].upper()
    file = f"mesh file {str(path)!r}"
    try:
        if path.stat().st_size == 0:
            raise MeshError(f"{file} is empty")
        require_memory(MeshError, _BYTE * path.stat().st_size, file, "take a coarser mesh")
        if path.suffix.lower() in _READERS:
            return _READERS[path.suffix.lower()](path.read_bytes())
        if kind.lower() not in trimesh.available_formats() or kind.lower() in _ARCHIVES:
            raise MeshError(
                f"{file} has an unknown ending; valid are .obj, .off, .ply, .stl and .glb, unpacked"
            )
        if path.suffix.lower() == ".gltf":
            _check_buffers(path)
        with path.open("rb"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _parts(trimesh.load_scene(path, process=False))
    except MeshError as error:
        if repr(str(path)) in str(error):
            raise
        raise MeshError(f"{file} cannot be read: {error}") from error
    except OSError as error:
        raise MeshError(f"{file} cannot be read: {error.strerror or error}") from error
    except MemoryError:
        raise
    except Exception as error:  # trimesh lets its parsers' exceptions through
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise MeshError(
            f"{file} cannot be read: it is damaged or not a {kind} file ({reason})"
        ) from error


def _check_buffers(path: Path) -> None:
    """Make sure that what a glTF file names are regular files: reading a FIFO would wait for ever."""
    content = json.loads(path.read_bytes())
    for each in (*content.get("buffers", ()), *content.get("images", ())):
        uri = each.get("uri", "data:")
        if not uri.startswith("data:") and not (path.parent / unquote(uri)).is_file():
            raise MeshError(f"it names {uri[:80]!r}, which does not exist or is not a regular file")


def _parts(scene: trimesh.Scene) -> Soup:
    """All triangle meshes of a scene, each where its node puts it.

    Images and materials are ignored.
    """
    V = [np.empty((0, 3))]
    F = [np.empty((0, 3), np.int64)]
    corner_uv = [np.empty((0, 3, 2))]
    textured = False
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        part = scene.geometry[name]
        triangles = np.asarray(getattr(part, "faces", ()), dtype=np.int64)
        vertices = np.asarray(part.vertices, dtype=np.float64)
        if len(triangles) == 0:
            V.append(vertices.reshape(-1, 3))  # points, or lines
            continue
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise MeshError(
                f"a triangle refers to vertex {triangles.max()}; valid is 0 to {len(vertices) - 1}"
            )
        uv = np.asarray(getattr(part.visual, "uv", None), dtype=np.float64)
        if uv.shape == (len(vertices), 2):
            textured = True
        else:
            uv = np.zeros((len(vertices), 2))
        F.append(triangles + sum(map(len, V)))
        corner_uv.append(uv[triangles])
        # an identity would still round
        moved = (
            vertices
            if np.array_equal(transform, np.eye(4))
            else trimesh.transform_points(vertices, transform)
        )
        V.append(moved)
    return Soup(
        np.concatenate(V), np.concatenate(F), np.concatenate(corner_uv) if textured else None
    )
