"""Closes the holes of a mesh on request, with pymeshfix (Attene 2010).

pymeshfix is an optional package under the GPL. It runs in a process of its own, see `meshfix`.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import MeshError
from .clean import counted, place
from .looks import Looks
from .mesh import Mesh
from .soup import Soup

# How to install pymeshfix, for messages.
_INSTALL = (
    "pip install 'ripple-sim[repair]' (it adds the package pymeshfix, which is under the GPL)"
)

# Time that pymeshfix may take [s]. A hundred thousand triangles take a few seconds; hopeless cases
# would take hours.
_TIME_LIMIT = 120

# Closed holes that get a note each, the longest first; one note counts the others.
_MAX_HOLE_NOTES = 8


def repaired(soup: Soup, name: str) -> Mesh:
    """Make a mesh of a triangle soup, and close the holes of each of its parts by itself.

    Nothing else changes: every part stays, with its texture coordinates. A corner of a new triangle
    gets the texture coordinates of the nearest vertex of the rim. Triangles with vertices that are
    not finite are dropped.

    Parameters
    ----------
    soup : Soup
    name : str
        Name of the mesh in messages.

    Raises
    ------
    MeshError
        If no mesh can be made, pymeshfix is not installed, or it fails.
    """
    mesh = _finite_mesh(soup, name)
    if mesh.closed:
        return mesh
    if importlib.util.find_spec("pymeshfix") is None:
        holes = (
            f"{counted(sum(map(len, mesh.rims)), 'boundary edge')} round "
            f"{counted(len(mesh.rims), 'hole')}"
        )
        raise MeshError(f"{mesh.name} is open: {holes}; for --repair, run {_INSTALL}")
    at_rim = np.isin(mesh.F, np.concatenate(mesh.rims)).any(axis=1)
    in_open_part = np.isin(mesh.components, np.unique(mesh.components[at_rim]))
    vertices, F = np.unique(mesh.F[in_open_part], return_inverse=True)
    try:
        new_V, lids = _lids(mesh.V[vertices], F.reshape(-1, 3))
    except MeshError as error:
        raise MeshError(f"{mesh.name}: pymeshfix cannot repair it ({error})") from error
    # from the numbers of the open parts to the numbers of the whole mesh
    lids = np.append(vertices, len(mesh.V) + np.arange(len(new_V)))[lids]
    V = np.vstack([mesh.V, new_V])
    rim = np.concatenate(mesh.rims)
    nearest = rim[cKDTree(V[rim]).query(V[lids])[1]]
    uv = mesh.corner_uv
    if uv is not None and mesh.uv is not None:
        uv = np.concatenate([uv, mesh.uv[nearest]])
    looks = _looks_of_lids(mesh, nearest)
    closed = Mesh.from_arrays(V, np.vstack([mesh.F, lids]), uv, mesh.name, looks)
    notes = (*mesh.notes, *_hole_notes(mesh, closed), *closed.notes)
    return dataclasses.replace(closed, notes=notes)


def _looks_of_lids(mesh: Mesh, nearest: NDArray[np.int64]) -> Looks | None:
    """Looks of a mesh and of its lids, whose corners are nearest to vertices [k, 3] of the mesh."""
    if mesh.looks is None:
        return None
    corner_of_vertex = np.zeros(len(mesh.V), dtype=np.int64)
    corner_of_vertex[mesh.F.ravel()] = np.arange(mesh.F.size)
    corner = corner_of_vertex[nearest]
    colors = mesh.looks.colors
    if colors is not None:
        colors = np.concatenate([colors, colors.reshape(-1, 4)[corner]])
    source = np.append(np.arange(len(mesh.F)), corner[:, 0] // 3)
    return mesh.looks.of_triangles(source, colors)


def _finite_mesh(soup: Soup, name: str) -> Mesh:
    """A mesh of the triangles whose vertices are finite; a note counts the others."""
    finite = np.isfinite(soup.V[soup.F]).all(axis=(1, 2))
    if not finite.any():
        raise MeshError(
            f"{name}: nothing is left to repair: every triangle has a vertex that is NaN or "
            f"infinite"
        )
    uv = None if soup.corner_uv is None else soup.corner_uv[finite]
    looks = soup.looks
    if looks is not None:
        colors = None if looks.colors is None else looks.colors[finite]
        looks = looks.of_triangles(np.flatnonzero(finite), colors)
    mesh = Mesh.from_arrays(soup.V, soup.F[finite], uv, name, looks)
    if finite.all():
        return mesh
    dropped = (
        f"{counted(int((~finite).sum()), 'triangle')} with vertices that are NaN or "
        f"infinite dropped"
    )
    return dataclasses.replace(mesh, notes=(dropped, *mesh.notes))


def _hole_notes(before: Mesh, after: Mesh) -> list[str]:
    """Notes on the holes that were closed, the longest first, and on the rims that stay open."""
    open_points: set[tuple[float, ...]] = set()
    for rim in after.rims:
        open_points.update(map(tuple, after.V[rim].tolist()))
    closed = []
    for rim in before.rims:
        points = map(tuple, before.V[rim].tolist())
        if not open_points.issuperset(points):
            closed.append(rim)
    closed.sort(key=len, reverse=True)
    notes = []
    for rim in closed[:_MAX_HOLE_NOTES]:
        width = np.ptp(before.V[rim], axis=0).max()  # [m]
        middle = before.V[rim].mean(axis=0)
        notes.append(
            f"hole closed: {counted(len(rim), 'edge')}, {width:.3g} m wide, round {place(middle)}"
        )
    if len(closed) > _MAX_HOLE_NOTES:
        notes.append(f"{counted(len(closed) - _MAX_HOLE_NOTES, 'smaller hole')} closed")
    if after.rims:
        notes.append(
            f"{counted(len(after.rims), 'rim')} left open, where a lid would lie on other triangles"
        )
    return notes


def _lids(
    V: NDArray[np.float64], F: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Lids for the holes of a surface, from pymeshfix.

    Returns
    -------
    new_V : [k, 3]
        New vertices [m].
    lids : [j, 3]
        New triangles; vertices from len(V) on are new ones.
    """
    filled_V, filled_F = _run_pymeshfix(V, F)
    # pymeshfix puts new vertices in front of the old ones, and new triangles anywhere
    added = len(filled_V) - len(V)
    if added < 0 or not np.array_equal(filled_V[added:], V):
        raise MeshError("it changed the surface itself")
    numbers = (filled_F - added) % len(filled_V)
    old_triangles = {tuple(triangle) for triangle in np.sort(F, axis=1).tolist()}
    is_new = [
        tuple(triangle) not in old_triangles for triangle in np.sort(numbers, axis=1).tolist()
    ]
    return filled_V[:added], numbers[np.array(is_new, dtype=bool)]


def _run_pymeshfix(
    V: NDArray[np.float64], F: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """All vertices and triangles of a surface after pymeshfix has filled its holes."""
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
            return arrays["V"], arrays["F"].astype(np.int64)
