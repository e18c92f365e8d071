"""Meshes from files: each format has its reader, and all parts of a file become one mesh.

OBJ and OFF files are read in `obj_off`, PLY files in `ply`, all other formats by trimesh.
"""

from __future__ import annotations

import dataclasses
import json
import logging
import warnings
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import trimesh

from ..errors import PATH, MeshError, checked
from ..memory import require_memory
from .clean import counted
from .mesh import Mesh, many_parts
from .obj_off import read_obj, read_off
from .ply import read_ply
from .repair import repaired
from .soup import Soup
from .wrap import wrap as wrapped

# Readers of this package, by the file's ending; trimesh reads all other formats.
_READERS = {".obj": read_obj, ".off": read_off, ".ply": read_ply}

# Archives are refused: a few kilobytes may unpack to any number of gigabytes.
_ARCHIVES = ("zip", "bz2")

# Memory that reading takes, at least, in bytes for each byte of the file.
_BYTES_PER_FILE_BYTE = 3

# trimesh logs whole tracebacks; without a handler Python prints them to stderr
logging.getLogger("trimesh").addHandler(logging.NullHandler())


@checked(MeshError, path=PATH)
def load_mesh(path: str | Path, repair: bool = False, wrap: bool = False) -> Mesh:
    """Read a mesh file: OBJ, OFF, PLY, STL, GLB, or any other format that trimesh reads.

    All parts of the file (objects, materials, nodes, each where its transform puts it) make one
    mesh. The mesh may be open, of any genus, and in several parts. `Mesh.from_arrays` lists what is
    done to the triangles; the mesh's `notes` say what was done to this mesh.

    Parameters
    ----------
    path : path
    repair : bool
        Close the holes, part by part (needs the package pymeshfix).
    wrap : bool
        Replace the mesh by a closed surface round it, see `wrap`.

    Raises
    ------
    MeshError
        If the file is missing, cannot be read, or holds no triangle with an area.
    """
    path = Path(path)
    check_mesh_file(path)
    soup = _read(path)
    if len(soup.F) == 0:
        points = ""
        if len(soup.V):
            points = f", only {counted(len(soup.V), 'point')}; make a surface of them first"
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
    if advice:
        mesh = dataclasses.replace(mesh, notes=(*mesh.notes, advice))
    return mesh


def check_mesh_file(path: Path) -> None:
    """Raise `MeshError` unless there is a file; callers check this before work that takes long."""
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
    except OSError as error:  # a name longer than the system allows
        raise MeshError(
            f"mesh file {str(path)!r} cannot be read: {error.strerror or error}"
        ) from error


def _read(path: Path) -> Soup:
    """Triangles of a file, by the reader of its ending; every failure is a `MeshError`."""
    ending = path.suffix.lower()
    kind = path.suffix[1:].upper()
    file = f"mesh file {str(path)!r}"
    try:
        file_bytes = path.stat().st_size
        if file_bytes == 0:
            raise MeshError(f"{file} is empty")
        require_memory(MeshError, _BYTES_PER_FILE_BYTE * file_bytes, file, "take a coarser mesh")
        if ending in _READERS:
            return _READERS[ending](path.read_bytes())
        if kind.lower() not in trimesh.available_formats() or kind.lower() in _ARCHIVES:
            raise MeshError(
                f"{file} has an unknown ending: mesh files must end in .obj, .off, .ply, .stl "
                "or .glb, unpacked"
            )
        if ending == ".gltf":
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
    """Raise `MeshError` unless all that a glTF file names are regular files.

    Reading a FIFO would wait for ever.
    """
    content = json.loads(path.read_bytes())
    for resource in (*content.get("buffers", ()), *content.get("images", ())):
        uri = resource.get("uri", "data:")
        if uri.startswith("data:"):
            continue
        if not (path.parent / unquote(uri)).is_file():
            raise MeshError(f"it names {uri[:80]!r}, which does not exist or is not a regular file")


def _parts(scene: trimesh.Scene) -> Soup:
    """All triangle meshes of a scene, each where its node puts it.

    Images and materials are ignored.
    """
    V = [np.empty((0, 3))]
    F = [np.empty((0, 3), np.int64)]
    corner_uv = [np.empty((0, 3, 2))]
    vertex_count = 0
    textured = False
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        part = scene.geometry[name]
        triangles = np.asarray(getattr(part, "faces", ()), dtype=np.int64)
        vertices = np.asarray(part.vertices, dtype=np.float64)
        if len(triangles) == 0:
            V.append(vertices.reshape(-1, 3))  # points, or lines
            vertex_count += len(V[-1])
            continue
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise MeshError(
                f"the vertices of triangles must be 0 to {len(vertices) - 1}, got {triangles.max()}"
            )
        uv = np.asarray(getattr(part.visual, "uv", None), dtype=np.float64)
        if uv.shape == (len(vertices), 2):
            textured = True
        else:
            uv = np.zeros((len(vertices), 2))
        F.append(triangles + vertex_count)
        corner_uv.append(uv[triangles])
        # transforming by the identity would still round
        if not np.array_equal(transform, np.eye(4)):
            vertices = trimesh.transform_points(vertices, transform)
        V.append(vertices)
        vertex_count += len(vertices)
    all_uv = np.concatenate(corner_uv) if textured else None
    return Soup(np.concatenate(V), np.concatenate(F), all_uv)
