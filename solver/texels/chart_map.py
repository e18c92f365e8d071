"""The way from a point of the mesh to its place on the charts, which each layout knows in its own manner.

Each has a compiled loop for the texels of points, since contacts ask at every step. The chart map
here is linear in each triangle: corners lie at rows and columns of one chart.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Ints, kernel
from ..mesh.mesh import Mesh

MOST_CORNERS = 12  # of a part of a triangle that a few lines have cut
_BITS = 34  # of coordinates in which copies of a point agree
_ON_SIDE = 1e-9  # barycentric coordinates below it count as 0


def barycentrics_in(corners: Floats, points: Floats) -> Floats:
    """Barycentric coordinates [k, 3], not negative, of points [k, 3] in triangles [k, 3, 3]."""
    u = corners[:, 1] - corners[:, 0]
    v = corners[:, 2] - corners[:, 0]
    p = points - corners[:, 0]
    uu, uv, vv, pu, pv = (
        np.einsum("ij,ij->i", a, b) for a, b in ((u, u), (u, v), (v, v), (p, u), (p, v))
    )
    area = uu * vv - uv * uv
    # a triangle without area has no barycentrics: its middle is as good as any point of it
    flat = area <= 0
    scale = np.where(flat, 1.0, area)
    s = np.where(flat, 1 / 3, np.clip((vv * pu - uv * pv) / scale, 0.0, 1.0))
    t = np.where(flat, 1 / 3, np.clip((uu * pv - uv * pu) / scale, 0.0, 1.0 - s))
    return np.stack([1 - s - t, s, t], axis=1)


@kernel(no_cpython_wrapper=True)
def barycentrics_at(corners: Floats, point: Floats) -> tuple[float, float]:
    """The second and third barycentric coordinate of a point in a triangle [3, 3], as in `barycentrics_in`."""
    uu = uv = vv = pu = pv = 0.0
    for k in range(3):
        u = corners[1, k] - corners[0, k]
        v = corners[2, k] - corners[0, k]
        p = point[k] - corners[0, k]
        uu = uu + u * u
        uv = uv + u * v
        vv = vv + v * v
        pu = pu + p * u
        pv = pv + p * v
    area = uu * vv - uv * uv
    if not area > 0:
        return 1 / 3, 1 / 3
    s = min(max((vv * pu - uv * pv) / area, 0.0), 1.0)
    return s, min(max((uu * pv - uv * pu) / area, 0.0), 1.0 - s)


# Parts of triangles: the triangle of each, in ascending order, [p]; where in it the part's three
# corners lie, in its winding, [p, 3, 3]; and what belongs to the parts, [p, ...].
Parts: TypeAlias = tuple[Ints, Floats, NDArray]


class ChartMap(Protocol):
    """Maps the triangles of a mesh to charts.

    Within a triangle, or a part of it, everything is linear in *map coordinates*, of which only the
    layout knows the meaning: directions on the sphere, or rows and columns.
    """

    @property
    def layout(self) -> str:
        """Name of the layout."""

    def coordinates(self, mesh: Mesh, triangles: Ints, points: Floats) -> Floats:
        """Map coordinates [k, d] of points [k, 3] [m] that lie on triangles [k]."""

    def chart_points(self, coordinates: Floats, resolution: int) -> tuple[Ints, Floats, Floats]:
        """Chart, row and column, each [k], of map coordinates; 0.0 is the centre of the first texel."""

    def texels_at(self, mesh: Mesh, resolution: int, triangles: Ints, points: Floats) -> Ints:
        """Flat indices [k] of the texels in which points [k, 3] [m] lie that are on triangles [k]."""

    def linear_parts(self, mesh: Mesh) -> Parts:
        """Parts of the mesh's triangles in which map coordinates are linear, and these at their corners [p, 3, d]."""

    def split(self, corners: Floats) -> Parts:
        """Triangles, with map coordinates [m, 3, d] at their corners, cut where they leave a chart; the charts [p]."""

    def uv(self, coordinates: Floats, chart: Ints) -> Floats:
        """Place [k, ..., 2] in charts [k], 0 to 1, of map coordinates [k, ..., d] that belong to them."""

    def quality(self, mesh: Mesh) -> dict[str, float]:
        """Figures of merit of the map itself; see `Atlas.quality`."""

    def arrays(self) -> dict[str, NDArray]:
        """What has to be stored to make the chart map again."""


def uncut(values: NDArray) -> Parts:
    """Triangles that are not cut, each one part, with what belongs to them [m, ...]."""
    return np.arange(len(values)), np.broadcast_to(np.eye(3), (len(values), 3, 3)), values


@dataclasses.dataclass(frozen=True, eq=False)
class TextureCoordinates:
    """The triangles of a mesh, cut where they cross the border of a chart, with coordinates into the atlas.

    Attributes
    ----------
    triangle : int64 [piece_count]
        Triangle of the mesh of which each piece is a part, in ascending order. Most are not cut:
        one piece, the whole.
    barycentrics : float64 [piece_count, 3, 3]
        Where in that triangle the piece's three corners lie, in the winding of the mesh.
    chart : int64 [piece_count]
        Chart of the atlas, the layer of a texture array.
    coordinates : float64 [piece_count, 3, d]
        Map coordinates of the corners; see `ChartMap`.
    uv : float64 [piece_count, 3, 2]
        Place in the chart at each corner, 0 to 1: (column + 1/2) / n and (row + 1/2) / n, whatever
        the resolution n. In a layer with a halo of one texel it is at (1 + n uv) / (n + 2).
    """

    triangle: Ints
    barycentrics: Floats
    chart: Ints
    coordinates: Floats
    uv: Floats

    def carry(self, corner_values: Floats) -> Floats:
        """Values at the pieces' corners of what is linear in each triangle of the mesh.

        Parameters
        ----------
        corner_values : [triangle_count, 3, ...]
            Values at the corners of the mesh's triangles, such as `mesh.V[mesh.F]` or
            `mesh.corner_uv`.

        Returns
        -------
        [piece_count, 3, ...]
        """
        return np.einsum(
            "pij,pj...->pi...", self.barycentrics, np.asarray(corner_values)[self.triangle]
        )


def texture_coordinates(chart_map: ChartMap, mesh: Mesh) -> TextureCoordinates:
    """Coordinates into the atlas at every corner of every triangle of a mesh; see `Atlas.texture_coordinates`."""
    triangle, barycentrics, linear = chart_map.linear_parts(mesh)
    part, within, chart = chart_map.split(linear)
    barycentrics, coordinates = (
        np.einsum("pij,pjk->pik", within, each[part]) for each in (barycentrics, linear)
    )
    return TextureCoordinates(
        triangle[part], barycentrics, chart, coordinates, chart_map.uv(coordinates, chart)
    )


@dataclasses.dataclass(frozen=True, eq=False)
class LinearChartMap:
    """Triangles laid out on charts; map coordinates are chart, row and column. See `ChartMap`.

    Attributes
    ----------
    charts : int64 [triangle_count]
        Chart of each triangle.
    corners : float64 [triangle_count, 3, 2]
        Row and column of its corners, from -0.5 to n - 0.5.
    resolution : int
        Texels along a chart's side, n.
    """

    charts: Ints
    corners: Floats
    resolution: int

    @property
    def layout(self) -> str:
        """Name of the layout."""
        return "given"

    def coordinates(self, mesh: Mesh, triangles: Ints, points: Floats) -> Floats:
        """Chart, row and column, [k, 3], of points [k, 3] [m] that lie on triangles [k]."""
        weights = barycentrics_in(mesh.V[mesh.F[triangles]], points)
        places = np.einsum("kc,kcj->kj", weights, self.corners[triangles])
        return np.concatenate([self.charts[triangles, None], places], axis=1)

    def chart_points(self, coordinates: Floats, resolution: int) -> tuple[Ints, Floats, Floats]:
        """Chart, row and column, each [k]."""
        return coordinates[:, 0].astype(np.int64), coordinates[:, 1], coordinates[:, 2]

    def texels_at(self, mesh: Mesh, resolution: int, triangles: Ints, points: Floats) -> Ints:
        """Flat indices [k] of the texels in which points [k, 3] [m] lie that are on triangles [k]."""
        charts = self.charts[triangles]
        corners = np.ascontiguousarray(self.corners[triangles])
        return _texels_on_charts(mesh.V[mesh.F[triangles]], charts, corners, resolution, points)

    def linear_parts(self, mesh: Mesh) -> Parts:
        """The triangles, with chart, row and column of their corners."""
        chart = np.broadcast_to(self.charts[:, None, None], (len(self.charts), 3, 1))
        return uncut(np.concatenate([chart, self.corners], axis=2))

    def split(self, corners: Floats) -> Parts:
        """The triangles as they are: each lies in one chart."""
        return uncut(corners[:, 0, 0].astype(np.int64))

    def uv(self, coordinates: Floats, chart: Ints) -> Floats:
        """Place [k, ..., 2] in the charts, 0 to 1, of map coordinates [k, ..., 3]."""
        return np.clip((coordinates[..., [2, 1]] + 0.5) / self.resolution, 0.0, 1.0)

    def quality(self, mesh: Mesh) -> dict[str, float]:
        """None: whoever laid the triangles out knows."""
        return {}

    def arrays(self) -> dict[str, NDArray]:
        """Charts and corners of the triangles."""
        return {"charts": self.charts, "corners": self.corners}


@kernel
def _texels_on_charts(
    triangles: Floats, charts: Ints, corners: Floats, n: int, points: Floats
) -> Ints:
    """Texels [k] of points [k, 3] on triangles [k, 3, 3] [m] that lie at corners [k, 3, 2] of charts [k]."""
    texels = np.empty(len(points), np.int64)
    for i in range(len(points)):
        s, t = barycentrics_at(triangles[i], points[i])
        texel = charts[i]
        for k in range(2):
            place = (1 - s - t) * corners[i, 0, k] + (s * corners[i, 1, k] + t * corners[i, 2, k])
            texel = texel * n + min(max(int(np.rint(place)), 0), n - 1)
        texels[i] = texel
    return texels


@kernel(no_cpython_wrapper=True)
def clip(
    corners: Floats,
    count: int,
    ox: float,
    oy: float,
    nx: float,
    ny: float,
    axis: int,
    result: Floats,
) -> int:
    """Keep what lies on the side n of a line through o of a convex polygon (Sutherland and Hodgman 1974).

    Returns the number of corners of the `result`. A line across an axis, 0 or 1 (else -1), is met
    to the last bit.
    """
    kept = 0
    for i in range(count):
        j = (i + 1) % count
        a = nx * (corners[i, 0] - ox) + ny * (corners[i, 1] - oy)
        b = nx * (corners[j, 0] - ox) + ny * (corners[j, 1] - oy)
        if a >= 0.0:
            for k in range(corners.shape[1]):  # slices would take ten times as long to compile
                result[kept, k] = corners[i, k]
            kept += 1
        if (a > 0.0 and b < 0.0) or (a < 0.0 and b > 0.0):
            # from the same end for both triangles at an edge
            t = a / (a - b)
            for k in range(corners.shape[1]):
                result[kept, k] = (1.0 - t) * corners[i, k] + t * corners[j, k]
            if axis >= 0:
                result[kept, axis] = oy if axis else ox
            kept += 1
    return kept


def texel_areas(mesh: Mesh, parts: Parts, corners: Floats, lines: Floats, charts: int) -> Floats:
    """Area of a mesh that each of the n x n texels of some charts covers [m^2], [C, n, n]: its triangles, cut exactly.

    Parameters
    ----------
    mesh : Mesh
    parts : Parts
        Parts of its triangles, with the one chart in which each lies, [p].
    corners : float64 [p, 3, 3]
        x w, y w and w > 0 of the parts' corners, where x and y are places on the chart; linear in
        each triangle.
    lines : float64 [n + 1]
        Where texels end, along x and along y.
    charts : int
        C.
    """
    triangle, barycentrics, chart = parts
    # barycentrics over w are linear in x and y
    polygons = np.concatenate([corners[..., :2], barycentrics], axis=2) / corners[..., 2:]
    n = len(lines) - 1
    low = polygons[..., :2].min(axis=1)
    high = polygons[..., :2].max(axis=1)
    first = np.searchsorted(lines, low, side="right").clip(1, n) - 1
    last = np.maximum(np.searchsorted(lines, high, side="left").clip(1, n) - 1, first)
    areas = np.zeros((charts, n, n))
    _add_areas(
        polygons, mesh.triangle_areas[triangle], chart.astype(np.int64), first, last, lines, areas
    )
    return areas


@kernel
def _add_areas(
    polygons: Floats,
    triangles: Floats,
    chart: Ints,
    first: Ints,
    last: Ints,
    lines: Floats,
    areas: Floats,
) -> None:
    """Cut parts [p, 3, 5] of triangles of given areas [p] along lines, and add each cell's to that of its texel.

    The first and last column and row of texels [p, 2] are those into which each reaches.
    """
    rest = np.empty((MOST_CORNERS, 5))
    strip = np.empty((MOST_CORNERS, 5))
    cell = np.empty((MOST_CORNERS, 5))
    spare = np.empty((MOST_CORNERS, 5))
    for p in range(len(chart)):
        wide = 3
        for k in range(wide):
            for m in range(5):
                rest[k, m] = polygons[p, k, m]
        for i in range(first[p, 0], last[p, 0] + 1):
            high = wide
            if i == last[p, 0]:
                rest, strip = strip, rest
            else:
                high = clip(rest, wide, lines[i + 1], 0.0, -1.0, 0.0, 0, strip)
                wide = clip(rest, wide, lines[i + 1], 0.0, 1.0, 0.0, 0, spare)
                rest, spare = spare, rest
            if high < 3:
                continue
            bottom = top = strip[0, 1]
            for k in range(1, high):
                bottom = min(bottom, strip[k, 1])
                top = max(top, strip[k, 1])
            for j in range(first[p, 1], last[p, 1] + 1):
                if j < last[p, 1] and lines[j + 1] <= bottom:
                    continue
                if j == last[p, 1] or lines[j + 1] >= top:
                    areas[chart[p], j, i] += triangles[p] * _share(strip, high)
                    break
                corners = clip(strip, high, 0.0, lines[j + 1], 0.0, -1.0, 1, cell)
                high = clip(strip, high, 0.0, lines[j + 1], 0.0, 1.0, 1, spare)
                strip, spare = spare, strip
                areas[chart[p], j, i] += triangles[p] * _share(cell, corners)


@kernel(no_cpython_wrapper=True)
def _share(corners: Floats, count: int) -> float:
    """Area of a polygon over that of the triangle in which it lies, by its barycentrics up to a factor at each."""
    share = 0.0
    ux = 0.0
    uy = 0.0
    total = corners[0, 2] + corners[0, 3] + corners[0, 4]
    x = corners[0, 2] / total
    y = corners[0, 3] / total
    for i in range(1, count):
        total = corners[i, 2] + corners[i, 3] + corners[i, 4]
        vx = corners[i, 2] / total - x
        vy = corners[i, 3] / total - y
        share += ux * vy - uy * vx
        ux = vx
        uy = vy
    return share


class PartsMesh(NamedTuple):
    """A mesh cut into parts; neighbours share their vertices.

    Attributes
    ----------
    V : float64 [n, 3]
        [m].
    F : int64 [m, 3]
    triangle : int64 [m]
        Triangle of the mesh in which each lies.
    barycentrics : float64 [m, 3, 3]
        Where in it, of the three corners.
    coordinates : float64 [m, 3, d]
        Map coordinates of the corners.
    """

    V: Floats
    F: Ints
    triangle: Ints
    barycentrics: Floats
    coordinates: Floats

    def carry(self, corner_values: Floats) -> Floats:
        """Values at the parts' corners [m, 3, ...] of what is linear in each triangle [triangle_count, 3, ...]."""
        return np.einsum("pij,pj...->pi...", self.barycentrics, corner_values[self.triangle])


def parts_mesh(chart_map: ChartMap, mesh: Mesh) -> PartsMesh:
    """Cut a mesh into the parts of a chart map; the mesh itself where its triangles are whole."""
    triangle, barycentrics, coordinates = chart_map.linear_parts(mesh)
    if len(triangle) == len(mesh.F) and (barycentrics == np.eye(3)).all():
        return PartsMesh(mesh.V, mesh.F, triangle, barycentrics, coordinates)
    points = np.einsum("pij,pjk->pik", barycentrics, mesh.V[mesh.F[triangle]])
    step = np.ldexp(1.0, np.frexp(np.abs(mesh.V).max())[1] - _BITS)
    place = np.rint(points / step).astype(np.int64).reshape(-1, 3)
    # what of the mesh each corner lies on: the ends of an edge, one vertex twice, or a triangle and
    # -1; so sheets that touch have points of their own
    held = barycentrics > _ON_SIDE
    corners = np.broadcast_to(mesh.F[triangle][:, None], held.shape)
    inside = held.all(axis=2)
    low = np.where(inside, triangle[:, None], np.where(held, corners, len(mesh.V)).min(axis=2))
    high = np.where(inside, -1, np.where(held, corners, -1).max(axis=2))
    key = np.column_stack([low.ravel(), high.ravel(), place])
    _, first, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return PartsMesh(
        points.reshape(-1, 3)[first], number.reshape(-1, 3), triangle, barycentrics, coordinates
    )
