"""Distances along a surface, between its vertices."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from .surface import Surface

_LEAST = 1e-12  # of the longest link: graphs know no links of length 0


@dataclasses.dataclass(frozen=True, eq=False)
class Metric:
    """Distances along a surface, in units of a length that differs from place to place.

    Attributes
    ----------
    surface : Surface
    graph : csr_array [n, n]
        Links between near vertices with their lengths in these units.
    unit : float64 [n]
        At each vertex [m].
    """

    surface: Surface
    graph: csr_array
    unit: NDArray[np.float64]

    @classmethod
    def of(cls, surface: Surface) -> Metric:
        """Distances in metres."""
        return cls(surface, distance_graph(surface), np.ones(len(surface.V)))

    def in_units(self, unit: NDArray[np.float64]) -> Metric:
        """The same distances in other units [n] [m]; a link takes the mean of both ends."""
        row = np.repeat(np.arange(len(unit)), np.diff(self.graph.indptr))
        column = self.graph.indices
        lengths = self.graph.data * (self.unit[row] + self.unit[column]) / (unit[row] + unit[column])
        return Metric(self.surface, csr_array((lengths, column, self.graph.indptr), self.graph.shape), unit)

    @functools.cached_property
    def edge_lengths(self) -> NDArray[np.float64]:
        """Lengths of the surface's edges, none of them 0, [e]."""
        lengths = self.surface.edge_lengths / self.unit[self.surface.edges.ends].mean(axis=1)
        return np.maximum(lengths, np.finfo(np.float64).tiny)

    @functools.cached_property
    def masses(self) -> NDArray[np.float64]:
        """Area that belongs to each vertex, [n]."""
        surface = self.surface
        lumped = np.bincount(surface.F.ravel(), np.repeat(surface.areas / 3, 3), len(surface.V))
        return lumped / self.unit**2 + np.finfo(np.float64).tiny


def distance_graph(surface: Surface) -> csr_array:
    """Vertices linked along edges, and straight across each edge between the two vertices opposite to it [m]."""
    edges, V, F = surface.edges, surface.V, surface.F
    inner = np.flatnonzero(~edges.rim)
    triangle, side = np.divmod(edges.sides[inner].T, 3)
    p, q = F[triangle, (side + 2) % 3]
    a, b = V[edges.ends[inner]].transpose(1, 0, 2)
    length = surface.edge_lengths[inner]
    along = (b - a) / np.maximum(length, np.finfo(np.float64).tiny)[:, None]
    # laid flat about the edge, p lies on one side and q on the other
    xp, yp = _along_and_across(V[p] - a, along)
    xq, yq = _along_and_across(V[q] - a, along)
    crossing = xp + (xq - xp) * yp / np.maximum(yp + yq, np.finfo(np.float64).tiny)
    straight = (crossing > 0) & (crossing < length) & (p != q)
    ends = np.concatenate([edges.ends, np.stack([p, q], axis=1)[straight]])
    weights = np.concatenate([surface.edge_lengths, np.hypot(xp - xq, yp + yq)[straight]])
    weights = np.maximum(weights, _LEAST * weights.max())
    low, high = ends.min(axis=1), ends.max(axis=1)
    order = np.lexsort((weights, low * len(V) + high))
    key = (low * len(V) + high)[order]
    kept = order[np.concatenate([[True], key[1:] != key[:-1]])]
    pairs = np.concatenate([low[kept], high[kept]]), np.concatenate([high[kept], low[kept]])
    return csr_array(coo_array((np.tile(weights[kept], 2), pairs), shape=(len(V), len(V))))


def _along_and_across(
    offset: NDArray[np.float64], along: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Parts of offsets [k, 3] along a direction and across it."""
    x = np.einsum("ij,ij->i", offset, along)
    square = np.einsum("ij,ij->i", offset, offset)
    return x, np.sqrt(np.maximum(square - x * x, 0.0))
