"""A tessellated surface on a mesh that moves: its points, normals and ambient occlusion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ripple_sim.render.visuals.corners import bounding_radius, cast, frames_about, smooth_normals
from ripple_sim.solver import Mesh
from ripple_sim.solver.kernel import Floats, Floats32, Ints, kernel
from ripple_sim.solver.mesh.queries import ClosestPoints
from ripple_sim.solver.mesh.vectors import cross, dot, row, subtract
from ripple_sim.solver.texels.barycentrics import barycentrics_in

from .tessellation import coarse_mesh

_MAX_SAMPLES = 1_000  # vertices of the coarse mesh, which cast rays
_RAYS = 32_000  # in a frame, about, on both sides of the surface
_NEAR_SAMPLES = 6  # about a point, from which its occlusion is interpolated


class MovingVertices:
    """Moves the points of a finer surface along with the mesh on which the surface was made.

    The motion of a triangle is a linear map, under which unit normals keep their length. A vertex
    takes the mean of the maps about it, and a point the mean of the maps at the corners of its
    triangle: bulges of the surface stay, and normals turn smoothly.

    Parameters
    ----------
    V : float64 [k, 3]
        Vertices of the mesh at rest [m].
    F : int64 [m, 3]
    points, directions, normals : float64 [n, 3]
        Of the finer surface at rest; the latter two are unit vectors.

    Attributes
    ----------
    rest : (int64 [n, 3], float64 [n, 3], float64 [n, 3], float64 [n, 3], float64 [n, 3])
        How the points hang on the mesh: vertices of the nearest triangle, weights of these at the
        nearest place, the way from there to the point [m], and the directions and normals.
    """

    def __init__(
        self, V: NDArray, F: NDArray, points: NDArray, directions: NDArray, normals: NDArray
    ) -> None:
        self._V = np.ascontiguousarray(V, np.float64)
        self._F = np.ascontiguousarray(F, np.int64)
        points = np.ascontiguousarray(points, np.float64)
        directions = np.ascontiguousarray(directions, np.float64)
        normals = np.ascontiguousarray(normals, np.float64)
        triangle, closest = ClosestPoints(self._V, self._F)(points)
        corners = self._F[triangle]
        weights = barycentrics_in(self._V[corners], closest)
        offset = points - np.einsum("ij,ijk->ik", weights, self._V[corners])
        self.rest = corners, weights, offset, directions, normals

    def __call__(self, V: NDArray[np.float64]) -> tuple[Floats32, Floats32, Floats32]:
        """Points [m], directions of displacement and normals for vertices [k, 3] [m].

        All three are float32 [n, 3].
        """
        V = np.ascontiguousarray(V, np.float64)
        maps = _vertex_maps(self._V, V, self._F)
        count = len(self.rest[0])
        points = np.empty((count, 3), np.float32)
        directions = np.empty((count, 3), np.float32)
        normals = np.empty((count, 3), np.float32)
        _move(V, maps, *self.rest, points, directions, normals)
        return points, directions, normals


@kernel
def _frame(V: Floats, F: Ints, i: int, frame: Floats) -> float:
    """Two sides and the unit normal of a triangle, as rows; return twice its area."""
    first = row(V, F[i, 0])
    u = subtract(row(V, F[i, 1]), first)
    v = subtract(row(V, F[i, 2]), first)
    normal = cross(u, v)
    length = np.sqrt(dot(normal, normal))
    for k in range(3):
        frame[0, k] = u[k]
        frame[1, k] = v[k]
        frame[2, k] = normal[k] / max(length, 1e-300)
    return length


@kernel
def _vertex_maps(rest: Floats, moved: Floats, F: Ints) -> Floats:
    """Mean linear map about each vertex, [k, 3, 3], of its triangles' maps by their areas."""
    maps = np.zeros((len(rest), 3, 3))
    areas = np.zeros(len(rest))
    old = np.empty((3, 3))
    new = np.empty((3, 3))
    back = np.empty((3, 3))
    for i in range(len(F)):
        area = _frame(rest, F, i, old)
        _frame(moved, F, i, new)
        if not area > 0:
            continue
        # rows dual to the two sides and the normal
        first = cross(row(old, 1), row(old, 2))
        second = cross(row(old, 2), row(old, 0))
        for k in range(3):
            back[0, k] = first[k] / area
            back[1, k] = second[k] / area
            back[2, k] = old[2, k]
        for corner in range(3):
            v = F[i, corner]
            areas[v] += area
            for a in range(3):
                for b in range(3):
                    for k in range(3):
                        maps[v, a, b] += area * new[k, a] * back[k, b]
    for v in range(len(rest)):
        for a in range(3):
            for b in range(3):
                maps[v, a, b] = (
                    maps[v, a, b] / areas[v] if areas[v] > 0 else (1.0 if a == b else 0.0)
                )
    return maps


@kernel
def _turn(mean: Floats, rest: Floats, i: int, out: Floats32) -> None:
    """A unit normal under the cofactors of a map."""
    square = 0.0
    for a in range(3):
        total = dot(cross(row(mean, (a + 1) % 3), row(mean, (a + 2) % 3)), row(rest, i))
        out[i, a] = total
        square += total * total
    length = np.sqrt(square)
    for a in range(3):
        out[i, a] = np.float32(out[i, a] / length) if length > 1e-30 else np.float32(rest[i, a])


@kernel
def _move(
    V: Floats,
    maps: Floats,
    corners: Ints,
    weights: Floats,
    offset: Floats,
    rest_directions: Floats,
    rest_normals: Floats,
    points: Floats32,
    directions: Floats32,
    normals: Floats32,
) -> None:
    """Fill in points, directions and normals [n, 3] for vertices `V` and their maps.

    `corners` and `weights` are the corners of the nearest triangle and the weights of these at the
    nearest place; `offset` is the way from there to the point at rest [m].
    """
    mean = np.empty((3, 3))
    for i in range(len(points)):
        mean[:] = 0
        for j in range(3):
            for a in range(3):
                for b in range(3):
                    mean[a, b] += weights[i, j] * maps[corners[i, j], a, b]
        for a in range(3):
            place = 0.0
            for j in range(3):
                place += weights[i, j] * V[corners[i, j], a]
            for b in range(3):
                place += mean[a, b] * offset[i, b]
            points[i, a] = place
        _turn(mean, rest_directions, i, directions)
        _turn(mean, rest_normals, i, normals)


class MovingOcclusion:
    """Ambient occlusion of a surface that moves: the one baked at rest, plus its change.

    The change is found on a coarse mesh that moves along: its vertices cast rays against it, at
    rest and in each frame, so that the error of the coarse mesh cancels. The rays turn with the
    surface: a rigid motion changes nothing, and noise does not crawl.

    Parameters
    ----------
    V : float64 [k, 3]
        Vertices of the mesh at rest [m].
    F : int64 [m, 3]
    points, directions : float64 [n, 3]
        Of the drawn surface at rest, and its smooth normals.
    baked : float64 [n, 3]
        Ambient visibility, thickness and inner ambient visibility of the points, see `bake`.
    """

    def __init__(
        self, V: NDArray, F: NDArray, points: NDArray, directions: NDArray, baked: NDArray
    ) -> None:
        count = min(_MAX_SAMPLES, len(V))
        normals = smooth_normals(V, F)
        spacing = float(np.sqrt(Mesh(V, F).area / count))
        # so that the two sides of a thin body are far from each other
        apart = 2 * spacing * normals
        vertices, coarse = coarse_mesh(F, np.hstack([V, apart]), count)
        samples = cKDTree(np.hstack([V, apart])[vertices])
        distance, near = samples.query(
            np.hstack([points, 2 * spacing * directions]), min(_NEAR_SAMPLES + 1, samples.n)
        )
        # the weight of the farthest sample is 0, so that no point jumps when its samples change
        weights = (1 - distance / np.maximum(distance[:, -1:], 1e-300)) ** 2 + 1e-12
        self._baked = baked
        self._near = near
        self._weights = weights / weights.sum(axis=1, keepdims=True)
        self._vertices = vertices
        self._F = coarse
        self._radius = bounding_radius(V)
        # triangles of a coarse mesh may lie slightly over its vertices
        self._start = 0.3 * spacing if count < len(V) else 0.0
        self._count = int(np.clip(_RAYS // (2 * count), 16, 64))
        at_rest = self._of(V)
        normals = normals[vertices]
        self._frames = MovingVertices(
            at_rest, coarse, at_rest, frames_about(normals)[:, 1], normals
        )
        self._rest = self._measured(V)

    def __call__(self, V: NDArray[np.float64]) -> NDArray[np.float32]:
        """The baked values, as in `baked`, for vertices [k, 3] [m]."""
        change = self._measured(V) - self._rest
        baked = self._baked + np.einsum("ij,ijk->ik", self._weights, change[self._near])
        return np.clip(baked, 0.0, [1.0, 4.0, 1.0]).astype(np.float32)

    def _of(self, V: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vertices of the coarse mesh, about their mean: rays are in single precision."""
        coarse = V[self._vertices]
        return coarse - coarse.mean(axis=0)

    def _measured(self, V: NDArray[np.float64]) -> NDArray[np.float64]:
        """Occlusion and thickness of the coarse mesh, see `cast`, for vertices [k, 3] [m]."""
        V = self._of(V)
        _, directions, normals = self._frames(V)
        return cast(
            V, self._F, frames_about(normals, directions), self._count, self._radius, self._start
        )
