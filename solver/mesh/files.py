"""Meshes from files: each format has its reader, and all parts of a file become one mesh."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

from ..errors import PATH, MeshError, checked
from ..memory import require_memory
from .clean import counted
from .formats.gltf import read_gltf
from .formats.obj import read_obj
from .formats.off import read_off
from .formats.other import read_other
from .formats.ply import read_ply
from .formats.stl import read_stl
from .mesh import Mesh, many_parts
from .repair import repaired
from .soup import Soup
from .wrap import wrap as wrapped

# Readers by the file's ending; assimp or trimesh reads all other formats.
_READERS: dict[str, Callable[[Path], Soup]] = {
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
}

# Memory that reading takes, at least, in bytes for each byte of the file.
_BYTES_PER_FILE_BYTE = 3


@checked(MeshError, path=PATH)
def load_mesh(path: str | Path, repair: bool = False, wrap: bool = False) -> Mesh:
    """Read a mesh file: OBJ, OFF, PLY, STL, glTF, or another format.

    The other formats, such as FBX, COLLADA, 3DS and X3D, need the package assimp-py.

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
        else Mesh.from_arrays(soup.V, soup.F, soup.corner_uv, path.name, soup.looks)
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
            return _READERS[ending](path)
        return read_other(path)
    except MeshError as error:
        if repr(str(path)) in str(error):
            raise
        raise MeshError(f"{file} cannot be read: {error}") from error
    except OSError as error:
        raise MeshError(f"{file} cannot be read: {error.strerror or error}") from error
    except MemoryError:
        raise
    except Exception as error:  # of trimesh's parsers, and of JSON of another form than is expected
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise MeshError(
            f"{file} cannot be read: it is damaged or not a {kind} file ({reason})"
        ) from error
