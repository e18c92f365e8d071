"""Geoms within reach of a risen surface, which MuJoCo, knowing the undeformed surface alone, sees apart from it.

Support points: the point of a convex geom that lies farthest in a direction.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Load, WaveSolver
from ripple_sim.solver.waves.footprint import footprint

from .load import Touch
from .model import CoupledModel

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


_ROUNDS = 3  # of the search for the points of surface and geom that are nearest to each other
_SOLID = tuple(
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}"))
    for name in ("SPHERE", "ELLIPSOID", "CAPSULE", "CYLINDER", "BOX", "MESH", "SDF")
)


class _Surface(NamedTuple):
    """A target's waves, their height [m], [C n n], and its maximum."""

    target: int
    waves: WaveSolver
    height: NDArray[np.float32]
    highest: float


class Reach:
    """Finds geoms above targets, lower than their waves are high.

    A geom is within reach where its lowest point is less above the undeformed surface than the surface has risen there.
    That point is found by turns: the surface point nearest to the geom's point, and the geom's point deepest along the
    normal there.

    Parameters
    ----------
    coupled : CoupledModel
    targets : iterable of int
        Geom ids.
    """

    def __init__(self, coupled: CoupledModel, targets: Iterable[int]) -> None:
        self._coupled, model = coupled, coupled.model
        moving = (model.body_weldid[model.geom_bodyid] > 0) & np.isin(model.geom_type, _SOLID)
        self._others = {target: np.flatnonzero(moving & coupled.can_collide(target)).tolist() for target in targets}

    def reached(
        self, data: mujoco.MjData, waves: Mapping[int, WaveSolver], touching: Collection[tuple[int, int]]
    ) -> Iterator[Touch]:
        """Find the geoms within reach, but for the pairs (target, other) that touch already.

        Their loads are unit forces on the footprints.
        """
        for target, others in self._others.items():
            height = waves[target].height.reshape(-1)
            surface = _Surface(target, waves[target], height, float(height.max()))
            for other in others:
                if surface.highest > 0 and (target, other) not in touching:
                    touch = self._touch(data, surface, other)
                    if touch is not None:
                        yield touch

    def _touch(self, data: mujoco.MjData, surface: _Surface, other: int) -> Touch | None:
        model, target, atlas = self._coupled.model, surface.target, surface.waves.atlas
        rotation = data.geom_xmat[target].reshape(3, 3)
        to_target = rotation.T @ data.geom_xmat[other].reshape(3, 3)
        centre = (data.geom_xpos[other] - data.geom_xpos[target]) @ rotation
        reach = float(model.geom_rbound[other]) + surface.highest
        box_centre, box_size = model.geom_aabb[target, :3], model.geom_aabb[target, 3:]
        if np.linalg.norm(np.maximum(np.abs(centre - box_centre) - box_size, 0.0)) > reach:
            return None
        point = centre
        for _ in range(_ROUNDS):
            (place,), (texel,) = atlas.nearest(point)
            if np.linalg.norm(point - place) > reach:
                return None
            normal = atlas.normals.reshape(-1, 3)[texel]
            point = centre + to_target @ support_point(model, other, -normal @ to_target)
        if (point - place) @ normal >= surface.height[texel]:
            return None
        radii = self._coupled.footprint_radii
        where = footprint(atlas, place, min(radii[target], radii[other]))
        movable = surface.waves.operator.movable.reshape(-1)[where.texels]
        movable_area = atlas.areas.reshape(-1)[where.texels] * movable
        in_world = data.geom_xpos[target] + rotation @ place
        return Touch(target, other, in_world, rotation @ normal, Load(where.texels, where.weights * movable_area))
