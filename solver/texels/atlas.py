"""The atlas: a texel mesh on the surface of a mesh, each texel with its surface point; and its file.

`texel_atlas` is for surfaces that come as grids of points: its mesh is made of the texels
themselves. One verified file format, an uncompressed NumPy archive, is for users and for the cache.
"""

from __future__ import annotations

import dataclasses
import functools
import struct
import zipfile
import zlib
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import ArrayLike, NDArray

from ..errors import PATH, AtlasError, checked, shown
from ..files import atomic_write, final_path
from ..mesh.mesh import Mesh
from ..mesh.queries import ClosestPoints
from .chart_map import ChartMap, LinearChartMap, TextureCoordinates, texture_coordinates
from .halo import sampling_matrix
from .texel_mesh import TexelMesh, texel_quality

# Raise it when a layout's map or the file's contents change: the cache has its atlases rebuilt.
# Files of users are read from that of version 1.0.0 on, as `docs/stability.md` says.
FORMAT = 16
OLDEST = 13
ADVICE = "make it again with `ripple-sim atlas MESH -o FILE`"
_NEEDED = {
    "V",
    "F",
    "kind",
    "format",
    "glued",
    "positions",
    "normals",
    "areas",
    "triangles",
    "barycentrics",
}
_INDICES = {"F", "triangles", "glued", "charts", "piece_triangle", "piece_chart"}  # in 32 bits

# [m]. Squares of what is farther away overflow on the way to the nearest surface point.
_FARTHEST = 1e100


def write_arrays(file: BinaryIO, arrays: dict[str, NDArray]) -> None:
    """Write an archive that `read_arrays` and `numpy.load` read."""
    np.savez(file, allow_pickle=False, **arrays)


def read_arrays(path: Path) -> dict[str, NDArray]:
    """Read all arrays of an archive, whole: each is compared with its checksum.

    Raises
    ------
    ValueError
        If the file is damaged, or is not such an archive.
    OSError
        If it cannot be read.
    """
    arrays = {}
    damage = (
        zipfile.BadZipFile,
        EOFError,
        MemoryError,
        OSError,
        RuntimeError,
        struct.error,
        zlib.error,
    )
    with path.open("rb") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                for name in archive.namelist():
                    with archive.open(name) as member:
                        arrays[name.removesuffix(".npy")] = npy.read_array(
                            member, allow_pickle=False
                        )
                        if member.read(1):  # the checksum is compared at the end
                            raise ValueError(f"{name!r} is damaged")
        except damage as error:
            raise ValueError(str(error)) from error
    return arrays


def write_atlas_file(path: Path, arrays: dict[str, NDArray]) -> None:
    """Write an atlas's arrays; the file appears whole or not at all.

    Raises `AtlasError` if the file cannot be written.
    """
    small = {name: arrays[name].astype(np.int32) for name in _INDICES & arrays.keys()}
    try:
        with atomic_write(path) as unfinished, unfinished.open("wb") as file:
            write_arrays(file, {**arrays, **small, "format": np.array([FORMAT])})
    except OSError as error:
        raise AtlasError(
            f"atlas file {str(path)!r} cannot be written: {error.strerror or error}"
        ) from error


def check_atlas_place(path: Path, overwrite: bool) -> None:
    """Make sure that an atlas may be written to a path.

    Raises `AtlasError` if there can be no such name, or another file is there, unless it is empty
    or `overwrite` says that it is to go.
    """
    try:
        final_path(path)
    except OSError as error:
        raise AtlasError(
            f"atlas file {str(path)!r} cannot be written: {error.strerror}; name another file"
        ) from error
    if overwrite or not path.is_file() or path.stat().st_size == 0:
        return
    try:
        with zipfile.ZipFile(path) as archive:
            known = {"format.npy", "positions.npy"} <= set(archive.namelist())
    except (OSError, zipfile.BadZipFile, NotImplementedError, struct.error):
        known = False
    if not known:
        raise AtlasError(
            f"atlas file {str(path)!r} cannot be written: it exists and is no atlas; name another "
            f"file, or "
            "ask to overwrite it"
        )


def read_atlas_file(path: Path) -> dict[str, NDArray]:
    """Read the arrays of an atlas.

    Raises `AtlasError` if the file is missing, truncated, changed, or of a version before 1.0.0 or
    after this one.
    """
    try:
        if not path.is_file():
            problem = "is not a file" if path.exists() else "does not exist"
            raise AtlasError(
                f"atlas file {str(path)!r} {problem}; make one with `ripple-sim atlas MESH -o FILE`"
            )
        arrays = read_arrays(path)
    except (OSError, ValueError) as error:
        raise AtlasError(
            f"atlas file {str(path)!r} is damaged or not an atlas ({error}); {ADVICE}"
        ) from error
    if _NEEDED - arrays.keys() or arrays["format"].tolist() not in [
        [each] for each in range(OLDEST, FORMAT + 1)
    ]:
        raise AtlasError(
            f"atlas file {str(path)!r} is not an atlas, or of another version; {ADVICE}"
        )
    return arrays | {name: arrays[name].astype(np.int64) for name in _INDICES & arrays.keys()}


@dataclasses.dataclass(frozen=True, eq=False)
class Atlas:
    """Charts of texels on the surface of a mesh.

    Make one with `build_atlas`, `sphere_atlas`, `texel_atlas` or `load_atlas`.

    Attributes
    ----------
    mesh : Mesh
        The surface.
    texels : TexelMesh
        C charts of n x n texels.
    chart_map : ChartMap
        The way from a point of the mesh to its place on the charts.
    triangles : int64 [C, n, n]
        Triangle of the mesh in which the texel lies.
    barycentrics : float64 [C, n, n, 3]
        Where in that triangle.
    timings : dict
        Seconds per stage of the construction.
    notes : tuple of str
        Why "auto" took this layout, where that is not plain.
    """

    mesh: Mesh
    texels: TexelMesh
    chart_map: ChartMap
    triangles: NDArray[np.int64]
    barycentrics: NDArray[np.float64]
    timings: dict[str, float] = dataclasses.field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def layout(self) -> str:
        """How the mesh got its charts: "cube", "patches", or "given"."""
        return self.chart_map.layout

    @property
    def sphere(self) -> NDArray[np.float64]:
        """Sphere map: one unit vector a vertex, float64 [vertex_count, 3]; the cube layout alone has one.

        Raises
        ------
        AtlasError
            For another layout.
        """
        sphere = getattr(self.chart_map, "sphere", None)
        if sphere is None:
            raise AtlasError(
                f"an atlas of layout {self.layout!r} has no sphere map; that of layout 'cube' does"
            )
        return sphere

    @property
    def resolution(self) -> int:
        """Texels along a chart's side, N."""
        return self.texels.positions.shape[1]

    @property
    def positions(self) -> NDArray[np.float64]:
        """Surface point of every texel [m], [C, N, N, 3]."""
        return self.texels.positions

    @property
    def normals(self) -> NDArray[np.float64]:
        """Outward unit normal of every texel, [C, N, N, 3]."""
        return self.texels.normals

    @property
    def areas(self) -> NDArray[np.float64]:
        """Area of the surface that belongs to each texel [m^2], [C, N, N]; the mass of its waves sits there."""
        return self.texels.areas

    def project(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Closest surface points [m], [k, 3], and their map coordinates, [k, d]; see `ChartMap`.

        Raises
        ------
        AtlasError
            If the points are not finite or not of shape [k, 3] or [3].
        """
        triangle, closest = self.closest_points(check_points(points))
        return closest, self.chart_map.coordinates(self.mesh, triangle, closest)

    def locate(
        self, points: ArrayLike
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Chart, row and column of the surface points nearest to the given points [m].

        Row and column are in texel units, 0.0 at the centre of the first texel. Each result has
        shape [k].
        """
        return self.chart_map.chart_points(self.project(points)[1], self.resolution)

    def nearest(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Closest surface points [m], [k, 3], and the flat index of the texel nearest to each in the atlas, [k]."""
        return self.nearest_places(check_points(points))

    def nearest_places(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """The same of points that need no check, [k, 3]."""
        triangle, closest = self.closest_points(points)
        return closest, self.chart_map.texels_at(self.mesh, self.resolution, triangle, closest)

    def closest_places(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Those surface points alone [m], [k, 3], where no texels are asked for."""
        return self.closest_points(points)[1]

    def nearest_texel(self, points: ArrayLike) -> NDArray[np.int64]:
        """Flat index (chart N + row) N + column of the texel nearest in the atlas to each point, shape [k]."""
        return self.nearest(points)[1]

    def sampling_matrix(self, points: ArrayLike) -> Any:
        """SciPy CSR matrix [k, T] that takes a flattened field to its values at the closest surface points."""
        return sampling_matrix(self.texels.topology, *self.locate(points))

    def stiffness(self, speed: float | NDArray[np.float64] = 1.0) -> Any:
        """The operator c^2 grad . grad as a symmetric SciPy CSR matrix [T, T]; see `TexelMesh.stiffness`."""
        return self.texels.stiffness(speed)

    def texture_coordinates(self) -> TextureCoordinates:
        """Chart and place in it at every corner of every triangle, those cut that cross the border of a chart.

        They are exact at the corners. In between, linear interpolation of `uv` deviates in the cube
        layout from the sphere map's own place by a share of about 0.1 s^2 of a chart, where s is
        the angle that the triangle spans on the sphere: refine a mesh whose triangles span many
        texels before it is textured, or interpolate the map coordinates. The object's own texture
        coordinates, `mesh.uv` and `mesh.corner_uv`, stay as they are.
        """
        return texture_coordinates(self.chart_map, self.mesh)

    def quality(self) -> dict[str, float]:
        """Figures of merit of the atlas.

        Returns
        -------
        dict
            Of the cube layout: `solid_angle` [sr] (4 pi for a bijection). Of cube and patches:
            `flipped` triangles, area-weighted stretch quantiles `q001`, `q01`, `q50`, `q99`,
            `q999`, `starved` share of the area whose texels are over 4 times too wide. Of every
            layout: `edge_min` and `edge_max` [m], `folded` texels (their neighbours lie in the
            wrong order round them), `coverage` (texel area over mesh area: 1 but for limbs that
            fall between the texels), `spanned` (area of the mesh of texel centres over mesh area:
            it cuts creases short too), `timestep` (stable time step over that of an endless even
            grid of as many texels).
        """
        return {**self.chart_map.quality(self.mesh), **texel_quality(self.texels, self.mesh)}

    @checked(AtlasError, path=PATH)
    def save(self, path: str | Path, overwrite: bool = False) -> None:
        """Write the atlas to one file, which `load_atlas` reads.

        The file appears whole or not at all.

        An older atlas there is replaced, any other file only with `overwrite`. A link is written
        through.

        Raises
        ------
        AtlasError
            If the file cannot be written.
        """
        check_atlas_place(Path(path), overwrite)
        mesh = self.mesh
        texels = self.texels
        arrays = {
            "kind": np.array([type(self).__name__, self.layout]),
            "glued": texels.topology.glued,
            "V": mesh.V,
            "F": mesh.F,
            "positions": texels.positions,
            "normals": texels.normals,
            "areas": texels.areas,
            "triangles": self.triangles,
            "barycentrics": self.barycentrics,
            **self.chart_map.arrays(),
        }
        notes = np.array(self.notes) if self.notes else None
        optional = {
            "uv": mesh.uv,
            "corner_uv": mesh.corner_uv,
            "beyond": texels.beyond,
            "detours": texels.detours,
            "notes": notes,
        }
        write_atlas_file(
            Path(path), arrays | {name: each for name, each in optional.items() if each is not None}
        )

    def __getstate__(self) -> dict[str, Any]:
        """What `copy` and `pickle` keep: the search tree is made again when it is needed."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}

    @functools.cached_property
    def closest_points(self) -> ClosestPoints:
        """Finds the nearest points of the mesh."""
        return ClosestPoints(self.mesh.V, self.mesh.F)


def check_points(points: ArrayLike) -> NDArray[np.float64]:
    """Points as float64 [k, 3], or `AtlasError`."""
    try:
        array = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise AtlasError(
            f"points are {shown(points)}; valid are numbers of shape [3] or [k, 3], in metres"
        ) from error
    if array.ndim == 0 or array.shape[-1] != 3 or array.ndim > 2:
        raise AtlasError(f"points have shape {array.shape}; valid is [3] or [k, 3], in metres")
    if not (np.abs(array) < _FARTHEST).all():
        raise AtlasError(
            f"points hold NaN or numbers beyond {_FARTHEST:g}; valid are finite coordinates in "
            f"metres"
        )
    return np.ascontiguousarray(array.reshape(-1, 3))


def texel_atlas(texels: TexelMesh) -> Atlas:
    """Atlas of the surface that texels of any topology span themselves.

    Each chart is a grid of its texel centres, closed by half a texel up to the points in the middle
    between them and those beyond its border, or up to the rim; so every triangle of the mesh lies
    in one chart.
    """
    n = texels.resolution
    V, nodes = _welded_nodes(texels)
    # of the corners of each cell, counter-clockwise, [n + 1, n + 1, 4]
    rows, columns = (
        np.indices((n + 1, n + 1))[..., None]
        + np.array([[0, 0, 1, 1], [0, 1, 1, 0]])[:, None, None]
    )
    cells = nodes[:, rows, columns]
    place = np.concatenate([[-0.5], np.arange(n), [n - 0.5]])
    # the surface may end at the last texels: nothing lies between them and a rim without positions
    exists = (cells >= 0).all(axis=-1)
    chart, r, c = np.nonzero(exists)
    places = np.stack([place[rows], place[columns]], axis=-1)[r, c]
    F, corners = (
        np.concatenate([each[:, [0, 1, 2]], each[:, [0, 2, 3]]]) for each in (cells[exists], places)
    )
    triangles, barycentrics = triangles_of(F, nodes[:, 1:-1, 1:-1])
    return Atlas(
        Mesh(V, F), texels, LinearChartMap(np.tile(chart, 2), corners, n), triangles, barycentrics
    )


def _welded_nodes(texels: TexelMesh) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices [v, 3] [m], and the vertex of each node of the charts' grids, [C, n + 2, n + 2]; -1 where none lies.

    The first C n^2 vertices are the texel centres.
    """
    topology = texels.topology
    around = texels.halo_positions
    count = topology.texel_count
    nodes = np.where(topology.own, topology.halo, -1)
    # a node on a border belongs to the two texels that it lies between, one in a corner to all that
    # meet there
    own = np.pad(topology.halo[:, 1:-1, 1:-1], ((0, 0), (1, 1), (1, 1)), mode="edge")
    border = ~topology.own & np.isfinite(around[..., 0])
    border[:, [0, 0, -1, -1], [0, -1, 0, -1]] = False
    points = texels.positions.reshape(-1, 3)
    low = np.minimum(own, topology.halo)[border]
    high = np.maximum(own, topology.halo)[border]
    rims = topology.rim[border]
    # on a rim, and where a periodic surface goes on elsewhere, a node belongs to its place alone
    alone = rims | (points[topology.halo[border]] != around[border]).any(axis=1)
    key = np.where(alone, -1 - np.flatnonzero(border), low * count + high)
    _, first, index = np.unique(key, return_index=True, return_inverse=True)
    nodes[border] = count + index
    middles = np.where(rims[:, None], around[border], (points[own[border]] + around[border]) / 2)
    corner_points = _corner_points(texels)
    corners, number = np.unique(corner_points.reshape(-1, 3), axis=0, return_inverse=True)
    finite = np.isfinite(corner_points[..., 0])
    nodes[:, [0, 0, -1, -1], [0, -1, -1, 0]] = np.where(
        finite, count + len(first) + number.reshape(finite.shape), -1
    )
    return np.concatenate([points, middles[first], corners]), nodes


def _corner_points(texels: TexelMesh) -> NDArray[np.float64]:
    """Point in which each corner of a chart lies [m], [C, 4, 3]; NaN on a rim without positions."""
    topology = texels.topology
    around = texels.halo_positions
    rows = [0, 0, -1, -1]
    columns = [0, -1, -1, 0]
    inner_rows = [1, 1, -2, -2]
    inner_columns = [1, -2, -2, 1]
    own = around[:, inner_rows, inner_columns]
    points = np.where(topology.rim[:, rows, columns, None], around[:, rows, columns], own)
    corners = topology.corners.ravel()
    number = np.bincount(corners)
    means = np.stack(
        [np.bincount(corners, points[..., k].ravel()) / number for k in range(3)], axis=1
    )
    beside, shown = (
        each[:, rows, inner_columns] + each[:, inner_rows, columns]
        for each in (around, topology.with_halo(texels.positions))
    )
    displaced = (beside != shown).any(axis=-1)
    periodic = (
        displaced & ~topology.rim[:, rows, inner_columns] & ~topology.rim[:, inner_rows, columns]
    )
    return np.where(periodic[..., None], beside / 2, means[topology.corners])


def triangles_of(
    F: NDArray[np.int64], vertices: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """A triangle at each of some vertices, and the barycentrics [..., 3] of that corner."""
    triangle = np.empty(F.max() + 1, np.int64)
    triangle[F[::-1].ravel()] = np.repeat(np.arange(len(F))[::-1], 3)
    triangles = triangle[vertices]
    return triangles, (F[triangles] == vertices[..., None]).astype(np.float64)
