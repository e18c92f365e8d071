"""`MovedMesh`: a mesh with moved vertices."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from .mesh import Mesh


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class MovedMesh(Mesh):
    """A mesh whose vertices have moved from their places at rest.

    Properties that depend on the triangles alone come from the mesh at rest, which computes them
    once.

    Attributes
    ----------
    rest : Mesh
    moved_normals : float64 [vertex_count, 3]
        Unit normals at the moved vertices.
    """

    rest: Mesh
    moved_normals: NDArray[np.float64]

    @classmethod
    def of(cls, rest: Mesh, V: NDArray[np.float64], normals: NDArray[np.float64]) -> MovedMesh:
        """A mesh at rest with its vertices at V [m] and these unit normals, [vertex_count, 3]."""
        return cls(
            V=V,
            F=rest.F,
            uv=rest.uv,
            corner_uv=rest.corner_uv,
            notes=rest.notes,
            name=rest.name,
            rest=rest,
            moved_normals=normals,
        )

    @functools.cached_property
    def components(self) -> NDArray[np.int64]:
        """Part of each triangle, [triangle_count]."""
        return self.rest.components

    @functools.cached_property
    def beside(self) -> NDArray[np.int64]:
        """The triangle beyond each side of every triangle, [triangle_count, 3]; -1 at rims."""
        return self.rest.beside

    @functools.cached_property
    def rims(self) -> tuple[NDArray[np.int64], ...]:
        """Boundary loops."""
        return self.rest.rims

    @functools.cached_property
    def genus(self) -> NDArray[np.int64]:
        """Number of handles of every part, [component_count]."""
        return self.rest.genus

    @functools.cached_property
    def vertex_normals(self) -> NDArray[np.float64]:
        """Unit normals at the moved vertices, [vertex_count, 3]."""
        return self.moved_normals
