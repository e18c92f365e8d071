"""Where a target's surface lies on the charts of its atlas."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.texels.chart_map import ChartMap
from ripple_sim.solver.texels.texel_atlas import ChartPage

_ON_BORDER = 1e-9  # of a chart
_BITS = 36  # of the attributes of cut points: round-off is within their last one


class Charts(NamedTuple):
    """The charts of a surface.

    Attributes
    ----------
    map : ChartMap
        The way from the surface's mesh to the charts.
    shape : (C, n, n)
        Of a field on them.
    """

    map: ChartMap
    shape: tuple[int, int, int]

    @classmethod
    def of(cls, atlas: Atlas) -> Charts:
        """The charts of an atlas."""
        return cls(atlas.chart_map, atlas.texels.shape)

    @property
    def page(self) -> ChartPage:
        """All of them on one page."""
        return ChartPage(self.shape[0], self.shape[1])

    @property
    def halo_shape(self) -> tuple[int, int, int]:
        """Shape (C, n + 2, n + 2) of a field with halo."""
        count, n, _ = self.shape
        return count, n + 2, n + 2


class VertexColumns(NamedTuple):
    """Columns of vertex attributes: what cut points share where they are one, unit normals, map coordinates."""

    position: slice
    normal: slice
    coordinates: slice


class ChartedMesh(NamedTuple):
    """A mesh of which every triangle lies in one chart; vertices on the borders stand once for each chart.

    Attributes
    ----------
    F : int64 [m, 3]
    attributes : float64 [n, ...]
        Of the vertices.
    same : int64 [n]
        Equal for vertices that differ in their texture coordinates and charts at most; see `tessellate`.
    chart : int64 [n]
    """

    F: NDArray[np.int64]
    attributes: NDArray[np.float64]
    same: NDArray[np.int64]
    chart: NDArray[np.int64]


def split_at_charts(
    mesh: tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]], columns: VertexColumns, charts: Charts
) -> ChartedMesh:
    """Cut the triangles of a mesh (F, attributes, same; see `tessellate`) where they leave a chart.

    What the vertices have is linear in each triangle.
    """
    F, attributes, same = mesh
    triangle, barycentrics, chart = charts.map.split(attributes[F][:, :, columns.coordinates])
    whole, corner = barycentrics.max(axis=2) == 1, barycentrics.argmax(axis=2)
    vertex = np.take_along_axis(F[triangle], corner, axis=1)
    part, place = np.nonzero(~whole)
    cut = np.einsum("ci,cij->cj", barycentrics[part, place], attributes[F[triangle[part]]])
    cut[:, columns.normal] /= np.maximum(np.linalg.norm(cut[:, columns.normal], axis=1, keepdims=True), 1e-12)
    cut = _snapped(cut, attributes)
    _, point = np.unique(cut[:, [*_range(columns.position), *_range(columns.normal)]], axis=0, return_inverse=True)
    _, distinct = np.unique(cut, axis=0, return_inverse=True)
    source, alike = np.where(whole, vertex, 0), np.where(whole, vertex, 0)
    source[part, place] = len(attributes) + np.arange(len(cut))
    alike[part, place] = len(attributes) + distinct.ravel()
    key = alike * charts.shape[0] + chart[:, None]
    _, where, index = np.unique(key, return_index=True, return_inverse=True)
    row = source.ravel()[where]
    return ChartedMesh(
        index.reshape(-1, 3),
        np.concatenate([attributes, cut])[row],
        np.concatenate([same, int(same.max()) + 1 + point.ravel()])[row],
        key.ravel()[where] % charts.shape[0],
    )


def _snapped(cut: NDArray[np.float64], attributes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Attributes of cut points without the round-off by which two triangles differ in a point that they share."""
    exponent = np.frexp(np.abs(attributes).max(axis=0))[1]
    step = np.ldexp(1.0, exponent - _BITS)
    return np.round(cut / step) * step


def _range(columns: slice) -> range:
    return range(columns.start, columns.stop)


def shared_places(uv: NDArray[np.float64], places: NDArray[np.float64], points: NDArray) -> NDArray[np.float64]:
    """Places [n, 2] on the page that are the same for vertices at the same point, whatever their charts.

    Heights on both sides of a border are equal but for round-off; looked up in one place they are the same, so that no
    gap opens. `points` [n, k] are equal where the vertices are at one point.
    """
    border = np.flatnonzero(((uv < _ON_BORDER) | (uv > 1 - _ON_BORDER)).any(axis=1))
    _, first, index = np.unique(points[border], axis=0, return_index=True, return_inverse=True)
    shared = places.copy()
    shared[border] = places[border[first[index.ravel()]]]
    return shared
