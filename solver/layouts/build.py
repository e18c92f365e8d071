"""From a mesh to its atlas, by way of the cache, in one of the layouts; and atlases from files."""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..cache import cache_path, make_room, mark_used
from ..errors import PATH, AtlasError, MeshError, SphereMapError, checked, instance
from ..mesh.mesh import Mesh, check_genus_zero
from ..texels.atlas import ADVICE, FORMAT, Atlas, read_atlas_file
from ..texels.chart_map import ChartMap, LinearChartMap
from ..texels.texel_mesh import TexelMesh
from ..texels.topology import glue
from .cube.atlas import CubeChartMap, SphereAtlas, atlas_from_sphere_map
from .cube.convention import check_memory, check_resolution
from .patches.atlas import PatchChartMap, patch_atlas
from .patches.pieces import Pieces
from .sphere_map import certify, conformal_sphere_map, progressive_sphere_map

# "auto" takes the first of the others that fits a mesh.
LAYOUTS = ("auto", "cube", "patches")

Arrays = dict[str, NDArray]

_CHART_MAPS: dict[str, Callable[[Arrays], ChartMap]] = {
    "cube": lambda arrays: CubeChartMap(arrays["sphere"]),
    "patches": lambda arrays: PatchChartMap(Pieces(*(arrays[f"piece_{name}"] for name in Pieces._fields))),
    "given": lambda arrays: LinearChartMap(arrays["charts"], arrays["corners"], arrays["positions"].shape[1]),
}


@checked(AtlasError, path=PATH)
def load_atlas(path: str | Path) -> Atlas:
    """Read an atlas written by `Atlas.save`.

    Raises
    ------
    AtlasError
        If the file is missing, truncated, changed, or of a version before 1.0.0 or after this one.
    """
    arrays = read_atlas_file(Path(path))
    kind, layout = arrays["kind"].tolist()
    try:
        chart_map = _CHART_MAPS[layout](arrays)
    except KeyError as error:
        raise AtlasError(f"atlas file {str(path)!r} lacks {error} or is of another layout; {ADVICE}") from error
    topology = glue(arrays["glued"], arrays["positions"].shape[1])
    return (SphereAtlas if kind == SphereAtlas.__name__ else Atlas)(
        mesh=Mesh(arrays["V"], arrays["F"], arrays.get("uv"), arrays.get("corner_uv")),
        texels=TexelMesh(
            topology,
            *(arrays[name] for name in ("positions", "normals", "areas")),
            *(arrays.get(name) for name in ("beyond", "detours")),
        ),
        chart_map=chart_map,
        triangles=arrays["triangles"],
        barycentrics=arrays["barycentrics"],
    )


SPHERE_MAPS: dict[str, Callable[[NDArray, NDArray], NDArray]] = {
    "progressive": progressive_sphere_map,
    "conformal": conformal_sphere_map,
}


@checked(AtlasError, mesh=instance(Mesh, ", from load_mesh or Mesh.from_arrays"))
def build_atlas(
    mesh: Mesh,
    resolution: int = 128,
    method: str = "progressive",
    cache: bool = True,
    layout: str = "auto",
    sphere: NDArray[np.float64] | None = None,
) -> Atlas:
    """Build the atlas of a mesh.

    Parameters
    ----------
    mesh : Mesh
        From `load_mesh` or `Mesh.from_arrays`.
    resolution : int
        Texels along a chart's side of the cube layout, N; 6 N^2 texels in all, and about as many in every layout,
        or more where charts would have less than 4 x 4.
    method : str
        Sphere map of the cube layout: "progressive" (fold-free, spreads area evenly) or "conformal" (keeps angles but
        starves limbs; the choice of the paper).
    cache : bool
        Keep the result in the user's cache folder and take it from there the next time; see `cache_limit`.
    layout : str
        "cube": six charts of N x N texels, for a closed mesh of genus 0 in one part. "patches": many small charts, for
        any mesh. "auto": cube where it fits.
    sphere : float64 [vertex_count, 3], optional
        Sphere map of the cube layout, where it is known already; `method` is not asked then.

    Raises
    ------
    AtlasError
        For an invalid resolution, method or layout, a mesh of which the patch layout finds no charts, or an atlas that
        cannot fit into memory.
    MeshError
        For the cube layout, if the mesh is not a closed surface of genus 0 in one part.
    SphereMapError
        For the cube layout, if no certified sphere map is found, or the given one is none of this mesh.
    """
    resolution = check_resolution(resolution)
    for kind, name, valid in (("sphere map method", method, tuple(SPHERE_MAPS)), ("layout", layout, LAYOUTS)):
        if name not in valid:
            raise AtlasError(f"{kind} {name!r} does not exist; valid are {', '.join(map(repr, valid))}")
    check_memory(resolution)
    cube = layout != "patches"
    if cube:
        try:
            check_genus_zero(mesh)
        except MeshError:
            if layout == "cube":
                raise
            cube = False
    start = time.perf_counter()
    path = None
    if cache:  # a file for each mesh and sphere map: that does not depend on the resolution, and rays are quick
        kind = "given" if cube and sphere is not None else method if cube else f"patches {resolution}"
        made_of = (mesh.V, mesh.F) if sphere is None or not cube else (mesh.V, mesh.F, sphere)
        path = cache_path(f"{FORMAT} {kind}", made_of)
    stored = None if path is None else _read_cache(path, mesh, cube)
    # charts of the patch layout have a resolution of their own, and a file for each of the atlas's
    if stored is not None and (not cube or stored.resolution == resolution):
        stored.timings["cache"] = time.perf_counter() - start
        return stored
    if cube:
        atlas = _cube(mesh, resolution, method, sphere if stored is None else stored.sphere)
    else:
        atlas = patch_atlas(mesh, resolution)
    if path is not None:
        # a folder that cannot be written costs the next call its time, nothing else
        with contextlib.suppress(AtlasError, OSError):
            if path.is_symlink():  # whatever it leads to is not ours
                path.unlink()
            atlas.save(path, overwrite=True)
            make_room(path)
    return atlas


def _cube(mesh: Mesh, resolution: int, method: str, known: NDArray[np.float64] | None) -> Atlas:
    """Atlas of the cube layout, by way of a sphere map that is known already, or by a method."""
    start = time.perf_counter()
    if known is None:
        sphere = SPHERE_MAPS[method](mesh.V, mesh.F)
    else:
        sphere = np.ascontiguousarray(known, dtype=np.float64)
        if sphere.shape != mesh.V.shape or not np.isfinite(sphere).all() or not certify(mesh.F, sphere).valid:
            raise SphereMapError(
                f"sphere has the shape {sphere.shape} and is no fold-free sphere map of the mesh, which has "
                f"{len(mesh.V)} vertices; leave it out to have one computed"
            )
    mapped = time.perf_counter()
    atlas = atlas_from_sphere_map(mesh, sphere, resolution)
    atlas.timings.update(sphere_map=mapped - start, rays=time.perf_counter() - mapped)
    return atlas


def _read_cache(path: Path, mesh: Mesh, cube: bool) -> Atlas | None:
    """The atlas of this very mesh in this layout, or None where the file is missing, does not verify, or is another."""
    try:
        stored = load_atlas(path)
    except AtlasError:
        return None
    same = np.array_equal(stored.mesh.V, mesh.V) and np.array_equal(stored.mesh.F, mesh.F)
    if not same or (stored.layout == "cube") != cube:
        return None
    mark_used(path)
    return dataclasses.replace(stored, mesh=mesh, timings={})
