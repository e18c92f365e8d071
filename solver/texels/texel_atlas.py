"""The atlas of a surface that comes as grids of points, which are its texels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh.mesh import Mesh
from .atlas import Atlas
from .chart_map import LinearChartMap
from .texel_mesh import TexelMesh


def texel_atlas(texels: TexelMesh) -> Atlas:
    """Atlas of the surface that texels of any topology span themselves.

    Each chart is a grid of its texel centres. Half a texel closes it, up to the points in the
    middle between its last texels and the texels beyond its border, or up to the rim. So every
    triangle of the mesh lies in one chart.
    """
    n = texels.resolution
    V, nodes = _welded_nodes(texels)
    # rows and columns of the corners of each cell, counter-clockwise, [n + 1, n + 1, 4]
    first_rows, first_columns = np.indices((n + 1, n + 1))[..., None]
    rows = first_rows + np.array([0, 0, 1, 1])
    columns = first_columns + np.array([0, 1, 1, 0])
    cells = nodes[:, rows, columns]
    place = np.concatenate([[-0.5], np.arange(n), [n - 0.5]])
    # the surface may end at the last texels: nothing lies between them and a rim without positions
    exists = (cells >= 0).all(axis=-1)
    chart, r, c = np.nonzero(exists)
    places = np.stack([place[rows], place[columns]], axis=-1)[r, c]
    F = _halves(cells[exists])
    chart_map = LinearChartMap(np.tile(chart, 2), _halves(places), n)
    triangles, barycentrics = triangles_of(F, nodes[:, 1:-1, 1:-1])
    return Atlas(Mesh(V, F), texels, chart_map, triangles, barycentrics)


def _halves(quads: NDArray) -> NDArray:
    """The two triangles [2 k, 3, ...] of each of k quads [k, 4, ...]."""
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _welded_nodes(texels: TexelMesh) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices [v, 3] [m], and the vertex of each node of the charts' grids, [C, n + 2, n + 2].

    -1 where no vertex lies. The first C n^2 vertices are the texel centres.
    """
    topology = texels.topology
    around = texels.halo_positions
    count = topology.texel_count
    nodes = np.where(topology.own, topology.halo, -1)
    # a node on a border belongs to the two texels between which it lies, a node in a corner to all
    # texels that meet there
    own = np.pad(topology.halo[:, 1:-1, 1:-1], ((0, 0), (1, 1), (1, 1)), mode="edge")
    border = ~topology.own & np.isfinite(around[..., 0])
    border[:, [0, 0, -1, -1], [0, -1, 0, -1]] = False
    points = texels.positions.reshape(-1, 3)
    low = np.minimum(own, topology.halo)[border]
    high = np.maximum(own, topology.halo)[border]
    rims = topology.rim[border]
    # on a rim, and where a periodic surface continues elsewhere, a node belongs to its place alone
    alone = rims | (points[topology.halo[border]] != around[border]).any(axis=1)
    key = np.where(alone, -1 - np.flatnonzero(border), low * count + high)
    _, first, index = np.unique(key, return_index=True, return_inverse=True)
    nodes[border] = count + index
    middles = np.where(rims[:, None], around[border], (points[own[border]] + around[border]) / 2)
    corner_points = _corner_points(texels)
    corners, number = np.unique(corner_points.reshape(-1, 3), axis=0, return_inverse=True)
    finite = np.isfinite(corner_points[..., 0])
    corner_nodes = count + len(first) + number.reshape(finite.shape)
    nodes[:, [0, 0, -1, -1], [0, -1, -1, 0]] = np.where(finite, corner_nodes, -1)
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
    sums = [np.bincount(corners, points[..., k].ravel()) for k in range(3)]
    means = np.stack([total / number for total in sums], axis=1)
    # sums over the two places beside a corner: of their positions, and of the texels that they show
    beside = around[:, rows, inner_columns] + around[:, inner_rows, columns]
    texels_around = topology.with_halo(texels.positions)
    shown = texels_around[:, rows, inner_columns] + texels_around[:, inner_rows, columns]
    displaced = (beside != shown).any(axis=-1)
    is_rim = topology.rim[:, rows, inner_columns] | topology.rim[:, inner_rows, columns]
    periodic = displaced & ~is_rim
    return np.where(periodic[..., None], beside / 2, means[topology.corners])


def triangles_of(
    F: NDArray[np.int64], vertices: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """A triangle at each of some vertices, and the barycentrics [..., 3] of that corner."""
    triangle = np.empty(F.max() + 1, np.int64)
    triangle[F[::-1].ravel()] = np.repeat(np.arange(len(F))[::-1], 3)
    triangles = triangle[vertices]
    return triangles, (F[triangles] == vertices[..., None]).astype(np.float64)
