"""Barycentric coordinates of points in triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


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
