"""The triangles of a mesh, cut into smaller ones that know where they came from."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

# Of a triangle abc: its corners, a point on each of its sides, and one inside.
A, B, C, AB, BC, CA, MIDDLE = range(7)

Triangle = tuple[int, int, int]


@dataclasses.dataclass(frozen=True, eq=False)
class Edges:
    """The edges of triangles.

    Attributes
    ----------
    ends : int64 [e, 2]
    of : int64 [m, 3]
        Of each triangle, the edges ab, bc, ca.
    count : int64 [e]
        Of triangles at each: 1 at a rim, else 2.
    """

    ends: NDArray[np.int64]
    of: NDArray[np.int64]
    count: NDArray[np.int64]

    @property
    def rim(self) -> NDArray[np.bool_]:
        """Which edges lie at a rim, [e]."""
        return self.count == 1

    @functools.cached_property
    def sides(self) -> NDArray[np.int64]:
        """The two sides that lie on each edge, [e, 2]: 3 triangle + k for side k of a triangle; -1 beyond a rim."""
        order = np.argsort(self.of.ravel(), kind="stable")
        first = np.cumsum(self.count) - self.count
        second = np.where(self.count == 2, order[np.minimum(first + 1, len(order) - 1)], -1)
        return np.stack([order[first], second], axis=1)


def edges_of(F: NDArray[np.int64]) -> Edges:
    """Edges of the triangles F [m, 3], which form a manifold."""
    tail, head = F, np.roll(F, -1, axis=1)
    size = int(F.max()) + 1 if len(F) else 1
    key = (np.minimum(tail, head) * size + np.maximum(tail, head)).ravel()
    unique, of, count = np.unique(key, return_inverse=True, return_counts=True)
    return Edges(np.stack(np.divmod(unique, size), axis=1), of.reshape(-1, 3), count)


@dataclasses.dataclass(frozen=True, eq=False)
class Surface:
    """Triangles that cover a mesh; each is a part of one of its triangles, its parent.

    Attributes
    ----------
    V : float64 [n, 3]
        Points [m].
    F : int64 [m, 3]
    parent : int64 [m]
        Triangle of the mesh in which each lies.
    inside : float64 [m, 3, 3]
        Barycentric coordinates in it, of the three corners.
    """

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    parent: NDArray[np.int64]
    inside: NDArray[np.float64]

    @classmethod
    def of(cls, V: NDArray[np.float64], F: NDArray[np.int64]) -> Surface:
        """The triangles of a mesh as they are."""
        return cls(V, F, np.arange(len(F)), np.broadcast_to(np.eye(3), (len(F), 3, 3)))

    @functools.cached_property
    def edges(self) -> Edges:
        """Edges of the triangles."""
        return edges_of(self.F)

    @functools.cached_property
    def edge_lengths(self) -> NDArray[np.float64]:
        """Lengths of the edges [m], [e]."""
        ends = self.V[self.edges.ends]
        return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)

    @functools.cached_property
    def areas(self) -> NDArray[np.float64]:
        """Areas of the triangles [m^2], [m]."""
        a, b, c = (self.V[self.F[:, k]] for k in range(3))
        return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2

    def subdivided(self, places: NDArray[np.float64], patterns: dict[int, tuple[Triangle, ...]]) -> Subdivision:
        """Cut edges, and the triangles beside them.

        Parameters
        ----------
        places : float64 [e]
            Where each edge is cut, between 0 at its first end and 1; NaN where it is not.
        patterns : dict
            For each set of cut sides of a triangle (1 for ab, 2 for bc, 4 for ca, added up) the triangles to put in
            its place, by the seven points named in this module.
        """
        edges, count = self.edges, len(self.V)
        cut = np.flatnonzero(~np.isnan(places))
        middles = np.full(len(edges.ends), -1)
        middles[cut] = count + np.arange(len(cut))
        t = places[cut][:, None]
        first, second = self.V[edges.ends[cut]].transpose(1, 0, 2)
        points = [self.V, first * (1 - t) + second * t]
        sets = ((middles[edges.of] >= 0) * (1, 2, 4)).sum(axis=1)
        touched = np.flatnonzero(sets)
        nodes, local = self._nodes(touched, middles, places)
        central = np.flatnonzero([any(MIDDLE in each for each in patterns.get(int(s), ())) for s in range(8)])
        inner = np.flatnonzero(np.isin(sets[touched], central))
        nodes[inner, MIDDLE] = count + len(cut) + np.arange(len(inner))
        points.append(np.einsum("ij,ijk->ik", local[inner, MIDDLE], self.V[self.F[touched[inner]]]))
        whole = np.flatnonzero(sets == 0)
        F, weights, origin = [self.F[whole]], [np.broadcast_to(np.eye(3), (len(whole), 3, 3))], [whole]
        for number, triangles in patterns.items():
            chosen = np.flatnonzero(sets[touched] == number)
            for triangle in triangles:
                F.append(nodes[chosen][:, triangle])
                weights.append(local[chosen][:, triangle])
                origin.append(touched[chosen])
        source, share = np.concatenate(origin), np.concatenate(weights)
        finer = Surface(np.concatenate(points), np.concatenate(F), self.parent[source], share @ self.inside[source])
        return Subdivision(finer, middles, source, share)

    def _nodes(
        self, triangles: NDArray[np.int64], middles: NDArray[np.int64], places: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Vertices [k, 7] of the named points of triangles [k], and their barycentrics [k, 7, 3]."""
        nodes, local = np.full((len(triangles), 7), -1), np.zeros((len(triangles), 7, 3))
        nodes[:, :3], local[:, :3] = self.F[triangles], np.eye(3)
        for k in range(3):
            edge = self.edges.of[triangles, k]
            nodes[:, 3 + k] = middles[edge]
            forward = self.edges.ends[edge, 0] == self.F[triangles, k]
            t = np.where(forward, places[edge], 1 - places[edge])
            local[:, 3 + k, k], local[:, 3 + k, (k + 1) % 3] = 1 - t, t
        corners = np.where(np.isnan(local[:, 3:6]), 0.0, local[:, 3:6]).sum(axis=1)
        local[:, MIDDLE] = corners / np.maximum(corners.sum(axis=1, keepdims=True), 1e-300)
        return nodes, local


@dataclasses.dataclass(frozen=True, eq=False)
class Subdivision:
    """A surface whose edges were cut.

    Attributes
    ----------
    surface : Surface
        Its first vertices are those from before.
    middles : int64 [e]
        The new vertex on each edge from before; -1 where it was not cut.
    origin : int64 [m]
        Of each triangle, the one from before in which it lies.
    weights : float64 [m, 3, 3]
        Barycentric coordinates in that one, of its corners.
    """

    surface: Surface
    middles: NDArray[np.int64]
    origin: NDArray[np.int64]
    weights: NDArray[np.float64]
