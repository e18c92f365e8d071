"""Atlases on disk: one verified file format, for users and for the cache."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ripple_sim.solver.atomic_file import whole_file
from ripple_sim.solver.errors import AtlasError
from ripple_sim.solver.mesh.mesh import Mesh
from ripple_sim.solver.texels.cube_map.sphere_atlas import SphereAtlas

from .array_file import read_arrays, write_arrays
from .atlas import Atlas

# Raise it when the sphere map or the file's layout changes: older files are then rebuilt.
FORMAT = 8
_FIELDS = ("sphere", "positions", "normals", "triangles", "barycentrics")
_INDICES = ("F", "triangles")  # in 32 bits


def save_atlas(atlas: Atlas, path: str | Path) -> None:
    """Write an atlas; the file appears whole or not at all.

    Raises
    ------
    AtlasError
        If the file cannot be written.
    """
    path = Path(path)
    arrays = {name: getattr(atlas, name) for name in _FIELDS} | {"V": atlas.mesh.V, "F": atlas.mesh.F}
    if atlas.mesh.corner_uv is not None:
        arrays |= {"uv": atlas.mesh.uv, "corner_uv": atlas.mesh.corner_uv}
    arrays |= {name: arrays[name].astype(np.int32) for name in _INDICES}
    arrays |= {"kind": np.array([type(atlas).__name__]), "format": np.array([FORMAT])}
    try:
        with whole_file(path) as unfinished, unfinished.open("wb") as file:
            write_arrays(file, arrays)
    except OSError as error:
        raise AtlasError(f"atlas file {str(path)!r} cannot be written: {error.strerror or error}") from error


def load_atlas(path: str | Path) -> Atlas:
    """Read an atlas written by `Atlas.save`.

    Raises
    ------
    AtlasError
        If the file is missing, truncated, changed, or not an atlas of this version.
    """
    path = Path(path)
    if not path.is_file():
        problem = "is no file" if path.exists() else "does not exist"
        raise AtlasError(f"atlas file {str(path)!r} {problem}; make one with `ripple-sim atlas MESH -o FILE`")
    advice = "make it again with `ripple-sim atlas MESH -o FILE`"
    try:
        arrays = read_arrays(path)
    except (OSError, ValueError) as error:
        raise AtlasError(f"atlas file {str(path)!r} is damaged or no atlas ({error}); {advice}") from error
    missing = {"V", "F", "kind", "format", *_FIELDS} - arrays.keys()
    if missing or arrays["format"].tolist() != [FORMAT]:
        raise AtlasError(f"atlas file {str(path)!r} is no atlas or of another version; {advice}")
    arrays |= {name: arrays[name].astype(np.int64) for name in _INDICES}
    mesh = Mesh(arrays["V"], arrays["F"], arrays.get("uv"), arrays.get("corner_uv"))
    kind = SphereAtlas if arrays["kind"].tolist() == [SphereAtlas.__name__] else Atlas
    return kind(
        mesh=mesh,
        sphere=arrays["sphere"],
        positions=arrays["positions"],
        normals=arrays["normals"],
        triangles=arrays["triangles"],
        barycentrics=arrays["barycentrics"],
    )
