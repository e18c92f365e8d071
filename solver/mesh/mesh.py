"""Triangle meshes: cleaned where that is safe, otherwise refused with the name of the defect."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver.errors import MeshError

from .cleaning import merge_vertices, orient_outward, signed_volume
from .topology import check_topology, distinct

# Lengths whose squares and cubes are far from the limits of float64, in either direction.
_SMALLEST, _LARGEST = 1e-12, 1e12


@dataclasses.dataclass(frozen=True, eq=False)
class Mesh:
    """A closed, connected, outward-oriented triangle mesh of genus 0.

    Make one with `load_mesh` or `Mesh.from_arrays`; both validate.

    Attributes
    ----------
    V : float64 [vertex_count, 3]
        Vertices [m].
    F : int64 [triangle_count, 3]
        Triangles, counter-clockwise seen from outside.
    uv : float64 [vertex_count, 2] or None
        The object's own texture coordinates, one pair a vertex (at a UV seam, one of the pairs that meet there).
    corner_uv : float64 [triangle_count, 3, 2] or None
        The object's own texture coordinates at every corner of every triangle: exact at seams.
    fixes : tuple of str
        Repairs made on reading, one phrase each.
    """

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    uv: NDArray[np.float64] | None = None
    corner_uv: NDArray[np.float64] | None = None
    fixes: tuple[str, ...] = ()

    @classmethod
    def from_arrays(cls, V: ArrayLike, F: ArrayLike, uv: ArrayLike | None = None, name: str = "mesh") -> Mesh:
        """Validate and clean a triangle soup.

        Parameters
        ----------
        V : [vertex_count, 3]
            Vertices [m]. Equal positions are merged.
        F : [triangle_count, 3]
            Triangles in any winding.
        uv : [vertex_count, 2] or [triangle_count, 3, 2], optional
            Texture coordinates of the vertices as given (before merging), or of every corner.
        name : str
            Its name in messages.

        Raises
        ------
        MeshError
            If the surface is not finite, not closed, not manifold, not orientable, in several parts, of genus > 0, or
            degenerate.
        """
        points, triangles = _checked(V, F, name)
        corner_uv = None if uv is None else _corner_uv(uv, points, triangles, name)
        fixes: list[str] = []
        points, triangles, keep = merge_vertices(points, triangles, fixes)
        check_topology(points, triangles, name)
        corner_uv = None if corner_uv is None else corner_uv[keep]
        triangles, corner_uv = orient_outward(points, triangles, corner_uv, fixes, name)
        vertex_uv = None
        if corner_uv is not None:
            vertex_uv = np.zeros((len(points), 2))
            vertex_uv[triangles[::-1].ravel()] = corner_uv[::-1].reshape(-1, 2)
        return cls(points, triangles, vertex_uv, corner_uv, tuple(fixes))

    @functools.cached_property
    def triangle_areas(self) -> NDArray[np.float64]:
        """Triangle areas [m^2], shape [triangle_count]."""
        return _area_vectors(self.V, self.F)[1] / 2

    @property
    def area(self) -> float:
        """Surface area [m^2]."""
        return float(self.triangle_areas.sum())

    @property
    def volume(self) -> float:
        """Enclosed volume [m^3]."""
        return signed_volume(self.V, self.F)

    @functools.cached_property
    def vertex_normals(self) -> NDArray[np.float64]:
        """Unit normals weighted by corner angle, shape [vertex_count, 3] (Thuermer and Wuethrich 1998)."""
        corners = self.V[self.F]
        triangle_normals = _area_vectors(self.V, self.F)[0]
        length = np.linalg.norm(triangle_normals, axis=1, keepdims=True)
        triangle_normals = triangle_normals / np.where(length > 0, length, 1)
        normals = np.zeros_like(self.V)
        for k in range(3):
            a, b = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
            angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
            for axis in range(3):
                normals[:, axis] += np.bincount(
                    self.F[:, k], weights=angle * triangle_normals[:, axis], minlength=len(self.V)
                )
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.where(length > 0, normals / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])


def _checked(V: ArrayLike, F: ArrayLike, name: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    try:
        points, triangles = np.asarray(V, dtype=np.float64), np.asarray(F)
        if triangles.dtype.kind not in "iu":
            raise TypeError(f"F holds {triangles.dtype}, valid are integers")
        triangles = triangles.astype(np.int64)
    except (TypeError, ValueError) as error:
        raise MeshError(f"{name}: V and F must be arrays of numbers: {error}") from error
    if points.ndim != 2 or points.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3 or not len(triangles):
        raise MeshError(f"{name}: V must be [n, 3] and F [m, 3] with m > 0, got {points.shape} and {triangles.shape}")
    if triangles.min() < 0 or triangles.max() >= len(points):
        raise MeshError(
            f"{name}: triangle indices run from {triangles.min()} to {triangles.max()}, valid is 0 to {len(points) - 1}"
        )
    used = distinct(triangles)
    bad = used[~np.isfinite(points[used]).all(axis=1)]
    if len(bad):
        raise MeshError(f"{name}: {len(bad)} vertices are NaN or infinite (the first is vertex {bad[0]})")
    with np.errstate(over="ignore"):
        extent = np.ptp(points[used], axis=0).max()
    if not _SMALLEST <= extent <= _LARGEST:
        raise MeshError(f"{name}: its size is {extent:.3g} m; valid is {_SMALLEST:g} to {_LARGEST:g} m")
    return points, triangles


def _corner_uv(uv: ArrayLike, V: NDArray, F: NDArray, name: str) -> NDArray[np.float64]:
    pairs = np.asarray(uv, dtype=np.float64)
    if pairs.shape == (len(V), 2):
        return pairs[F]
    if pairs.shape == (*F.shape, 2):
        return pairs
    raise MeshError(f"{name}: uv has shape {pairs.shape}; valid is {(len(V), 2)} or {(*F.shape, 2)}")


def _area_vectors(V: NDArray, F: NDArray) -> tuple[NDArray, NDArray]:
    """Normals of the triangles as long as twice their areas, and those lengths."""
    vectors = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    return vectors, np.linalg.norm(vectors, axis=1)
