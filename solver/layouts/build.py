"""Builds the atlas of a mesh, or takes it from the cache; reads atlases from files."""

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
from ..texels.atlas import Atlas
from ..texels.atlas_file import ADVICE, FORMAT, read_atlas_file
from ..texels.chart_map import ChartMap, LinearChartMap
from ..texels.gluing import glue
from ..texels.texel_mesh import TexelMesh
from ..texels.texel_quality import folded_texels
from .choice import LONGEST_TEXEL, texel_length
from .cube.atlas import CubeChartMap, SphereAtlas, atlas_from_sphere_map
from .cube.convention import check_memory, check_resolution
from .patches.atlas import PatchChartMap, patch_atlas
from .patches.pieces import Pieces
from .sphere_map import certify, conformal_sphere_map, progressive_sphere_map

# Names of the layouts; "auto" chooses between the other two, see `choice`.
LAYOUTS = ("auto", "cube", "patches")

# Share of the texels of the cube layout that may be folded if "auto" is to take it.
_MAX_FOLDED_SHARE = 1e-3

# Time between two messages that charts are still being laid [s].
_MESSAGE_INTERVAL = 15.0

# The arrays of an atlas file, by name.
Arrays = dict[str, NDArray]

# How to make the chart map from the arrays of an atlas file, for each layout. An atlas has the
# layout "given" if the user gave its charts.
_CHART_MAPS: dict[str, Callable[[Arrays], ChartMap]] = {
    "cube": lambda arrays: CubeChartMap(arrays["sphere"]),
    "patches": lambda arrays: PatchChartMap(
        Pieces(*(arrays[f"piece_{name}"] for name in Pieces._fields))
    ),
    "given": lambda arrays: LinearChartMap(
        arrays["charts"], arrays["corners"], arrays["positions"].shape[1]
    ),
}

# The methods that map a closed mesh of genus 0, V [n, 3] and F [m, 3], onto the unit sphere.
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
    texels = TexelMesh(
        glue(arrays["glued"], arrays["positions"].shape[1], arrays.get("still")),
        arrays["positions"],
        arrays["normals"],
        arrays["areas"],
        arrays.get("beyond"),
        arrays.get("detours"),
    )
    atlas_class = SphereAtlas if kind == SphereAtlas.__name__ else Atlas
    return atlas_class(
        mesh=Mesh(arrays["V"], arrays["F"], arrays.get("uv"), arrays.get("corner_uv")),
        texels=texels,
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
        Texels along the side of a chart of the cube layout, N. The cube layout has 6 N^2 texels,
        and the patch layout about as many, or up to three times as many if charts would have less
        than 4 x 4; more only if charts of 2 x 2 still have more.
    method : str
        Sphere map of the cube layout: "progressive" (fold-free, spreads area evenly) or "conformal"
        (keeps angles but starves limbs; the choice of the paper).
    cache : bool
        Keep the result in the user's cache folder and take it from there the next time; see
        `cache_limit`.
    layout : str
        "cube": six charts of N x N texels, for a closed mesh of genus 0 in one part. "patches":
        many small charts, for any mesh. "auto": the cube for round meshes, and patches for meshes
        with long limbs, handles, rims or several parts, and where texels of the cube would be
        folded. `Atlas.notes` says why a closed mesh in one part gets patches.
    sphere : float64 [vertex_count, 3], optional
        Sphere map for the cube layout, if you have one already. `method` is not used then, and
        "auto" takes the cube.

    Raises
    ------
    AtlasError
        For an invalid resolution, method or layout, for a mesh on which the patch layout finds no
        charts, or for an atlas that cannot fit into memory.
    MeshError
        For the cube layout, if the mesh is not a closed surface of genus 0 in one part.
    SphereMapError
        For the cube layout, if no certified sphere map is found, or `sphere` is not a sphere map of
        this mesh.
    """
    resolution = check_resolution(resolution)
    _check_name("sphere map method", method, tuple(SPHERE_MAPS))
    _check_name("layout", layout, LAYOUTS)
    check_memory(resolution)
    builder = _Builder(mesh, resolution, method, cache, sphere)
    if layout == "patches":
        return builder.patches()
    try:
        check_genus_zero(mesh)
    except MeshError:
        if layout == "cube":
            raise
        return builder.patches()
    if layout == "cube" or sphere is not None:
        return builder.cube()
    return builder.chosen()


def _check_name(kind: str, name: str, valid: tuple[str, ...]) -> None:
    if name not in valid:
        raise AtlasError(f"{kind} must be one of {', '.join(map(repr, valid))}, got {name!r}")


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
        # the charts depend on the resolution, so every resolution has a file of its own
        path = self._path(f"patches {self.resolution}")
        stored = self._stored(path, start, "patches")
        if stored is not None:
            return stored
        return self._saved(path, _patches(self.mesh, self.resolution))

    def cube(self) -> Atlas:
        """Atlas of the cube layout, from a known sphere map or from one that the method makes."""
        start = time.perf_counter()
        path = self._path(self.method) if self.sphere is None else self._path("given", self.sphere)
        stored = self._stored(path, start, "cube")
        if stored is not None:
            return self._at_resolution(stored, path, start)
        return self._saved(path, self._six_charts(self._sphere_map(self.sphere), start))

    def chosen(self) -> Atlas:
        """Atlas in the layout that suits a closed mesh of genus 0.

        Its sphere map decides, and the texels that are folded in the cube layout.
        """
        start = time.perf_counter()
        # a file under one of these names shows that the layout was chosen already
        round_path = self._path(f"auto {self.method}")
        own_path = self._path(f"auto {self.method} {self.resolution}")
        stored = self._stored(own_path, start, "patches", "cube")
        if stored is not None:
            return stored
        stored = self._stored(round_path, start, "cube")
        if stored is not None and stored.resolution == self.resolution:
            return stored
        if stored is not None:
            sphere = self._sphere_map(stored.sphere)
        else:
            sphere = self._sphere_map(None)
            length = texel_length(self.mesh, sphere)
            if length > LONGEST_TEXEL:
                return self._saved(own_path, self._limbed(sphere, length, start))
        cube = self._six_charts(sphere, start)
        if folded_texels(cube.texels) <= _MAX_FOLDED_SHARE * cube.areas.size:
            return self._saved(round_path, cube)
        return self._saved(own_path, self._with_fewer_folds(cube))

    def _with_fewer_folds(self, cube: Atlas) -> Atlas:
        """An atlas of the patch layout if it has fewer folded texels than one of the cube layout.

        Texels of the cube layout lie astride of the edges of thin plates.
        """
        folded = folded_texels(cube.texels)
        try:
            patches = _patches(self.mesh, self.resolution)
        except AtlasError:
            return cube
        if folded_texels(patches.texels) >= folded:
            return cube
        note = f"layout patches: {counted(folded, 'texel')} of the cube would be folded"
        timings = {**cube.timings, **patches.timings}
        return dataclasses.replace(patches, timings=timings, notes=(note, *patches.notes))

    def _at_resolution(self, stored: Atlas, path: Path | None, start: float) -> Atlas:
        """A stored atlas of the cube layout, cast again if it has another resolution.

        Its sphere map is used again: rays are quick.
        """
        if stored.resolution == self.resolution:
            return stored
        return self._saved(path, self._six_charts(self._sphere_map(stored.sphere), start))

    def _limbed(self, sphere: NDArray[np.float64], length: float, start: float) -> Atlas:
        """Atlas of the patch layout, or of the cube layout if patches fail; a note says why.

        Texels of the cube layout are up to `length` times as long as wide.
        """
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
        return dataclasses.replace(atlas, timings=timings, notes=(note, *atlas.notes))

    def _sphere_map(self, known: NDArray[np.float64] | None) -> NDArray[np.float64]:
        """The known sphere map after a check, or the method's if none is known."""
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
                f"which has {len(self.mesh.V)} vertices; leave it out to have one computed"
            )
        return sphere

    def _six_charts(self, sphere: NDArray[np.float64], start: float) -> Atlas:
        """Atlas of the cube layout; the computation of its sphere map began at time `start`."""
        mapped = time.perf_counter()
        atlas = atlas_from_sphere_map(self.mesh, sphere, self.resolution)
        atlas.timings.update(sphere_map=mapped - start, rays=time.perf_counter() - mapped)
        return atlas

    def _path(self, kind: str, *arrays: NDArray) -> Path | None:
        """File of the cache for an atlas of this mesh; None without a cache."""
        if not self.cache:
            return None
        return cache_path(f"{FORMAT} {kind}", (self.mesh.V, self.mesh.F, *arrays))

    def _stored(self, path: Path | None, start: float, *layouts: str) -> Atlas | None:
        """A stored atlas of this very mesh in one of the layouts, or None.

        None if there is no file, if the file is damaged, or if it holds another atlas.
        """
        if path is None:
            return None
        try:
            stored = load_atlas(path)
        except AtlasError:
            return None
        same_vertices = np.array_equal(stored.mesh.V, self.mesh.V)
        same_mesh = same_vertices and np.array_equal(stored.mesh.F, self.mesh.F)
        if not same_mesh or stored.layout not in layouts:
            return None
        mark_used(path)
        timings = {"cache": time.perf_counter() - start}
        return dataclasses.replace(stored, mesh=self.mesh, timings=timings)

    def _saved(self, path: Path | None, atlas: Atlas) -> Atlas:
        """Put an atlas into the cache, if there is one, and return the atlas."""
        if path is not None:
            # if the folder cannot be written, the next call computes the atlas again
            with contextlib.suppress(AtlasError, OSError):
                if path.is_symlink():  # the file that it leads to is not ours
                    path.unlink()
                atlas.save(path, overwrite=True)
                make_room(path)
        return atlas


def _patches(mesh: Mesh, resolution: int) -> Atlas:
    """Atlas of the patch layout.

    Messages report the stage of long work, and the parts that lie still.
    """
    with _progress_messages(mesh) as report:
        atlas = patch_atlas(mesh, resolution, report)
    for note in atlas.notes:
        log.warning("%s: %s", mesh.name, note)
    return atlas


@contextlib.contextmanager
def _progress_messages(mesh: Mesh) -> Iterator[Callable[[str], None]]:
    """Log the stage of a mesh's charts from time to time; yields the function that sets it."""
    done = threading.Event()
    stage = "beginning"

    def report(text: str) -> None:
        nonlocal stage
        stage = text

    def log_until_done() -> None:
        waited = 0.0  # [s]
        while not done.wait(_MESSAGE_INTERVAL):
            waited += _MESSAGE_INTERVAL
            log.warning(
                "laying charts on a mesh of %s in %s: %s, %.0f s so far; later runs load what is "
                "made, and a lower resolution takes less",
                counted(len(mesh.F), "triangle"),
                counted(mesh.component_count, "part"),
                stage,
                waited,
            )

    logger = threading.Thread(target=log_until_done, daemon=True)
    logger.start()
    try:
        yield report
    finally:
        done.set()
        logger.join()
