"""Holes of a mesh closed, on request, by pymeshfix (Attene 2010, a package of its own under the GPL)."""

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
from .corners import counted, place
from .mesh import Mesh
from .ply import Soup

_INSTALL = "pip install 'ripple-sim[repair]' (it adds the package pymeshfix, which is under the GPL)"
_TIME_LIMIT = 120  # [s]; a hundred thousand triangles take a few, hopeless cases hours
_TOLD = 8  # holes named one by one


def repaired(soup: Soup, name: str) -> Mesh:
    """Make a mesh of a triangle soup, and close the holes of each of its parts by itself.

    Nothing else changes: every part stays, with its texture coordinates; those of a new triangle are the ones at the
    nearest vertex of the rim. Triangles with vertices that are not finite are dropped.

    Parameters
    ----------
    soup : Soup
    name : str
        Its name in messages.

    Raises
    ------
    MeshError
        If no mesh can be made, pymeshfix is not installed, or it fails.
    """
    finite = np.isfinite(soup.V[soup.F]).all(axis=(1, 2))
    if not finite.any():
        raise MeshError(f"{name}: nothing is left to repair: every triangle has a vertex that is NaN or infinite")
    uv = None if soup.corner_uv is None else soup.corner_uv[finite]
    mesh = Mesh.from_arrays(soup.V, soup.F[finite], uv, name)
    if not finite.all():
        dropped = f"{counted(int((~finite).sum()), 'triangle')} with vertices that are NaN or infinite dropped"
        mesh = dataclasses.replace(mesh, notes=(dropped, *mesh.notes))
    return mesh if mesh.closed else _closed(mesh)


def _closed(mesh: Mesh) -> Mesh:
    if importlib.util.find_spec("pymeshfix") is None:
        holes = f"{counted(sum(map(len, mesh.rims)), 'boundary edge')} round {counted(len(mesh.rims), 'hole')}"
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
    uv = None
    if mesh.uv is not None and mesh.corner_uv is not None:
        rim = np.concatenate(mesh.rims)
        uv = np.concatenate([mesh.corner_uv, mesh.uv[rim[cKDTree(V[rim]).query(V[lids])[1]]]])
    result = Mesh.from_arrays(V, np.vstack([mesh.F, lids]), uv, mesh.name)
    return dataclasses.replace(result, notes=(*mesh.notes, *_told(mesh, result), *result.notes))


def _told(mesh: Mesh, result: Mesh) -> list[str]:
    """What was closed, hole by hole, and what stays open."""
    left = {tuple(point) for rim in result.rims for point in result.V[rim].tolist()}
    closed = [rim for rim in mesh.rims if not left.issuperset(map(tuple, mesh.V[rim].tolist()))]
    closed.sort(key=len, reverse=True)
    notes = [
        f"hole closed: {counted(len(rim), 'edge')}, {np.ptp(mesh.V[rim], axis=0).max():.3g} m wide, "
        f"round {place(mesh.V[rim].mean(axis=0))}"
        for rim in closed[:_TOLD]
    ]
    if len(closed) > _TOLD:
        notes.append(f"{counted(len(closed) - _TOLD, 'smaller hole')} closed")
    if result.rims:
        notes.append(f"{counted(len(result.rims), 'rim')} left open, where a lid would lie on other triangles")
    return notes


def _lids(V: NDArray[np.float64], F: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """New vertices, and triangles of old and new ones that close the holes."""
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "source.npz", Path(folder) / "target.npz"
        np.savez(source, V=V, F=F)
        # -P: modules beside the program must not hide the standard library's
        program = [sys.executable, "-P", str(Path(__file__).with_name("meshfix.py")), str(source), str(target)]
        try:
            subprocess.run(program, check=True, capture_output=True, stdin=subprocess.DEVNULL, timeout=_TIME_LIMIT)
        except subprocess.TimeoutExpired as error:
            raise MeshError(f"it did not finish within {_TIME_LIMIT} s") from error
        except (OSError, subprocess.CalledProcessError) as error:
            raise MeshError("it failed") from error
        with np.load(target) as arrays:
            filled_V, filled_F = arrays["V"], arrays["F"].astype(np.int64)
    # it puts new vertices in front of the old ones, and new triangles anywhere
    added = len(filled_V) - len(V)
    if added < 0 or not np.array_equal(filled_V[added:], V):
        raise MeshError("it changed the surface itself")
    old_first = np.roll(np.arange(len(filled_V)), -added)
    numbers = np.argsort(old_first)[filled_F]
    known = {tuple(triangle) for triangle in np.sort(F, axis=1).tolist()}
    new = [tuple(triangle) not in known for triangle in np.sort(numbers, axis=1).tolist()]
    return filled_V[:added], numbers[np.array(new, dtype=bool)]
