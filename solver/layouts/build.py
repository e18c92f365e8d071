"""From a mesh to its atlas, by way of the cache, in one of the layouts; and atlases from files."""

from __future__ import annotations

import contextlib
import dataclasses
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..cache import cache_path, make_room, mark_used
from ..errors import PATH, AtlasError, MeshError, SphereMapError, checked, instance
from ..kernel import log
from ..mesh.clean import counted
from ..mesh.mesh import Mesh, check_genus_zero
from ..texels.atlas import ADVICE, FORMAT, Atlas, read_atlas_file
from ..texels.chart_map import ChartMap, LinearChartMap
from ..texels.texel_mesh import TexelMesh
from ..texels.topology import glue
from .choice import LONGEST_TEXEL, texel_length
from .cube.atlas import CubeChartMap, SphereAtlas, atlas_from_sphere_map
from .cube.convention import check_memory, check_resolution
from .patches.atlas import PatchChartMap, patch_atlas
from .patches.pieces import Pieces
from .sphere_map import certify, conformal_sphere_map, progressive_sphere_map

# "auto" chooses between the others; see `choice`.
LAYOUTS = ("auto", "cube", "patches")

# How long charts are laid in silence, and between two lines that tell of it [s].
_TOLD_EVERY = 15.0

Arrays = dict[str, NDArray]

_CHART_MAPS: dict[str, Callable[[Arrays], ChartMap]] = {
    "cube": lambda arrays: CubeChartMap(arrays["sphere"]),
    "patches": lambda arrays: PatchChartMap(
        Pieces(*(arrays[f"piece_{name}"] for name in Pieces._fields))
    ),
    "given": lambda arrays: LinearChartMap(
        arrays["charts"], arrays["corners"], arrays["positions"].shape[1]
    ),
}

SPHERE_MAPS: dict[str, Callable[[NDArray, NDArray], NDArray]] = {
    "progressive": progressive_sphere_map,
    "conformal": conformal_sphere_map,
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
        raise AtlasError(
            f"atlas file {str(path)!r} lacks {error} or is of another layout; {ADVICE}"
        ) from error
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
        notes=tuple(arrays["notes"].tolist()) if "notes" in arrays else (),
    )


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
        Texels along a chart's side of the cube layout, N; 6 N^2 texels in all, and about as many in
        every layout, or more where charts would have less than 4 x 4.
    method : str
        Sphere map of the cube layout: "progressive" (fold-free, spreads area evenly) or "conformal"
        (keeps angles but starves limbs; the choice of the paper).
    cache : bool
        Keep the result in the user's cache folder and take it from there the next time; see
        `cache_limit`.
    layout : str
        "cube": six charts of N x N texels, for a closed mesh of genus 0 in one part. "patches":
        many small charts, for any mesh. "auto": the cube for round meshes, patches for all that
        have long limbs, handles, rims or several parts. The choice depends on the mesh alone, and
        `Atlas.notes` says why limbs get patches.
    sphere : float64 [vertex_count, 3], optional
        Sphere map of the cube layout, where it is known already; `method` is not asked then, and
        "auto" takes the cube.

    Raises
    ------
    AtlasError
        For an invalid resolution, method or layout, a mesh of which the patch layout finds no
        charts, or an atlas that cannot fit into memory.
    MeshError
        For the cube layout, if the mesh is not a closed surface of genus 0 in one part.
    SphereMapError
        For the cube layout, if no certified sphere map is found, or the given one is none of this
        mesh.
    """
    resolution = check_resolution(resolution)
    for kind, name, valid in (
        ("sphere map method", method, tuple(SPHERE_MAPS)),
        ("layout", layout, LAYOUTS),
    ):
        if name not in valid:
            raise AtlasError(
                f"{kind} {name!r} does not exist; valid are {', '.join(map(repr, valid))}"
            )
    check_memory(resolution)
    builder = _Builder(mesh, resolution, method, cache, sphere)
    cube_fits = layout != "patches"
    if cube_fits:
        try:
            check_genus_zero(mesh)
        except MeshError:
            if layout == "cube":
                raise
            cube_fits = False
    if not cube_fits:
        return builder.patches()
    return builder.cube() if layout == "cube" or sphere is not None else builder.chosen()


@dataclasses.dataclass(frozen=True)
class _Builder:
    """Builds the atlas of a mesh in a layout, or takes it from the cache; see `build_atlas`."""

    mesh: Mesh
    resolution: int
    method: str
    cache: bool
    sphere: NDArray[np.float64] | None

    def patches(self) -> Atlas:
        """Atlas of the patch layout."""
        start = time.perf_counter()
        # charts have a resolution of their own, and a file for each of the atlas's
        path = self._path(f"patches {self.resolution}")
        stored = self._stored(path, start, "patches")
        if stored is not None:
            return stored
        return self._kept(path, _patches(self.mesh, self.resolution))

    def cube(self) -> Atlas:
        """Atlas of the cube layout, by way of a sphere map that is known already, or by the method."""
        start = time.perf_counter()
        path = self._path(self.method) if self.sphere is None else self._path("given", self.sphere)
        stored = self._stored(path, start, "cube")
        if stored is not None:
            return self._at_resolution(stored, path, start)
        return self._kept(path, self._six_charts(self._sphere_map(self.sphere), start))

    def chosen(self) -> Atlas:
        """Atlas in the layout that suits a closed mesh of genus 0, as its sphere map tells."""
        start = time.perf_counter()
        # files of their own, which say that the choice is made
        round_path = self._path(f"auto {self.method}")
        limbed_path = self._path(f"auto {self.method} {self.resolution}")
        stored = self._stored(round_path, start, "cube")
        if stored is not None:
            return self._at_resolution(stored, round_path, start)
        stored = self._stored(limbed_path, start, "patches", "cube")
        if stored is not None:
            return stored
        sphere = self._sphere_map(None)
        length = texel_length(self.mesh, sphere)
        if length > LONGEST_TEXEL:
            return self._kept(limbed_path, self._limbed(sphere, length, start))
        return self._kept(round_path, self._six_charts(sphere, start))

    def _at_resolution(self, stored: Atlas, path: Path | None, start: float) -> Atlas:
        """A stored atlas of the cube layout; of another resolution its sphere map, as rays are quick."""
        if stored.resolution == self.resolution:
            return stored
        return self._kept(path, self._six_charts(self._sphere_map(stored.sphere), start))

    def _limbed(self, sphere: NDArray[np.float64], length: float, start: float) -> Atlas:
        """Patches, or the cube where there are none, with a note: its texels are `length` times as long as wide."""
        mapped = time.perf_counter()
        try:
            atlas = _patches(self.mesh, self.resolution)
            note = (
                f"layout patches: texels of the cube would be up to {length:.0f} times as long "
                f"as wide, on limbs"
            )
        except AtlasError as error:
            atlas = self._six_charts(sphere, mapped)
            note = (
                f"layout cube, with texels up to {length:.0f} times as long as wide, since "
                f"patches fail: {error}"
            )
        timings = {"sphere_map": mapped - start, **atlas.timings}
        return dataclasses.replace(atlas, timings=timings, notes=(note,))

    def _sphere_map(self, known: NDArray[np.float64] | None) -> NDArray[np.float64]:
        """A sphere map that is known already, checked, or one by the method."""
        if known is None:
            return SPHERE_MAPS[self.method](self.mesh.V, self.mesh.F)
        sphere = np.ascontiguousarray(known, dtype=np.float64)
        if (
            sphere.shape != self.mesh.V.shape
            or not np.isfinite(sphere).all()
            or not certify(self.mesh.F, sphere).valid
        ):
            raise SphereMapError(
                f"sphere has the shape {sphere.shape} and is no fold-free sphere map of the mesh, "
                f"which has "
                f"{len(self.mesh.V)} vertices; leave it out to have one computed"
            )
        return sphere

    def _six_charts(self, sphere: NDArray[np.float64], start: float) -> Atlas:
        """Atlas of the cube layout with a sphere map that was begun at a time `start`."""
        mapped = time.perf_counter()
        atlas = atlas_from_sphere_map(self.mesh, sphere, self.resolution)
        atlas.timings.update(sphere_map=mapped - start, rays=time.perf_counter() - mapped)
        return atlas

    def _path(self, kind: str, *arrays: NDArray) -> Path | None:
        """Where the cache keeps an atlas of this mesh; None without a cache."""
        return (
            cache_path(f"{FORMAT} {kind}", (self.mesh.V, self.mesh.F, *arrays))
            if self.cache
            else None
        )

    def _stored(self, path: Path | None, start: float, *layouts: str) -> Atlas | None:
        """The atlas of this very mesh in one of some layouts; None if there is no file, or a damaged or another one."""
        if path is None:
            return None
        try:
            stored = load_atlas(path)
        except AtlasError:
            return None
        same = np.array_equal(stored.mesh.V, self.mesh.V) and np.array_equal(
            stored.mesh.F, self.mesh.F
        )
        if not same or stored.layout not in layouts:
            return None
        mark_used(path)
        return dataclasses.replace(
            stored, mesh=self.mesh, timings={"cache": time.perf_counter() - start}
        )

    def _kept(self, path: Path | None, atlas: Atlas) -> Atlas:
        """Put an atlas into the cache."""
        if path is not None:
            # a folder that cannot be written costs the next call its time, nothing else
            with contextlib.suppress(AtlasError, OSError):
                if path.is_symlink():  # whatever it leads to is not ours
                    path.unlink()
                atlas.save(path, overwrite=True)
                make_room(path)
        return atlas


def _patches(mesh: Mesh, resolution: int) -> Atlas:
    """Atlas of the patch layout; where that takes long, lines tell of it."""
    with _told_if_long(mesh):
        return patch_atlas(mesh, resolution)


@contextlib.contextmanager
def _told_if_long(mesh: Mesh) -> Iterator[None]:
    """Tell from time to time that charts are still being laid on a mesh."""
    done = threading.Event()

    def tell() -> None:
        waited = 0.0
        while not done.wait(_TOLD_EVERY):
            waited += _TOLD_EVERY
            log.warning(
                "laying charts on a mesh of %s in %s: %.0f s so far; later runs load what is made, "
                "and a lower "
                "resolution takes less",
                counted(len(mesh.F), "triangle"),
                counted(mesh.component_count, "part"),
                waited,
            )

    telling = threading.Thread(target=tell, daemon=True)
    telling.start()
    try:
        yield
    finally:
        done.set()
        telling.join()
