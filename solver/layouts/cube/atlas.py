"""The atlas of a closed genus-0 mesh in the cube layout.

Rays through the cube map's texels meet the sphere map of the mesh.

Map coordinates are directions from the cube's centre. A ray from there through each texel gives its
triangle and barycentric coordinates. The way back, from a triangle and a point on it to the sphere
and to the nearest texel, is compiled, since contacts ask at every step. The analytic atlas of a
sphere is the reference on which symmetry and accuracy are tested.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from ...errors import POSITIVE, AtlasError, checked
from ...kernel import Floats, Ints, kernel
from ...mesh.mesh import Mesh
from ...mesh.points import check_points
from ...mesh.queries import RayScene
from ...mesh.vectors import cross, dot
from ...texels.atlas import Atlas
from ...texels.barycentrics import barycentrics_at
from ...texels.chart_map import Parts, uncut
from ...texels.detours import link_detours
from ...texels.normals import facing_out
from ...texels.stretch import stretch_summary
from ...texels.texel_atlas import triangles_of
from ...texels.texel_mesh import TexelMesh
from ..sphere_map import certify, stretch
from .convention import (
    CHART_U,
    CHART_V,
    chart_uv,
    check_memory,
    check_resolution,
    covered_areas,
    cube_chart_points,
    cube_topology,
    split_at_edges,
    texel_directions,
)

# Texels from one whose triangle is found by a ray to the next such texel.
STRIDE = 16

# Length of a mean normal up to which the normals of a triangle's corners cancel each other.
_CANCELLED_LENGTH = 1e-9

# A ray may pass so far outside of its triangle, as a triple product.
_MAX_MISS = 1e-12

# Triangles that a walk passes before it counts as one that goes in circles.
_MAX_WALK = 200


@kernel
def sphere_directions(corners: Floats, sphere: Floats, points: Floats) -> Floats:
    """Unit vectors [k, 3] on the sphere map of points [k, 3] [m] in triangles.

    `corners` and `sphere` [k, 3, 3] are the triangles' corners in space [m] and on the sphere map.

    There linear interpolation of the sphere map puts them.
    """
    directions = np.empty((len(points), 3))
    for i in range(len(points)):
        s, t = barycentrics_at(corners[i], points[i])
        square = 0.0
        for k in range(3):
            directions[i, k] = (
                (1 - s - t) * sphere[i, 0, k] + s * sphere[i, 1, k] + t * sphere[i, 2, k]
            )
            square += directions[i, k] ** 2
        for k in range(3):
            directions[i, k] /= np.sqrt(square)
    return directions


@kernel
def texels_towards(directions: Floats, n: int) -> Ints:
    """Flat indices [k] of the texels that contain directions [k, 3]; see `cube_chart_points`.

    A flat index is (chart N + row) N + column.
    """
    texels = np.empty(len(directions), np.int64)
    for i in range(len(directions)):
        axis = 0
        for k in range(1, 3):
            if abs(directions[i, k]) > abs(directions[i, axis]):
                axis = k
        chart = 2 * axis + (1 if directions[i, axis] < 0 else 0)
        texel = chart
        for along in (CHART_V, CHART_U):  # the row, then the column
            across = 0.0
            for k in range(3):
                across += directions[i, k] * along[chart, k]
            angle = np.arctan(across / abs(directions[i, axis])) * (4 / np.pi)  # -1 to 1
            place = int(np.rint(((angle + 1) * n - 1) / 2))
            texel = texel * n + min(max(place, 0), n - 1)
        texels[i] = texel
    return texels


def cast_rays(
    sphere: Floats, mesh: Mesh, directions: Floats, stride: int = 1
) -> tuple[Ints, Floats]:
    """Intersect rays from the origin with the sphere-mapped mesh.

    Embree finds triangles in float32; the barycentrics are computed again in float64, which also
    moves a hit to the neighbouring triangle where float32 chose wrongly and recovers rays that
    slipped between two triangles.

    Parameters
    ----------
    sphere : [vertex_count, 3]
        A fold-free sphere map (unit vectors).
    mesh : Mesh
    directions : [k, 3]
        Ray directions.
    stride : int
        Embree casts one ray in `stride`. The rays after it, which should be close by, walk from its
        triangle to their own: most texels lie in the triangle of the texel before, or beside it.

    Returns
    -------
    triangles : int64 [k]
    barycentrics : float64 [k, 3]
        Not negative, each row sums to 1.

    Raises
    ------
    AtlasError
        If a ray meets no triangle, which a fold-free map rules out.
    """
    hits = np.full(len(directions), -1, dtype=np.int64)
    seeds = directions[::stride]
    hits[::stride] = RayScene(sphere, mesh.F).cast(np.zeros_like(seeds), seeds)[0]
    barycentrics = np.empty((len(directions), 3))
    lost = _walk_to_triangles(sphere, mesh.F, mesh.beside, directions, hits, barycentrics)
    if lost:
        raise AtlasError(
            f"{lost} of {len(directions)} rays meet no triangle of the sphere map; is the map "
            f"fold-free?"
        )
    return hits, barycentrics


@kernel(no_cpython_wrapper=True)
def _edge_products(sphere: Floats, corners: Ints, d: Floats) -> tuple[float, float, float]:
    """Triple products det(d, b, c) of a ray with the three edges of a triangle.

    All are >= 0 if and only if the ray passes inside the triangle.
    """
    a = sphere[corners[0]]
    b = sphere[corners[1]]
    c = sphere[corners[2]]
    return dot(d, cross(b, c)), dot(d, cross(c, a)), dot(d, cross(a, b))


@kernel
def _walk_to_triangles(
    sphere: Floats, F: Ints, neighbours: Ints, directions: Floats, hits: Ints, barycentrics: Floats
) -> int:
    """Walk each ray's hit to the triangle that truly contains it; return how many rays are lost.

    Fills in `hits` and `barycentrics`.
    """
    lost = previous = 0
    for i in range(len(directions)):
        d = directions[i]
        triangle = hits[i] if hits[i] >= 0 else previous
        x, y, z = _edge_products(sphere, F[triangle], d)
        for _ in range(_MAX_WALK):
            if min(x, y, z) >= 0:
                break
            # cross the side that the ray passes farthest outside: opposite corner k lies side k + 1
            worst = 2 if z < min(x, y) else 1 if y < x else 0
            triangle = neighbours[triangle, (worst + 1) % 3]
            x, y, z = _edge_products(sphere, F[triangle], d)
        if min(x, y, z) < 0 or x + y + z <= 0:
            # a walk can circle on very distorted maps: look at every triangle
            best = -np.inf
            for f in range(len(F)):
                x, y, z = _edge_products(sphere, F[f], d)
                if min(x, y, z) > best and x + y + z > 0:
                    best = min(x, y, z)
                    triangle = f
            x, y, z = _edge_products(sphere, F[triangle], d)
            if best < -_MAX_MISS:
                lost += 1
        x = max(x, 0.0)
        y = max(y, 0.0)
        z = max(z, 0.0)
        total = x + y + z
        barycentrics[i, 0] = x / total
        barycentrics[i, 1] = y / total
        barycentrics[i, 2] = z / total
        hits[i] = previous = triangle
    return lost


@dataclasses.dataclass(frozen=True, eq=False)
class CubeChartMap:
    """A closed genus-0 mesh on the six charts of the cube; see `ChartMap`.

    `sphere` [vertex_count, 3] is the sphere map: one unit vector a vertex.
    """

    sphere: Floats

    @property
    def layout(self) -> str:
        """Name of the layout."""
        return "cube"

    def coordinates(self, mesh: Mesh, triangles: Ints, points: Floats) -> Floats:
        """Directions [k, 3] of points [k, 3] [m] that lie on triangles [k], unit vectors."""
        corners = mesh.F[triangles]
        return sphere_directions(mesh.V[corners], self.sphere[corners], points)

    def chart_points(self, coordinates: Floats, resolution: int) -> tuple[Ints, Floats, Floats]:
        """Chart, row and column of directions, each [k]."""
        return cube_chart_points(coordinates, resolution)

    def texels_at(self, mesh: Mesh, resolution: int, triangles: Ints, points: Floats) -> Ints:
        """Flat indices [k] of the texels that contain points [k, 3] [m] on triangles [k]."""
        return texels_towards(self.coordinates(mesh, triangles, points), resolution)

    def linear_parts(self, mesh: Mesh) -> Parts:
        """The triangles, with the directions of their corners."""
        return uncut(self.sphere[mesh.F])

    def split(self, corners: Floats) -> Parts:
        """Cut triangles along the edges of the cube; their corners have directions [m, 3, 3]."""
        return split_at_edges(corners)

    def uv(self, coordinates: Floats, chart: Ints) -> Floats:
        """Place [k, ..., 2], from 0 to 1, of directions [k, ..., 3] in their charts [k]."""
        return chart_uv(coordinates, chart)

    def quality(self, mesh: Mesh) -> dict[str, float]:
        """Measures of the sphere map, by name; see `Atlas.quality`."""
        certificate = certify(mesh.F, self.sphere)
        spread = stretch_summary(stretch(mesh.V, mesh.F, self.sphere), mesh.triangle_areas)
        return {
            "flipped": certificate.flipped,
            "solid_angle": certificate.solid_angle,
            **spread,
        }

    def arrays(self) -> dict[str, NDArray]:
        """The sphere map."""
        return {"sphere": self.sphere}


def atlas_from_sphere_map(mesh: Mesh, sphere: Floats, resolution: int) -> Atlas:
    """Atlas of a mesh for a given fold-free sphere map [vertex_count, 3] (unit vectors)."""
    directions = texel_directions(check_resolution(resolution))
    # a few texels lie so far apart that each needs a ray; else every row of texels begins with a
    # ray, as the stride divides the resolution
    has_few_texels = directions.size <= 3 * len(mesh.F)
    stride = 1 if has_few_texels else math.gcd(resolution, STRIDE)
    triangles, barycentrics = cast_rays(sphere, mesh, directions.reshape(-1, 3), stride)
    positions, normals = _interpolated(mesh, triangles, barycentrics)
    shape = directions.shape[:3]
    triangles = triangles.reshape(shape)
    barycentrics = barycentrics.reshape(*shape, 3)
    topology = cube_topology(resolution)
    texels = TexelMesh.of(
        topology,
        positions.reshape(*shape, 3),
        normals=normals.reshape(*shape, 3),
        covered=covered_areas(mesh, sphere, resolution),
        detours=link_detours(mesh, topology, triangles, barycentrics),
    )
    return Atlas(
        mesh=mesh,
        texels=texels,
        chart_map=CubeChartMap(sphere),
        triangles=triangles,
        barycentrics=barycentrics,
    )


def _interpolated(mesh: Mesh, triangles: Ints, barycentrics: Floats) -> tuple[Floats, Floats]:
    """Positions [k, 3] [m] and unit normals [k, 3] at barycentrics [k, 3] in triangles [k]."""
    corners = mesh.F[triangles]
    row_starts = np.arange(0, corners.size + 1, 3)
    weights = csr_array(
        (barycentrics.reshape(-1), corners.reshape(-1), row_starts), (len(corners), len(mesh.V))
    )
    normals = weights @ mesh.vertex_normals
    lengths = np.linalg.norm(normals, axis=1)
    # between opposite normals any corner's normal will do
    cancelled = lengths <= _CANCELLED_LENGTH
    normals[cancelled] = mesh.vertex_normals[corners[cancelled, 0]]
    lengths[cancelled] = 1.0
    normals /= lengths[:, None]
    return weights @ mesh.V, facing_out(normals, mesh, triangles)


class SphereAtlas(Atlas):
    """Atlas of a sphere round the origin: texels lie exactly on it.

    It has all 48 symmetries of the cube.
    """

    @property
    def radius(self) -> float:
        """Radius of the sphere [m]."""
        return float(np.linalg.norm(self.mesh.V[0]))

    def project(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Closest points [k, 3] [m] on the sphere, not on its triangles, and their directions."""
        points = check_points(points)
        length = np.linalg.norm(points, axis=1, keepdims=True)
        if not length.all():
            raise AtlasError(
                "the sphere's centre has no nearest surface point; give a point off the centre"
            )
        return self.radius * (points / length), points / length

    def nearest(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Closest points [k, 3] on the sphere [m], and the flat index [k] of the texel of each."""
        closest, directions = self.project(points)
        return closest, texels_towards(directions, self.resolution)

    def nearest_places(self, points: Floats) -> tuple[Floats, Ints]:
        """Like `nearest`, without validating the points.

        All points of the sphere are nearest to its centre; the one towards z is returned.
        """
        directions = _directions(points)
        return self.radius * directions, texels_towards(directions, self.resolution)

    def closest_places(self, points: Floats) -> Floats:
        """Closest points [k, 3] on the sphere [m] alone."""
        return self.radius * _directions(points)


def _directions(points: Floats) -> Floats:
    """Unit vectors [k, 3] from the origin to points [k, 3]; at the origin itself along z."""
    length = np.linalg.norm(points, axis=1, keepdims=True)
    return np.where(length > 0, points / np.where(length > 0, length, 1.0), [0.0, 0.0, 1.0])


@checked(AtlasError, radius=POSITIVE)
def sphere_atlas(radius: float = 1.0, resolution: int = 128) -> SphereAtlas:
    """Atlas of the sphere of a given radius [m] round the origin.

    Texel positions are exact to round-off.

    Its mesh has the texel centres as vertices.

    Raises
    ------
    AtlasError
        If the radius is not positive and finite, the resolution is invalid, or the atlas cannot fit
        into memory.
    """
    n = check_resolution(resolution)
    check_memory(n)
    directions = texel_directions(n)
    topology = cube_topology(n)
    F = _triangles_between_texels(topology.halo, n)
    triangles, barycentrics = triangles_of(F, np.arange(6 * n * n).reshape(6, n, n))
    return SphereAtlas(
        mesh=Mesh(V=radius * directions.reshape(-1, 3), F=F),
        texels=TexelMesh.of(topology, radius * directions, normals=directions),
        chart_map=CubeChartMap(directions.reshape(-1, 3)),
        triangles=triangles,
        barycentrics=barycentrics,
    )


def _triangles_between_texels(halo: Ints, n: int) -> Ints:
    """Triangles whose vertices are the flat indices of texels, two for each four texels that meet.

    `halo` [6, n + 2, n + 2] has the texels of the charts and those beyond their edges; -1 at the
    corners of the cube, where three texels meet and there is one triangle.
    """
    southwest = halo[:, :-1, :-1]
    southeast = halo[:, :-1, 1:]
    northwest = halo[:, 1:, :-1]
    northeast = halo[:, 1:, 1:]
    squares = np.stack([southwest, southeast, northeast, northwest], axis=-1).reshape(-1, 4)
    # a square across an edge of the cube appears on two charts, one at a corner of the cube on
    # three: it belongs to the chart of its lowest texel
    chart = np.repeat(np.arange(6), (n + 1) ** 2)
    lowest = np.where(squares < 0, np.iinfo(np.int64).max, squares).min(axis=1)
    squares = squares[chart == lowest // (n * n)]
    whole = (squares >= 0).all(axis=1)
    at_corners = np.array([square[square >= 0] for square in squares[~whole]]).reshape(-1, 3)
    first_half = squares[whole][:, [0, 1, 2]]
    second_half = squares[whole][:, [0, 2, 3]]
    return np.concatenate([first_half, second_half, at_corners])
