"""Normals of texels where those of the vertices say nothing."""

from __future__ import annotations

import numpy as np

from ..kernel import Floats, Ints
from ..mesh.mesh import Mesh
from ..mesh.topology import triangle_normals

# Cosine between a texel's normal and that of its triangle, at least.
_MIN_COSINE = 1e-3


def facing_out(normals: Floats, mesh: Mesh, triangles: Ints) -> Floats:
    """Normals [..., 3] of points on triangles [...], with the triangle's own where one is no use.

    The vertices of a sheet without thickness belong to both of its sides. The means of their
    triangles' normals lie in the sheet, and face out of neither side.
    """
    own = triangle_normals(mesh.V, mesh.F[triangles.ravel()]).reshape(normals.shape)
    cosine = np.einsum("...j,...j->...", normals, own)
    is_useless = (cosine < _MIN_COSINE) & own.any(axis=-1)
    return np.where(is_useless[..., None], own, normals)
