"""Triangle meshes: manifold and oriented surfaces of any kind, made from any triangle soup."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import MeshError
from .clean import cleaned
from .normals import vertex_normals
from .orientation import part_volumes
from .topology import distinct, genera, rims_of, sides_of
from .winding import labels

# Lengths whose squares and cubes are far from the limits of float64, in either direction.
_SMALLEST, _LARGEST = 1e-12, 1e12


@dataclasses.dataclass(frozen=True, eq=False)
class Mesh:
    """A manifold, oriented triangle mesh: closed or open, of any genus, in one part or several.

    Make one with `load_mesh` or `Mesh.from_arrays`, which mend what they are given. Every edge belongs to two
    triangles or, on a rim, to one; the triangles at a vertex form one fan; every triangle has an area. Where surfaces
    touch, each has vertices of its own at the same place.

    Attributes
    ----------
    V : float64 [vertex_count, 3]
        Vertices [m].
    F : int64 [triangle_count, 3]
        Triangles, counter-clockwise seen from outside, or, on an open part, from the side from which most were.
    uv : float64 [vertex_count, 2] or None
        The object's own texture coordinates, one pair a vertex (at a UV seam, one of the pairs that meet there).
    corner_uv : float64 [triangle_count, 3, 2] or None
        The object's own texture coordinates at every corner of every triangle: exact at seams.
    notes : tuple of str
        What was done to it on reading, one line each.
    name : str
        Its name in messages.
    """

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    uv: NDArray[np.float64] | None = None
    corner_uv: NDArray[np.float64] | None = None
    notes: tuple[str, ...] = ()
    name: str = "mesh"

    @classmethod
    def from_arrays(cls, V: ArrayLike, F: ArrayLike, uv: ArrayLike | None = None, name: str = "mesh") -> Mesh:
        """Make a mesh of any triangle soup.

        Equal positions are merged, hairline cracks closed, and triangles that repeat or have no area dropped. Where
        more than two triangles meet along an edge, or fans of them at a vertex, the sheets are cut apart. A one-sided
        surface, such as a Moebius band, is cut open along a path. Then each part is wound alike: outwards if it is
        closed, as most of its triangles were if it is open. Nothing is filled. A mesh made from the arrays of another
        is the same mesh, without notes.

        Parameters
        ----------
        V : [vertex_count, 3]
            Vertices [m].
        F : [triangle_count, 3]
            Triangles in any winding.
        uv : [vertex_count, 2] or [triangle_count, 3, 2], optional
            Texture coordinates of the vertices as given (before merging), or of every corner.
        name : str
            Its name in messages.

        Raises
        ------
        MeshError
            If there is no triangle with an area, or a vertex is not finite.
        """
        points, triangles = _checked(V, F, name)
        corner_uv = None if uv is None else _corner_uv(uv, points, triangles, name)
        with np.errstate(under="ignore"):
            points, corners, notes = cleaned(points, triangles, corner_uv, name)
        vertex_uv = None
        if corners.uv is not None:
            vertex_uv = np.zeros((len(points), 2))
            vertex_uv[corners.F[::-1].ravel()] = corners.uv[::-1].reshape(-1, 2)
        return cls(points, corners.F, vertex_uv, corners.uv, notes, name)

    @functools.cached_property
    def components(self) -> NDArray[np.int64]:
        """Part to which each triangle belongs, numbered from 0 by their first triangles, shape [triangle_count]."""
        return labels(sides_of(self.F)[0] // 3, len(self.F))

    @property
    def component_count(self) -> int:
        """Number of parts."""
        return int(self.components.max()) + 1

    @functools.cached_property
    def rims(self) -> tuple[NDArray[np.int64], ...]:
        """Boundary loops: vertices of each in order, the surface to their left seen from outside."""
        return rims_of(self.F)

    @property
    def closed(self) -> bool:
        """Whether there is no rim."""
        return not self.rims

    @functools.cached_property
    def genus(self) -> NDArray[np.int64]:
        """Number of handles of every part, shape [component_count]; an open part has those that it has with lids."""
        return genera(self.F, self.components, self.rims)

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
        """Volume that the closed parts enclose [m^3]; open ones enclose none."""
        volume, _ = part_volumes(self.V, self.F, self.components)
        volume[self.components[sides_of(self.F)[1] // 3]] = 0
        return float(volume.sum())

    @functools.cached_property
    def vertex_normals(self) -> NDArray[np.float64]:
        """Unit normals, shape [vertex_count, 3]; see `normals.vertex_normals`."""
        return vertex_normals(self.V, self.F)


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
