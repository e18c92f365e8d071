"""Points of a surface that is laid out on charts: where they lie in space and on its mesh."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...mesh.mesh import Mesh
from .layout import PatchMap
from .located import locate_in_charts, locate_texels


class Samples(NamedTuple):
    """Points on a grid of charts.

    Attributes
    ----------
    small : int64 [..., n, n]
        Triangles of the surface that the charts are made of.
    weights : float64 [..., n, n, 3]
        Barycentric coordinates in them.
    triangles : int64 [..., n, n]
        Triangles of the mesh.
    barycentrics : float64 [..., n, n, 3]
        In those.
    positions, normals : float64 [..., n, n, 3]
        [m], and unit.
    """

    small: NDArray[np.int64]
    weights: NDArray[np.float64]
    triangles: NDArray[np.int64]
    barycentrics: NDArray[np.float64]
    positions: NDArray[np.float64]
    normals: NDArray[np.float64]


class Sampler(NamedTuple):
    """A mesh and its map onto charts."""

    mesh: Mesh
    patches: PatchMap

    def everywhere(self, n: int) -> Samples:
        """The centres of n x n squares of every chart."""
        return self.samples(*locate_texels(self.patches.seamless, n))

    def in_charts(self, n: int, charts: NDArray[np.int64]) -> Samples:
        """The same in some charts alone; `small` is -1 where a point was not found."""
        return self.samples(*locate_in_charts(self.patches.seamless, n, charts))

    def samples(self, small: NDArray[np.int64], weights: NDArray[np.float64]) -> Samples:
        """Points at barycentric coordinates in triangles of the surface."""
        mesh, surface = self.mesh, self.patches.surface
        positions = np.einsum("...k,...kj->...j", weights, surface.V[surface.F[small]])
        triangles = surface.parent[small]
        barycentrics = np.einsum("...k,...kj->...j", weights, surface.inside[small])
        at_corners = mesh.vertex_normals[mesh.F[triangles]]
        normals = np.einsum("...k,...kj->...j", barycentrics, at_corners)
        length = np.linalg.norm(normals, axis=-1, keepdims=True)
        normals = np.where(length > 1e-9, normals / np.maximum(length, 1e-9), at_corners[..., 0, :])
        return Samples(small, weights, triangles, barycentrics, positions, normals)
