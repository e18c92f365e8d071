"""Mesh files of any format, read and joined to one mesh."""

from __future__ import annotations

import dataclasses
import json
import logging
import warnings
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import trimesh

from ..checked import PATH, checked
from ..errors import MeshError
from ..files import require_memory
from .counting import counted
from .genus_zero import many_parts
from .mesh import Mesh
from .ply_format import read_ply
from .polygons import Soup
from .repair import repaired
from .text_formats import read_obj, read_off
from .wrap import wrap as wrapped

# trimesh logs whole tracebacks; without a handler Python prints them to stderr
logging.getLogger("trimesh").addHandler(logging.NullHandler())

# A few kilobytes of which may become any number of gigabytes; unpacked files are read.
_ARCHIVES = ("zip", "bz2")

# Memory for a byte of a mesh file [bytes], at least.
_BYTE = 3

_READERS = {".obj": read_obj, ".off": read_off, ".ply": read_ply}


@checked(MeshError, path=PATH)
def load_mesh(path: str | Path, repair: bool = False, wrap: bool = False) -> Mesh:
    """Read a mesh file: OBJ, OFF, PLY, STL, GLB, or any other format that trimesh reads.

    All parts of the file (objects, materials, nodes, each where its transform puts it) make one mesh. It may be open,
    of any genus, and in several parts. `Mesh.from_arrays` says what is done to it; the mesh's `notes` tell it.

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
        raise MeshError(f"mesh file {str(path)!r} holds no triangles{_points_only(soup)}")
    mesh = repaired(soup, path.name) if repair else Mesh.from_arrays(soup.V, soup.F, soup.corner_uv, path.name)
    mesh = dataclasses.replace(mesh, notes=(*soup.notes, *mesh.notes))
    if wrap:
        return wrapped(mesh).mesh
    advice = many_parts(mesh)
    return dataclasses.replace(mesh, notes=(*mesh.notes, advice)) if advice else mesh


def check_mesh_file(path: Path) -> None:
    """Make sure, before anything that takes time, that there is a file to read a mesh from.

    Raises
    ------
    MeshError
    """
    try:
        if path.is_dir():
            raise MeshError(f"{str(path)!r} is a folder; give the path of an OBJ, PLY, STL, OFF or GLB file")
        if not path.is_file():
            problem = "is not a regular file" if path.exists() else "does not exist"
            raise MeshError(f"mesh file {str(path)!r} {problem}; give the path of an OBJ, PLY, STL, OFF or GLB file")
    except OSError as error:  # a name longer than the system's
        raise MeshError(f"mesh file {str(path)!r} cannot be read: {error.strerror or error}") from error


def _points_only(soup: Soup) -> str:
    return f", only {counted(len(soup.V), 'point')}; make a surface of them first" if len(soup.V) else ""


def _read(path: Path) -> Soup:
    kind = path.suffix[1:].upper()
    try:
        if path.stat().st_size == 0:
            raise MeshError(f"mesh file {str(path)!r} is empty")
        require_memory(MeshError, _BYTE * path.stat().st_size, f"mesh file {str(path)!r}", "take a coarser mesh")
        if path.suffix.lower() in _READERS:
            return _READERS[path.suffix.lower()](path.read_bytes())
        if kind.lower() not in trimesh.available_formats() or kind.lower() in _ARCHIVES:
            raise MeshError(
                f"mesh file {str(path)!r} has an unknown ending; valid are .obj, .off, .ply, .stl and .glb, unpacked"
            )
        if path.suffix.lower() == ".gltf":
            _check_buffers(path)
        with path.open("rb"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _parts(trimesh.load_scene(path, process=False))
    except MeshError as error:
        if repr(str(path)) in str(error):
            raise
        raise MeshError(f"mesh file {str(path)!r} cannot be read: {error}") from error
    except OSError as error:
        raise MeshError(f"mesh file {str(path)!r} cannot be read: {error.strerror or error}") from error
    except MemoryError:
        raise
    except Exception as error:  # trimesh lets its parsers' exceptions through
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise MeshError(
            f"mesh file {str(path)!r} cannot be read: it is damaged or not a {kind} file ({reason})"
        ) from error


def _check_buffers(path: Path) -> None:
    """Make sure that what a glTF file names are regular files: reading a FIFO would wait for ever."""
    content = json.loads(path.read_bytes())
    for each in (*content.get("buffers", ()), *content.get("images", ())):
        uri = each.get("uri", "data:")
        if not uri.startswith("data:") and not (path.parent / unquote(uri)).is_file():
            raise MeshError(f"it names {uri[:80]!r}, which does not exist or is not a regular file")


def _parts(scene: trimesh.Scene) -> Soup:
    """All triangle meshes of a scene, each where its node puts it. Images and materials are ignored."""
    V, F, corner_uv = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], [np.empty((0, 3, 2))]
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
            raise MeshError(f"a triangle refers to vertex {triangles.max()}; valid is 0 to {len(vertices) - 1}")
        uv = np.asarray(getattr(part.visual, "uv", None), dtype=np.float64)
        if uv.shape == (len(vertices), 2):
            textured = True
        else:
            uv = np.zeros((len(vertices), 2))
        F.append(triangles + sum(map(len, V)))
        corner_uv.append(uv[triangles])
        # an identity would still round
        moved = vertices if np.array_equal(transform, np.eye(4)) else trimesh.transform_points(vertices, transform)
        V.append(moved)
    return Soup(np.concatenate(V), np.concatenate(F), np.concatenate(corner_uv) if textured else None)
