"""The triangles of a mesh, cut into smaller ones that know where they came from."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from ...kernel import Ints, kernel

# Of a triangle abc: its corners, a point on each of its sides, and one inside.
A, B, C, AB, BC, CA, MIDDLE = range(7)

Triangle = tuple[int, int, int]

# For each set of cut sides of a triangle (see `Surface.subdivided`), the triangles that take its place.
_SPLITS: dict[int, tuple[Triangle, ...]] = {
    1: ((A, AB, C), (AB, B, C)),
    2: ((B, BC, A), (BC, C, A)),
    4: ((C, CA, B), (CA, A, B)),
    3: ((AB, B, BC), (A, AB, BC), (A, BC, C)),
    6: ((BC, C, CA), (B, BC, CA), (B, CA, A)),
    5: ((CA, A, AB), (C, CA, AB), (C, AB, B)),
    7: ((A, AB, CA), (AB, B, BC), (CA, BC, C), (AB, BC, CA)),
}


@dataclasses.dataclass(frozen=True, eq=False)
class Edges:
    """The edges of triangles.

    Attributes
    ----------
    ends : int64 [e, 2]
    of : int64 [m, 3]
        Of each triangle, the edges ab, bc, ca.
    sides : int64 [e, 2]
        The two sides that lie on each edge: 3 triangle + k for side k of a triangle; -1 beyond a rim.
    """

    ends: NDArray[np.int64]
    of: NDArray[np.int64]
    sides: NDArray[np.int64]

    @property
    def rim(self) -> NDArray[np.bool_]:
        """Which edges lie at a rim, [e]."""
        return self.sides[:, 1] < 0


def edges_of(F: NDArray[np.int64]) -> Edges:
    """Edges of the triangles F [m, 3], which form a manifold; sorted by their lower ends, then by the higher."""
    tail, head = F.ravel(), np.roll(F, -1, axis=1).ravel()
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    size = int(F.max()) + 1 if len(F) else 1
    order = _sorted(low, _sorted(high, np.arange(len(low)), size), size)
    first = np.ones(len(order), bool)
    first[1:] = (np.diff(low[order]) != 0) | (np.diff(high[order]) != 0)
    of = np.empty(len(order), np.int64)
    of[order] = np.cumsum(first) - 1
    sides = np.full((int(first.sum()), 2), -1)
    sides[:, 0], sides[of[order[~first]], 1] = order[first], order[~first]
    return Edges(np.stack([low[sides[:, 0]], high[sides[:, 0]]], axis=1), of.reshape(-1, 3), sides)


@kernel
def _sorted(key: Ints, order: Ints, size: int) -> Ints:
    """An order [k] sorted by a key below `size`, stable (a counting sort: a third of the layout went into others)."""
    start, result = np.zeros(size + 1, np.int64), np.empty(len(order), np.int64)
    for i in order:
        start[key[i] + 1] += 1
    for j in range(size):
        start[j + 1] += start[j]
    for i in order:
        result[start[key[i]]] = i
        start[key[i]] += 1
    return result


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

    @functools.cached_property
    def angles(self) -> NDArray[np.float64]:
        """Angles in the corners of the triangles, [m, 3]."""
        corners = [self.V[self.F[:, k]] for k in range(3)]
        angles = np.empty((len(self.F), 3))
        for k in range(3):
            u, v = (corners[(k + j) % 3] - corners[k] for j in (1, 2))
            angles[:, k] = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v))
        return angles

    @functools.cached_property
    def at_rim(self) -> NDArray[np.bool_]:
        """Vertices at a rim, [n]."""
        at_rim = np.zeros(len(self.V), bool)
        at_rim[self.edges.ends[self.edges.rim]] = True
        return at_rim

    def subdivided(
        self, places: NDArray[np.float64], patterns: dict[int, tuple[Triangle, ...]] = _SPLITS
    ) -> Subdivision:
        """Cut edges, and the triangles beside them.

        Parameters
        ----------
        places : float64 [e]
            Where each edge is cut, between 0 at its first end and 1; NaN where it is not.
        patterns : dict, optional
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
