"""Barycentric coordinates of points in triangles."""

from __future__ import annotations

import numpy as np

from ..kernel import Floats, kernel


def barycentrics_in(corners: Floats, points: Floats) -> Floats:
    """Barycentric coordinates [k, 3], not negative, of points [k, 3] in triangles [k, 3, 3]."""
    u = corners[:, 1] - corners[:, 0]
    v = corners[:, 2] - corners[:, 0]
    p = points - corners[:, 0]
    uu = np.einsum("ij,ij->i", u, u)
    uv = np.einsum("ij,ij->i", u, v)
    vv = np.einsum("ij,ij->i", v, v)
    pu = np.einsum("ij,ij->i", p, u)
    pv = np.einsum("ij,ij->i", p, v)
    area = uu * vv - uv * uv
    # a triangle without area has no barycentrics: its middle is as good as any point of it
    flat = area <= 0
    scale = np.where(flat, 1.0, area)
    s = np.where(flat, 1 / 3, np.clip((vv * pu - uv * pv) / scale, 0.0, 1.0))
    t = np.where(flat, 1 / 3, np.clip((uu * pv - uv * pu) / scale, 0.0, 1.0 - s))
    return np.stack([1 - s - t, s, t], axis=1)


@kernel(no_cpython_wrapper=True)
def barycentrics_at(corners: Floats, point: Floats) -> tuple[float, float]:
    """The second and third barycentric coordinate of a point in a triangle [3, 3].

    Like `barycentrics_in`.
    """
    uu = uv = vv = pu = pv = 0.0
    for k in range(3):
        u = corners[1, k] - corners[0, k]
        v = corners[2, k] - corners[0, k]
        p = point[k] - corners[0, k]
        uu = uu + u * u
        uv = uv + u * v
        vv = vv + v * v
        pu = pu + p * u
        pv = pv + p * v
    area = uu * vv - uv * uv
    if not area > 0:
        return 1 / 3, 1 / 3
    s = min(max((vv * pu - uv * pv) / area, 0.0), 1.0)
    return s, min(max((uu * pv - uv * pu) / area, 0.0), 1.0 - s)
