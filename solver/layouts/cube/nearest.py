"""From a triangle and a point on it to the sphere and to the nearest texel, compiled: contacts ask at every step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Floats, Ints, kernel, variant
from ...texels.nearest import nearest_place, texel_on
from .convention import CHART_U, CHART_V


@kernel
def sphere_directions(V: Floats, F: Ints, sphere: Floats, triangles: Ints, points: Floats) -> Floats:
    """Unit vectors, [k, 3], of points that lie on triangles: where linear interpolation of the sphere map puts them."""
    found = np.empty((len(points), 3))
    for i in range(len(points)):
        found[i, 0], found[i, 1], found[i, 2] = _direction(V, F, sphere, triangles[i], points[i])
    return found


class SphereCharts(NamedTuple):
    """A mesh and its sphere map on the six charts; see `CubeChartMap`."""

    V: Floats
    F: Ints
    sphere: Floats
    resolution: int


class Ball(NamedTuple):
    """A sphere round the origin [m], whose sphere map is itself."""

    radius: float
    resolution: int


@variant(texel_on, SphereCharts)
def _texel_on_sphere_map(charts: SphereCharts, triangle: int, x: float, y: float, z: float) -> int:
    u, v, w = _direction(charts.V, charts.F, charts.sphere, triangle, (x, y, z))
    return texel_at(u, v, w, charts.resolution)


@variant(nearest_place, Ball)
def _nearest_on_ball(surface: Ball, x: float, y: float, z: float) -> tuple[float, float, float, int]:
    length = np.sqrt(x * x + y * y + z * z)
    if length > 0:
        x, y, z = x / length, y / length, z / length
    else:
        x, y, z = 0.0, 0.0, 1.0  # all are as near
    texel = texel_at(x, y, z, surface.resolution)
    return surface.radius * x, surface.radius * y, surface.radius * z, texel


@kernel
def _direction(V: Floats, F: Ints, sphere: Floats, triangle: int, point: Floats) -> tuple[float, float, float]:
    """Unit vector of a point [3] that lies on a triangle."""
    a, b, c = F[triangle, 0], F[triangle, 1], F[triangle, 2]
    uu = uv = vv = pu = pv = 0.0
    for k in range(3):
        u, v, p = V[b, k] - V[a, k], V[c, k] - V[a, k], point[k] - V[a, k]
        uu, uv, vv, pu, pv = uu + u * u, uv + u * v, vv + v * v, pu + p * u, pv + p * v
    area = uu * vv - uv * uv
    # a triangle without area has no barycentrics: its corners are as good as any point of it
    s = min(max((vv * pu - uv * pv) / area, 0.0), 1.0) if area > 0 else 1 / 3
    t = min(max((uu * pv - uv * pu) / area, 0.0), 1.0 - s) if area > 0 else 1 / 3
    x, y, z = _mean(sphere, 0, a, b, c, s, t), _mean(sphere, 1, a, b, c, s, t), _mean(sphere, 2, a, b, c, s, t)
    length = np.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@kernel
def _mean(sphere: Floats, k: int, a: int, b: int, c: int, s: float, t: float) -> float:
    """Coordinate k of the sphere map at barycentric coordinates 1 - s - t, s, t of the vertices a, b, c."""
    return (1 - s - t) * sphere[a, k] + s * sphere[b, k] + t * sphere[c, k]


@kernel
def texel_at(x: float, y: float, z: float, n: int) -> int:
    """Flat index (chart N + row) N + column of the texel in which a direction lies; see `cube_chart_points`."""
    direction, axis = (x, y, z), 0
    for k in range(1, 3):
        if abs(direction[k]) > abs(direction[axis]):
            axis = k
    chart = 2 * axis + (1 if direction[axis] < 0 else 0)
    place = 0
    for along in (CHART_V, CHART_U):
        across = 0.0
        for k in range(3):
            across += direction[k] * along[chart, k]
        angle = np.arctan(across / abs(direction[axis])) * (4 / np.pi)
        place = place * n + min(max(int(np.rint(((angle + 1) * n - 1) / 2)), 0), n - 1)
    return chart * n * n + place
