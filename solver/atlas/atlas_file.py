"""Atlases on disk: one verified file format, for users and for the cache."""

from __future__ import annotations

import hashlib
import zipfile
from pathlib import Path

import numpy as np

from ..errors import AtlasError
from ..mesh.mesh import Mesh
from ..whole_file import whole_file
from .analytic import SphereAtlas
from .atlas import Atlas

# Raise it when the sphere map or the file's layout changes: older files are then rebuilt.
FORMAT = 4
_FIELDS = ("sphere", "positions", "normals", "triangles", "barycentrics")


def save_atlas(atlas: Atlas, path: str | Path) -> None:
    """Write an atlas; the file appears whole or not at all.

    Raises
    ------
    AtlasError
        If the file cannot be written.
    """
    path = Path(path)
    arrays = {name: getattr(atlas, name) for name in _FIELDS}
    arrays |= {"V": atlas.mesh.V, "F": atlas.mesh.F}
    if atlas.mesh.corner_uv is not None:
        arrays |= {"uv": atlas.mesh.uv, "corner_uv": atlas.mesh.corner_uv}
    arrays["kind"] = np.array([type(atlas).__name__])
    arrays["digest"] = np.array([content_digest(arrays)])
    try:
        with whole_file(path) as unfinished, unfinished.open("wb") as file:
            np.savez(file, **arrays)
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
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise AtlasError(f"atlas file {str(path)!r} is damaged or no atlas ({error}); {advice}") from error
    digest = arrays.pop("digest", None)
    if digest is None or digest.shape != (1,) or digest[0] != content_digest(arrays):
        raise AtlasError(f"atlas file {str(path)!r} is damaged or of another version; {advice}")
    mesh = Mesh(arrays["V"], arrays["F"], arrays.get("uv"), arrays.get("corner_uv"))
    kind = SphereAtlas if arrays["kind"][0] == "SphereAtlas" else Atlas
    return kind(mesh, **{name: arrays[name] for name in _FIELDS})


def content_digest(arrays: dict[str, np.ndarray]) -> str:
    """SHA-256 of named arrays and of the format's number."""
    digest = hashlib.sha256(str(FORMAT).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
