"""From a triangle and a point on it to the sphere and to the nearest texel, compiled: contacts ask at every step."""

from __future__ import annotations

import numba
import numpy as np

from .cubemap import FACE_U, FACE_V


@numba.njit(cache=True)
def sphere_directions(V, F, sphere, triangles, points):
    """Unit vectors, [k, 3], of points that lie on triangles: where linear interpolation of the sphere map puts them."""
    found = np.empty((len(points), 3))
    for i in range(len(points)):
        a, b, c = F[triangles[i], 0], F[triangles[i], 1], F[triangles[i], 2]
        u, v, p = V[b] - V[a], V[c] - V[a], points[i] - V[a]
        uu, uv, vv, pu, pv = (u * u).sum(), (u * v).sum(), (v * v).sum(), (p * u).sum(), (p * v).sum()
        area = uu * vv - uv * uv
        # a triangle without area has no barycentrics: its corners are as good as any point of it
        s = min(max((vv * pu - uv * pv) / area, 0.0), 1.0) if area > 0 else 1 / 3
        t = min(max((uu * pv - uv * pu) / area, 0.0), 1.0 - s) if area > 0 else 1 / 3
        d = (1 - s - t) * sphere[a] + s * sphere[b] + t * sphere[c]
        found[i] = d / np.sqrt((d * d).sum())
    return found


@numba.njit(cache=True)
def texels_at(directions, n):
    """Flat index (face N + row) N + column of the texel in which each direction lies; see `face_coordinates`."""
    found = np.empty(len(directions), np.int64)
    for i in range(len(directions)):
        d = directions[i]
        axis = np.argmax(np.abs(d))
        face = 2 * axis + (1 if d[axis] < 0 else 0)
        place = 0
        for along in (FACE_V, FACE_U):
            angle = np.arctan((d * along[face]).sum() / abs(d[axis])) * (4 / np.pi)
            place = place * n + min(max(int(np.rint(((angle + 1) * n - 1) / 2)), 0), n - 1)
        found[i] = face * n * n + place
    return found
