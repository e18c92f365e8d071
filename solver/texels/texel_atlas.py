"""Surfaces that come as grids of points: an atlas whose mesh is made of its own texels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh.mesh import Mesh
from .atlas import Atlas
from .chart_map import LinearChartMap
from .texel_mesh import TexelMesh


def texel_atlas(texels: TexelMesh) -> Atlas:
    """Atlas of the surface that texels of any topology span themselves.

    Each chart is a grid of its texel centres, closed by half a texel up to the points in the middle between them and
    those beyond its border, or up to the rim; so every triangle of the mesh lies in one chart.
    """
    charts, n, _ = texels.shape
    V, nodes = _welded_nodes(texels)
    cells = np.stack([nodes[:, :-1, :-1], nodes[:, :-1, 1:], nodes[:, 1:, 1:], nodes[:, 1:, :-1]], axis=-1)
    place = np.concatenate([[-0.5], np.arange(n), [n - 0.5]])
    column, row = np.meshgrid(place, place)
    places = np.stack([row, column], axis=-1)
    corners = np.stack([places[:-1, :-1], places[:-1, 1:], places[1:, 1:], places[1:, :-1]], axis=-2)
    corners = np.broadcast_to(corners, (charts, *corners.shape))
    chart = np.broadcast_to(np.arange(charts)[:, None, None], cells.shape[:3])
    # the surface may end at the last texels: nothing lies between them and a rim without positions
    exists = (cells >= 0).all(axis=-1)
    F = np.concatenate([cells[exists][:, [0, 1, 2]], cells[exists][:, [0, 2, 3]]])
    linear = LinearChartMap(
        np.tile(chart[exists], 2),
        np.concatenate([corners[exists][:, [0, 1, 2]], corners[exists][:, [0, 2, 3]]]),
        n,
    )
    triangles, barycentrics = triangles_of(F, nodes[:, 1:-1, 1:-1])
    return Atlas(Mesh(V, F), texels, linear, triangles, barycentrics)


def _welded_nodes(texels: TexelMesh) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices [v, 3] [m], and the vertex of each node of the charts' grids, [C, n + 2, n + 2]; -1 where none lies.

    The first C n^2 vertices are the texel centres.
    """
    topology, around = texels.topology, texels.halo_positions
    count = topology.texel_count
    nodes = topology.halo.copy()
    nodes[~topology.own] = -1
    # a node on a border belongs to the two texels that it lies between, one in a corner to all that meet there
    own = np.empty_like(topology.halo)
    own[:, 1:-1, 1:-1] = topology.halo[:, 1:-1, 1:-1]
    for inner, outer in ((1, 0), (-2, -1)):
        own[:, outer], own[:, :, outer] = own[:, inner], own[:, :, inner]
    border = ~topology.own & np.isfinite(around[..., 0])
    border[:, [0, 0, -1, -1], [0, -1, 0, -1]] = False
    points = texels.positions.reshape(-1, 3)
    low, high = np.minimum(own, topology.halo)[border], np.maximum(own, topology.halo)[border]
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
    nodes[:, [0, 0, -1, -1], [0, -1, -1, 0]] = np.where(finite, count + len(first) + number.reshape(finite.shape), -1)
    return np.concatenate([points, middles[first], corners]), nodes


def _corner_points(texels: TexelMesh) -> NDArray[np.float64]:
    """Point in which each corner of a chart lies [m], [C, 4, 3]; NaN on a rim without positions."""
    topology, around = texels.topology, texels.halo_positions
    rows, columns = [0, 0, -1, -1], [0, -1, -1, 0]
    inner_rows, inner_columns = [1, 1, -2, -2], [1, -2, -2, 1]
    at_rim = topology.rim[:, rows, columns]
    own = around[:, inner_rows, inner_columns]
    points = np.where(at_rim[..., None], around[:, rows, columns], own)
    corners = topology.corners.ravel()
    number = np.bincount(corners)
    means = np.stack([np.bincount(corners, points[..., k].ravel()) / number for k in range(3)], axis=1)
    beside = around[:, rows, inner_columns] + around[:, inner_rows, columns]
    displaced = (beside != _shown(texels, rows, inner_columns) + _shown(texels, inner_rows, columns)).any(axis=-1)
    periodic = displaced & ~topology.rim[:, rows, inner_columns] & ~topology.rim[:, inner_rows, columns]
    return np.where(periodic[..., None], beside / 2, means[topology.corners])


def _shown(texels: TexelMesh, rows: list[int], columns: list[int]) -> NDArray[np.float64]:
    """Positions of the texels that places of the halo show [m], [C, 4, 3]."""
    return texels.positions.reshape(-1, 3)[texels.topology.halo[:, rows, columns]]


def triangles_of(F: NDArray[np.int64], vertices: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """A triangle at each of some vertices, and the barycentrics [..., 3] of that corner."""
    triangle = np.empty(F.max() + 1, np.int64)
    triangle[F[::-1].ravel()] = np.repeat(np.arange(len(F))[::-1], 3)
    triangles = triangle[vertices]
    return triangles, (F[triangles] == vertices[..., None]).astype(np.float64)
