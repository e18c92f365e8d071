"""Triangle meshes: read, cleaned where that is safe, and refused by name where they are not closed genus-0 surfaces."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path

import igl
import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from .errors import MeshError


@dataclasses.dataclass(frozen=True, eq=False)
class Mesh:
    """A closed, connected, outward-oriented triangle mesh of genus 0.

    Make one with `load_mesh` or `Mesh.from_arrays`; both validate.

    Attributes
    ----------
    V : float64 [vertex_count, 3]
        Vertices [m].
    F : int64 [face_count, 3]
        Triangles, counter-clockwise seen from outside.
    uv : float64 [vertex_count, 2] or None
        The object's own texture coordinates, one pair a vertex (at a UV seam, one of the pairs that meet there).
    corner_uv : float64 [face_count, 3, 2] or None
        The object's own texture coordinates at every corner of every triangle: exact at seams.
    fixes : tuple of str
        What was mended on the way in, one phrase each.
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
        F : [face_count, 3]
            Triangles in any winding.
        uv : [vertex_count, 2], optional
            Texture coordinates of the vertices as given (before merging).
        name : str
            What to call the mesh in error messages.

        Raises
        ------
        MeshError
            If the surface is not finite, not closed, not manifold, not orientable, in several parts, of genus > 0, or
            degenerate.
        """
        V = np.asarray(V, dtype=np.float64)
        F = np.asarray(F, dtype=np.int64)
        _check_arrays(V, F, name)
        corner_uv = None if uv is None else np.asarray(uv, dtype=np.float64)[F]
        fixes: list[str] = []
        V, F, keep = _merge(V, F, fixes)
        corner_uv = None if corner_uv is None else corner_uv[keep]
        _check_topology(V, F, name)
        F, corner_uv = _orient(V, F, corner_uv, fixes, name)
        vertex_uv = None
        if corner_uv is not None:
            vertex_uv = np.zeros((len(V), 2))
            vertex_uv[F[::-1].ravel()] = corner_uv[::-1].reshape(-1, 2)
        return cls(V, F, vertex_uv, corner_uv, tuple(fixes))

    @functools.cached_property
    def face_areas(self) -> NDArray[np.float64]:
        """Triangle areas [m^2], shape [face_count]."""
        return _double_area_vectors(self.V, self.F)[1] / 2

    @property
    def area(self) -> float:
        """Surface area [m^2]."""
        return float(self.face_areas.sum())

    @property
    def volume(self) -> float:
        """Enclosed volume [m^3]."""
        return _signed_volume(self.V, self.F)

    @functools.cached_property
    def vertex_normals(self) -> NDArray[np.float64]:
        """Unit normals weighted by corner angle, shape [vertex_count, 3] (Thuermer and Wuethrich 1998)."""
        corners = self.V[self.F]
        face_normals = _double_area_vectors(self.V, self.F)[0]
        length = np.linalg.norm(face_normals, axis=1, keepdims=True)
        face_normals = face_normals / np.where(length > 0, length, 1)
        normals = np.zeros_like(self.V)
        for k in range(3):
            a, b = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
            angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
            for axis in range(3):
                normals[:, axis] += np.bincount(
                    self.F[:, k], weights=angle * face_normals[:, axis], minlength=len(self.V)
                )
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.where(length > 0, normals / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])


def load_mesh(path: str | Path) -> Mesh:
    """Read a mesh file in any format that trimesh reads (OBJ, PLY, STL, OFF, GLB, ...).

    Raises
    ------
    MeshError
        If the file is missing, cannot be read, or is not a closed genus-0 surface (see `Mesh.from_arrays`).
    """
    path = Path(path)
    if not path.is_file():
        raise MeshError(f"mesh file {str(path)!r} does not exist; give the path of an OBJ, PLY, STL, OFF or GLB file")
    try:
        loaded = trimesh.load_scene(path, process=False).to_mesh()
    except Exception as error:  # trimesh raises whatever its parsers raise
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise MeshError(f"mesh file {str(path)!r} cannot be read: {reason}") from error
    if len(getattr(loaded, "faces", ())) == 0:
        raise MeshError(f"mesh file {str(path)!r} holds no triangles")
    uv = getattr(loaded.visual, "uv", None)
    if uv is not None and np.shape(uv) != (len(loaded.vertices), 2):
        uv = None
    return Mesh.from_arrays(loaded.vertices, loaded.faces, uv, name=path.name)


def _check_arrays(V: NDArray, F: NDArray, name: str) -> None:
    if V.ndim != 2 or V.shape[1] != 3 or F.ndim != 2 or F.shape[1] != 3 or len(F) == 0:
        raise MeshError(f"{name}: V must be [n, 3] and F [m, 3] with m > 0, got {V.shape} and {F.shape}")
    if F.min() < 0 or F.max() >= len(V):
        raise MeshError(f"{name}: triangle indices run from {F.min()} to {F.max()}, valid is 0 to {len(V) - 1}")
    bad = ~np.isfinite(V).all(axis=1)
    if bad.any():
        raise MeshError(f"{name}: {bad.sum()} vertices are NaN or infinite (the first is vertex {np.argmax(bad)})")


def _merge(V: NDArray, F: NDArray, fixes: list[str]) -> tuple[NDArray, NDArray, NDArray]:
    """Merge equal positions; drop collapsed and repeated triangles and unused vertices. Also which faces were kept."""
    used = np.zeros(len(V), dtype=bool)
    used[F] = True
    # + 0.0 turns -0.0 into 0.0, which are the same place
    _, first, inverse = np.unique(V[used] + 0.0, axis=0, return_index=True, return_inverse=True)
    # keep the order of first appearance, so that a clean file comes through unchanged
    order = np.argsort(first, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    new_index = np.full(len(V), -1)
    new_index[used] = rank[inverse.reshape(-1)]
    if (~used).any():
        fixes.append(f"{(~used).sum()} unreferenced vertices dropped")
    if len(order) < used.sum():
        fixes.append(f"{used.sum() - len(order)} duplicate vertices merged")
    V, F = V[used][np.sort(first)], new_index[F]
    keep = (F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 2] != F[:, 0])
    if not keep.all():
        fixes.append(f"{(~keep).sum()} triangles with a repeated vertex dropped")
    _, unique = np.unique(np.sort(F, axis=1), axis=0, return_index=True)
    repeated = np.ones(len(F), dtype=bool)
    repeated[unique] = False
    repeated &= keep
    if repeated.any():
        fixes.append(f"{repeated.sum()} repeated triangles dropped")
    keep &= ~repeated
    F = F[keep]
    referenced = np.zeros(len(V), dtype=bool)
    referenced[F] = True
    if not referenced.all():
        V, F = V[referenced], (np.cumsum(referenced) - 1)[F]
    return V, F, keep


def _check_topology(V: NDArray, F: NDArray, name: str) -> None:
    if len(F) < 4:
        raise MeshError(f"{name}: only {len(F)} triangles are left; a closed surface has at least 4")
    defects = []
    components, _ = igl.facet_components(F)
    edges, counts = np.unique(np.sort(F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True)
    if components > 1:
        defects.append(f"in {components} separate parts (valid is one; keep the part you want, or join them)")
    if (counts > 2).any():
        where = V[edges[np.argmax(counts > 2)]].mean(axis=0)
        defects.append(
            f"non-manifold: {(counts > 2).sum()} edges belong to more than two triangles (one near {_place(where)})"
        )
    if (counts == 1).any():
        defects.append(f"open: {(counts == 1).sum()} boundary edges (valid is 0; close the holes)")
    if not defects:
        pinched = _pinched_vertices(F, len(V))
        if len(pinched):
            defects.append(
                f"non-manifold: {len(pinched)} vertices where the surface touches itself "
                f"(one near {_place(V[pinched[0]])})"
            )
    if not defects:
        euler = len(V) - len(edges) + len(F)
        if euler != 2:
            defects.append(f"of genus {(2 - euler) // 2} (valid is genus 0: no handles or tunnels)")
    if defects:
        raise MeshError(f"{name} is not a closed genus-0 surface: it is {', and '.join(defects)}")


def _pinched_vertices(F: NDArray, vertex_count: int) -> NDArray[np.int64]:
    """Vertices whose triangles form more than one fan, on a mesh whose edges all have two triangles."""
    # Each triangle corner is a node; corners of one vertex in two triangles that share an edge at it are linked.
    corner = np.arange(3 * len(F)).reshape(-1, 3)
    edge_ends = F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edge_corners = corner[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    swap = edge_ends[:, 0] > edge_ends[:, 1]
    edge_ends[swap], edge_corners[swap] = edge_ends[swap][:, ::-1], edge_corners[swap][:, ::-1]
    order = np.lexsort((edge_ends[:, 1], edge_ends[:, 0]))
    pairs = edge_corners[order].reshape(-1, 2, 2)
    rows, columns = pairs[:, 0].ravel(), pairs[:, 1].ravel()
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(corner.size, corner.size))
    _, fan = connected_components(graph, directed=False)
    fans = np.unique(np.stack([F.ravel(), fan], axis=1), axis=0)
    return np.flatnonzero(np.bincount(fans[:, 0], minlength=vertex_count) > 1)


def _orient(
    V: NDArray, F: NDArray, corner_uv: NDArray | None, fixes: list[str], name: str
) -> tuple[NDArray, NDArray | None]:
    oriented, _ = igl.bfs_orient(F)
    oriented = oriented.astype(np.int64)
    half_edges = oriented[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    if len(np.unique(half_edges, axis=0)) < len(half_edges):
        raise MeshError(f"{name} is not orientable (one-sided, like a Klein bottle); valid is a two-sided surface")
    volume = _signed_volume(V, oriented)
    extent = np.ptp(V, axis=0).max()
    if not abs(volume) > 1e-12 * extent**3:
        raise MeshError(f"{name} is degenerate: it encloses no volume ({volume:.3g} m^3 at a size of {extent:.3g} m)")
    flip = (oriented != F).any(axis=1)
    if volume < 0:
        flip = ~flip
    if flip.all():
        fixes.append("turned inside out (the triangles faced inwards)")
    elif flip.any():
        fixes.append(f"{flip.sum()} triangles reversed (inconsistent winding)")
    F = np.where(flip[:, None], F[:, ::-1], F)
    if corner_uv is not None:
        corner_uv = np.where(flip[:, None, None], corner_uv[:, ::-1], corner_uv)
    return F, corner_uv


def _double_area_vectors(V: NDArray, F: NDArray) -> tuple[NDArray, NDArray]:
    vectors = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    return vectors, np.linalg.norm(vectors, axis=1)


def _signed_volume(V: NDArray, F: NDArray) -> float:
    a, b, c = (V[F[:, k]] - V.mean(axis=0) for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def _place(point: NDArray) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"
