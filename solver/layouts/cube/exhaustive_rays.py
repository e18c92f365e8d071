"""Every ray against every triangle, as the paper does it: slow and simple, the oracle and the baseline of `rays`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def cast_rays_exhaustively(
    sphere: NDArray[np.float64], F: NDArray[np.int64], directions: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Intersect rays from the origin with all triangles (Moeller and Trumbore 1997).

    Parameters and results are those of `rays.cast_rays`. The cost is the number of rays times that of triangles. Where
    a ray meets several triangles on the edge that they share, the one in which it lies deepest is taken.
    """
    corner = sphere[F[:, 0]]
    edge1, edge2 = sphere[F[:, 1]] - corner, sphere[F[:, 2]] - corner
    to_origin = -corner
    q = np.cross(to_origin, edge1)
    triangles = np.empty(len(directions), dtype=np.int64)
    barycentrics = np.empty((len(directions), 3))
    for i, direction in enumerate(directions):
        p = np.cross(direction, edge2)
        determinant = np.einsum("ij,ij->i", edge1, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ij,ij->i", to_origin, p) / determinant
            v = q @ direction / determinant
            distance = np.einsum("ij,ij->i", edge2, q) / determinant
            inside = np.minimum(np.minimum(u, v), 1 - u - v)
        depth = np.where((distance > 0) & np.isfinite(inside), inside, -np.inf)
        hit = int(np.argmax(depth))
        triangles[i], barycentrics[i] = hit, (1 - u[hit] - v[hit], u[hit], v[hit])
    return triangles, barycentrics
