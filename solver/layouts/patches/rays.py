"""Cutting flat polygons from their middles to the middles of their sides."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .surface import Subdivision, Surface

_ON_RAY = 1e-9  # of the size of a polygon


@dataclasses.dataclass(frozen=True, eq=False)
class Flat:
    """Parts of a surface laid out in the plane.

    Attributes
    ----------
    surface : Surface
    part : int64 [m]
    places : float64 [m, 3, 2]
        Of the triangles' corners.
    """

    surface: Surface
    part: NDArray[np.int64]
    places: NDArray[np.float64]

    def of(self, finer: Subdivision) -> Flat:
        """The same on a subdivision of the surface."""
        return Flat(finer.surface, self.part[finer.origin], finer.weights @ self.places[finer.origin])


def central_vertices(flat: Flat, on_border: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Of each part the inner vertex nearest to the origin."""
    distance = np.where(on_border[flat.surface.F], np.inf, (flat.places**2).sum(axis=2)).ravel()
    part = np.repeat(flat.part, 3)
    order = np.lexsort((distance, part))
    first = order[np.searchsorted(part[order], np.arange(flat.part.max() + 1))]
    return flat.surface.F.ravel()[first]


def cut_ray(
    flat: Flat, start: NDArray[np.int64], end: NDArray[np.int64], on_border: NDArray[np.bool_]
) -> tuple[Flat, list[NDArray[np.int64]]]:
    """Cut parts along a straight line each, from one of their vertices to one on their border.

    Parameters
    ----------
    flat : Flat
    start, end : int64 [parts]
        Vertices; -1 where a part is not to be cut.
    on_border : bool [n]

    Returns
    -------
    Flat
    list of int64 [l]
        The vertices along each line, from start to end.
    """
    surface = flat.surface
    origin, target = _place_of(flat, start), _place_of(flat, end)
    direction = (target - origin) / np.linalg.norm(target - origin, axis=1, keepdims=True)
    offset = flat.places - origin[flat.part][:, None]
    toward = direction[flat.part][:, None]
    reach = (offset * toward).sum(axis=2)
    beside = toward[..., 0] * offset[..., 1] - toward[..., 1] * offset[..., 0]
    ends_here = (start[flat.part][:, None] == surface.F) | (end[flat.part][:, None] == surface.F)
    on_ray = (np.abs(beside) < _ON_RAY) & (reach > 0) & ~on_border[surface.F] | ends_here
    beside[on_ray] = 0.0
    sides = surface.edges.sides
    triangle, k = np.divmod(sides[:, 0], 3)
    p, q = beside[triangle, k], beside[triangle, (k + 1) % 3]
    crossed = (p * q < 0) & (sides[:, 1] >= 0)
    crossed &= flat.part[triangle] == flat.part[np.where(crossed, sides[:, 1], sides[:, 0]) // 3]
    t = np.where(crossed, p / np.where(crossed, p - q, 1.0), np.nan)
    crossed &= (1 - t) * reach[triangle, k] + t * reach[triangle, (k + 1) % 3] > 0
    forward = surface.edges.ends[:, 0] == surface.F[triangle, k]
    finer = surface.subdivided(np.where(crossed, np.where(forward, t, 1 - t), np.nan))
    touched = np.flatnonzero(on_ray.any(axis=1))
    inner = np.stack([flat.part[touched].repeat(3), surface.F[touched].ravel(), reach[touched].ravel()])[
        :, on_ray[touched].ravel()
    ]
    cut = np.flatnonzero(crossed)
    distance = ((1 - t) * reach[triangle, k] + t * reach[triangle, (k + 1) % 3])[cut]
    points = np.concatenate([inner, np.stack([flat.part[triangle[cut]], finer.middles[cut], distance])], axis=1)
    return flat.of(finer), _paths(points, len(start))


def _place_of(flat: Flat, vertex: NDArray[np.int64]) -> NDArray[np.float64]:
    """Places [parts, 2] of one vertex of each part; NaN where that is -1."""
    places = np.full((len(vertex), 2), np.nan)
    triangle, k = np.nonzero(vertex[flat.part][:, None] == flat.surface.F)
    places[flat.part[triangle]] = flat.places[triangle, k]
    return places


def _paths(points: NDArray[np.float64], parts: int) -> list[NDArray[np.int64]]:
    """Vertices of each part in order, from rows part, vertex, and distance along the line."""
    order = np.lexsort((points[2], points[0]))
    part, vertex = points[:2, order].astype(np.int64)
    first = np.concatenate([[True], (np.diff(part) != 0) | (np.diff(vertex) != 0)]) if len(part) else np.zeros(0, bool)
    part, vertex = part[first], vertex[first]
    return np.split(vertex, np.searchsorted(part, np.arange(1, parts)))
