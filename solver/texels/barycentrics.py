"""Barycentric coordinates of points in triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, kernel


def barycentrics_in(corners: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Barycentric coordinates [k, 3], not negative, of points [k, 3] in triangles [k, 3, 3]."""
    u, v, p = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    uu, uv, vv, pu, pv = (np.einsum("ij,ij->i", a, b) for a, b in ((u, u), (u, v), (v, v), (p, u), (p, v)))
    area = uu * vv - uv * uv
    # a triangle without area has no barycentrics: its middle is as good as any point of it
    flat = area <= 0
    scale = np.where(flat, 1.0, area)
    s = np.where(flat, 1 / 3, np.clip((vv * pu - uv * pv) / scale, 0.0, 1.0))
    t = np.where(flat, 1 / 3, np.clip((uu * pv - uv * pu) / scale, 0.0, 1.0 - s))
    return np.stack([1 - s - t, s, t], axis=1)


@kernel
def barycentrics_at(corners: Floats, x: float, y: float, z: float) -> tuple[float, float]:
    """The second and third barycentric coordinate of a point in a triangle [3, 3], as in `barycentrics_in`."""
    point = (x, y, z)
    uu = uv = vv = pu = pv = 0.0
    for k in range(3):
        u, v, p = corners[1, k] - corners[0, k], corners[2, k] - corners[0, k], point[k] - corners[0, k]
        uu, uv, vv, pu, pv = uu + u * u, uv + u * v, vv + v * v, pu + p * u, pv + p * v
    area = uu * vv - uv * uv
    if not area > 0:
        return 1 / 3, 1 / 3
    s = min(max((vv * pu - uv * pv) / area, 0.0), 1.0)
    return s, min(max((uu * pv - uv * pu) / area, 0.0), 1.0 - s)
