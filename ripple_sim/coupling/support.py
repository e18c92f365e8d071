"""Support points: the point of a convex geom that lies farthest in a direction."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

_GEOM = mujoco.mjtGeom

# A side or an edge whose slope against the plane is less than this counts as flat: its middle is the point.
_FLAT = 0.02


def support_point(model: mujoco.MjModel, geom: int, direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Point [m], shape [3], of a geom that lies farthest in a direction: the middle of a side where a whole side does.

    Parameters
    ----------
    model : mujoco.MjModel
    geom : int
        A sphere, ellipsoid, capsule, cylinder or box; of a mesh or sdf geom the convex hull counts.
    direction : float64 [3]
        Unit vector in the frame of the geom, as is the result.
    """
    size = model.geom_size[geom]
    match model.geom_type[geom]:
        case _GEOM.mjGEOM_SPHERE:
            return size[0] * direction
        case _GEOM.mjGEOM_ELLIPSOID:
            return size**2 * direction / np.linalg.norm(size * direction)
        case _GEOM.mjGEOM_CAPSULE:
            return size[0] * direction + [0.0, 0.0, size[1] * _side(direction[2])]
        case _GEOM.mjGEOM_CYLINDER:
            across = float(np.hypot(direction[0], direction[1]))
            rim = size[0] * direction[:2] / across if across > _FLAT else np.zeros(2)
            return np.append(rim, size[1] * _side(direction[2]))
        case _GEOM.mjGEOM_BOX:
            return size * [_side(along) for along in direction]
    mesh = int(model.geom_dataid[geom])
    begin, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[begin : begin + count]
    heights = vertices @ direction
    return vertices[heights > heights.max() - _FLAT * model.geom_rbound[geom]].mean(axis=0).astype(np.float64)


def _side(along: float) -> float:
    return 0.0 if abs(along) < _FLAT else float(np.sign(along))
