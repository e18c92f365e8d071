"""Texels that ride on the triangles of a mesh whose vertices move."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.kernel import Floats, Ints, kernel
from ripple_sim.solver.mesh.triangle_tree import closest_points

from .atlas import Atlas
from .barycentrics import barycentrics_in
from .topology import TexelTopology

# Rest positions further off their triangles than this, in units of the surface's size, keep that distance.
_OFF = 1e-9


class Ride(NamedTuple):
    """Points that keep their triangle and their barycentric coordinates, k of them.

    Attributes
    ----------
    corners : int64 [k, 3]
        Vertices of their triangles.
    weights : float64 [k, 3]
        Barycentric coordinates.
    offsets : float64 [k, 3]
        Where they lie off that place, along the triangle's first side, across it, and along its normal, in units of
        the root of twice its area; 0 rows where none does.
    """

    corners: Ints
    weights: Floats
    offsets: Floats

    @classmethod
    def of(cls, V: Floats, corners: Ints, weights: Floats, points: Floats) -> Ride:
        """The ride of points [k, 3] whose triangles and barycentric coordinates are known."""
        off = points - np.einsum("ij,ijk->ik", weights, V[corners])
        if np.abs(off).max(initial=0.0) <= _OFF * np.ptp(V, axis=0).max():
            return cls(corners, weights, np.zeros((0, 3)))
        frames = _frames(V, corners)
        return cls(corners, weights, np.linalg.solve(np.swapaxes(frames, 1, 2), off[..., None])[..., 0])

    def at(self, V: Floats) -> Floats:
        """Positions [k, 3] for the vertices V [n, 3] [m]."""
        points = np.empty((len(self.corners), 3))
        interpolate(V, self.corners, self.weights, points)
        if len(self.offsets):
            points += np.einsum("ij,ijk->ik", self.offsets, _frames(V, self.corners))
        return points


class SurfaceRide:
    """All places of an atlas, on vertices that move.

    Parameters
    ----------
    atlas : Atlas
        At rest.
    """

    def __init__(self, atlas: Atlas) -> None:
        self._topology: TexelTopology = atlas.texels.topology
        V, F = atlas.mesh.V, np.asarray(atlas.mesh.F, np.int64)
        self._texels = Ride.of(
            V, F[atlas.triangles.reshape(-1)], atlas.barycentrics.reshape(-1, 3), atlas.positions.reshape(-1, 3)
        )
        self._rim: Ride | None = None
        around = atlas.texels.halo_positions
        self._nothing = ~np.isfinite(around[..., 0])
        beyond = atlas.texels.beyond
        self._has_beyond = beyond is not None
        if beyond is None:
            return
        halo = self._topology.halo
        self._on_rim = self._topology.rim & ~self._nothing
        points = np.ascontiguousarray(around[self._on_rim])
        if len(points):
            triangle, closest = closest_points(atlas.tree, points)
            corners = F[triangle]
            self._rim = Ride.of(V, corners, barycentrics_in(V[corners], closest), points)
        # images of a periodic surface keep their way to the texels that they show
        self._image = ~self._topology.own & ~self._topology.rim & (halo >= 0) & ~self._nothing
        self._shift = around[self._image] - atlas.positions.reshape(-1, 3)[halo[self._image]]

    def positions(self, V: Floats) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
        """Positions of the texels [C, n, n, 3] and what lies beyond them; see `TexelMesh`."""
        points = self._texels.at(V)
        if not self._has_beyond:
            return points.reshape(*self._topology.shape, 3), None
        beyond = self._topology.with_halo(points.reshape(*self._topology.shape, 3))
        beyond[self._image] += self._shift
        if self._rim is not None:
            beyond[self._on_rim] = self._rim.at(V)
        beyond[self._nothing] = np.nan
        return points.reshape(*self._topology.shape, 3), beyond

    def normals(self, vertex_normals: Floats) -> NDArray[np.float64]:
        """Unit normals of the texels [C, n, n, 3], from those of the vertices [n, 3]."""
        normals = np.empty((len(self._texels.corners), 3))
        interpolate(vertex_normals, self._texels.corners, self._texels.weights, normals)
        length = np.sqrt(np.einsum("ij,ij->i", normals, normals))[:, None]
        return (normals / np.maximum(length, 1e-30)).reshape(*self._topology.shape, 3)


def _frames(V: Floats, corners: Ints) -> NDArray[np.float64]:
    """First side, direction across it, and normal of triangles, as rows as long as the root of twice the area."""
    x = V[corners]
    along, across = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    normal = np.cross(along, across)
    double = np.linalg.norm(normal, axis=1)[:, None]
    normal /= np.maximum(double, 1e-300)
    along /= np.maximum(np.linalg.norm(along, axis=1)[:, None], 1e-300)
    return np.sqrt(double)[..., None] * np.stack([along, np.cross(normal, along), normal], axis=1)


@kernel
def interpolate(values: Floats, corners: Ints, weights: Floats, out: Floats) -> None:
    """Values [n, 3] of vertices at points with weights [k, 3] at corners [k, 3], into [k, 3]."""
    for i in range(len(corners)):
        a, b, c = corners[i, 0], corners[i, 1], corners[i, 2]
        for k in range(3):
            out[i, k] = weights[i, 0] * values[a, k] + weights[i, 1] * values[b, k] + weights[i, 2] * values[c, k]
