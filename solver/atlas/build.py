"""From a mesh to its atlas, by way of the cache."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import platformdirs
from numpy.typing import NDArray

from ripple_sim.solver.cube_map.convention import check_resolution
from ripple_sim.solver.cube_map.cube_atlas import atlas_from_sphere_map
from ripple_sim.solver.errors import AtlasError
from ripple_sim.solver.mesh.genus_zero import check_genus_zero
from ripple_sim.solver.mesh.mesh import Mesh
from ripple_sim.solver.sphere_map import conformal_sphere_map, progressive_sphere_map
from ripple_sim.solver.texels.atlas import Atlas
from ripple_sim.solver.texels.atlas_file import FORMAT

from .load import load_atlas

SPHERE_MAPS: dict[str, Callable[[NDArray, NDArray], NDArray]] = {
    "progressive": progressive_sphere_map,
    "conformal": conformal_sphere_map,
}


def build_atlas(mesh: Mesh, resolution: int = 128, method: str = "progressive", cache: bool = True) -> Atlas:
    """Build the cube-map atlas of a mesh.

    Parameters
    ----------
    mesh : Mesh
        From `load_mesh` or `Mesh.from_arrays`.
    resolution : int
        Texels along a chart's side, N; 6 N^2 texels in all.
    method : str
        Sphere map: "progressive" (fold-free, spreads area evenly) or "conformal" (keeps angles but starves limbs; the
        choice of the paper).
    cache : bool
        Keep the result in the user's cache folder and take it from there the next time.

    Raises
    ------
    AtlasError
        For an invalid resolution or method.
    MeshError
        If the mesh is not a closed surface of genus 0 in one part, as the cube layout needs.
    SphereMapError
        If no certified sphere map is found.
    """
    resolution = check_resolution(resolution)
    if method not in SPHERE_MAPS:
        raise AtlasError(f"sphere map method {method!r} does not exist; valid are {', '.join(map(repr, SPHERE_MAPS))}")
    check_genus_zero(mesh)
    start = time.perf_counter()
    path = _cache_path(mesh, method) if cache else None
    stored = None if path is None else _read_cache(path, mesh)
    if stored is not None and stored.resolution == resolution:
        stored.timings["cache"] = time.perf_counter() - start
        return stored
    sphere = SPHERE_MAPS[method](mesh.V, mesh.F) if stored is None else stored.sphere
    mapped = time.perf_counter()
    atlas = atlas_from_sphere_map(mesh, sphere, resolution)
    atlas.timings.update(sphere_map=mapped - start, rays=time.perf_counter() - mapped)
    if path is not None:
        # a folder that cannot be written costs the next call its time, nothing else
        with contextlib.suppress(AtlasError):
            atlas.save(path)
    return atlas


def _cache_path(mesh: Mesh, method: str) -> Path:
    """One file for each mesh and method: the sphere map does not depend on the resolution, and rays are quick."""
    key = hashlib.sha256(f"{FORMAT} {method} {mesh.V.shape} {mesh.F.shape}".encode())
    key.update(np.ascontiguousarray(mesh.V).data)
    key.update(np.ascontiguousarray(mesh.F).data)
    return Path(platformdirs.user_cache_dir("ripple-sim")) / f"{key.hexdigest()[:32]}.npz"


def _read_cache(path: Path, mesh: Mesh) -> Atlas | None:
    """The atlas of this very mesh, or None where the file is missing, does not verify, or is of another mesh."""
    try:
        stored = load_atlas(path)
    except AtlasError:
        return None
    if not (np.array_equal(stored.mesh.V, mesh.V) and np.array_equal(stored.mesh.F, mesh.F)):
        return None
    return dataclasses.replace(stored, mesh=mesh, timings={})
