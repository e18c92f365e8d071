"""Bodies that a moving surface reaches while MuJoCo, which knows the undeformed surface alone, sees them apart."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.colliders.tunnelling import can_collide
from ripple_sim.coupling.contacts.geom_contacts import smallest_extents
from ripple_sim.coupling.load.sources import FOOTPRINT, Touch
from ripple_sim.solver import Load, WaveSolver
from ripple_sim.solver.waves.footprint import footprint

from .support import support_point

_ROUNDS = 3  # of the search for the points of surface and body that are nearest to each other
_BODIES = tuple(
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}"))
    for name in ("SPHERE", "ELLIPSOID", "CAPSULE", "CYLINDER", "BOX", "MESH", "SDF")
)


class Hovering:
    """Finds what hovers over targets lower than their waves are high.

    A body is reached where its lowest point is less above the undeformed surface than the surface has risen there. That
    point is found by turns: the point of the surface nearest to the body's, and the body's point deepest along the
    normal there.

    Parameters
    ----------
    model : mujoco.MjModel
    targets : iterable of int
        Geom ids.
    """

    def __init__(self, model: mujoco.MjModel, targets: Iterable[int]) -> None:
        self._model = model
        self._radii = FOOTPRINT * smallest_extents(model)
        bodies = (model.body_weldid[model.geom_bodyid] > 0) & np.isin(model.geom_type, _BODIES)
        self._others = {target: np.flatnonzero(bodies & can_collide(model, target)).tolist() for target in targets}

    def reached(
        self, data: mujoco.MjData, waves: Mapping[int, WaveSolver], touching: Collection[tuple[int, int]]
    ) -> Iterator[Touch]:
        """Find the bodies that the surfaces have reached, but for the pairs (target, other) that touch already.

        Their loads are unit forces on the footprints.
        """
        for target, others in self._others.items():
            height = waves[target].height.reshape(-1)
            highest = float(height.max())
            for other in others:
                if highest > 0 and (target, other) not in touching:
                    touch = self._meet(data, target, other, waves[target], height, highest)
                    if touch is not None:
                        yield touch

    def _meet(
        self,
        data: mujoco.MjData,
        target: int,
        other: int,
        waves: WaveSolver,
        height: NDArray[np.float32],
        highest: float,
    ) -> Touch | None:
        model, atlas = self._model, waves.atlas
        rotation = data.geom_xmat[target].reshape(3, 3)
        to_target = rotation.T @ data.geom_xmat[other].reshape(3, 3)
        centre = (data.geom_xpos[other] - data.geom_xpos[target]) @ rotation
        reach = float(model.geom_rbound[other]) + highest
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
        if (point - place) @ normal >= height[texel]:
            return None
        where = footprint(atlas, place, min(self._radii[target], self._radii[other]))
        carried = atlas.areas.reshape(-1)[where.texels] * waves.operator.movable.reshape(-1)[where.texels]
        in_world = data.geom_xpos[target] + rotation @ place
        return Touch(target, other, in_world, rotation @ normal, Load(where.texels, where.weights * carried))
