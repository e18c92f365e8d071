"""Two-way coupling: where the surface moves outwards under a body, it pushes the body, and is held back by it.

`PushBack` exchanges the momentum. `Reach` finds geoms that a risen surface touches though MuJoCo, which knows the
undeformed one alone, sees them apart: by the point of a geom that lies farthest in a direction (`support_point`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

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
            for other in others if height.max() > 0 else ():
                if (target, other) not in touching:
                    touch = self._touch(data, target, other, waves[target], height)
                    if touch is not None:
                        yield touch

    def _touch(
        self, data: mujoco.MjData, target: int, other: int, waves: WaveSolver, height: NDArray[np.float32]
    ) -> Touch | None:
        """The touch of a target, whose waves have a height [m], [C n n], with another geom; None out of reach."""
        model, atlas = self._coupled.model, waves.atlas
        rotation = data.geom_xmat[target].reshape(3, 3)
        to_target = rotation.T @ data.geom_xmat[other].reshape(3, 3)
        centre = (data.geom_xpos[other] - data.geom_xpos[target]) @ rotation
        reach = float(model.geom_rbound[other] + height.max())
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
        radii = self._coupled.footprint_radii
        where = footprint(atlas, place, min(radii[target], radii[other]))
        movable = waves.operator.movable.reshape(-1)[where.texels]
        movable_area = atlas.areas.reshape(-1)[where.texels] * movable
        in_world = data.geom_xpos[target] + rotation @ place
        return Touch(target, other, in_world, rotation @ normal, Load(where.texels, where.weights * movable_area))


class PushBack:
    """Exchanges momentum between moving surfaces and the bodies that touch them.

    MuJoCo sees a target's undeformed surface, which stops what comes in. So only the surface's own outward motion is
    left to pass on, to bodies that touch that surface or are within reach of the displaced one: a patch of mass m_s
    that moves outwards at u meets a body of effective mass m_b that moves along the normal at w >= 0, both relative to
    the target. As in a perfectly inelastic collision, which cannot create energy, they exchange
    J = (u - w) m_s m_b / (m_s + m_b) if u > w: +J on the body, -J on the surface and on the target's body.

    The bodies receive J at once, as a change of `data.qvel`: forces in `data` are the user's, and none is left there.

    Parameters
    ----------
    coupled : CoupledModel
    targets : iterable of int
        Geom ids.
    """

    def __init__(self, coupled: CoupledModel, targets: Iterable[int]) -> None:
        self._model, self._bodies = coupled.model, coupled.bodies
        self._reach = Reach(coupled, targets)

    def exchange(
        self, data: mujoco.MjData, touches: Sequence[Touch], waves: Mapping[int, WaveSolver], elapsed: float
    ) -> list[tuple[int, Load]]:
        """Push the bodies, and return the loads that push the targets, by geom id, over the elapsed time [s].

        Parameters
        ----------
        data : mujoco.MjData
        touches : sequence of Touch
            The pairs that touch.
        waves : mapping
            Waves of each target before the step, by geom id.
        elapsed : float
        """
        pairs = {(touch.target, touch.other) for touch in touches}
        touches = [*touches, *self._reach.reached(data, waves, pairs)]
        velocities = {touch.target: waves[touch.target].velocity.reshape(-1) for touch in touches}
        loads = []
        for touch in touches:
            mass, velocity = waves[touch.target].operator.mass.reshape(-1), velocities[touch.target]
            load = touch.load.merged(mass.size)
            total = load.forces.sum()
            if total <= 0:
                continue  # nothing is movable under it
            texels, shares = load.texels, load.forces / total
            patch_mass, outward = 1 / float((shares**2 / mass[texels]).sum()), float(shares @ velocity[texels])
            impulse = self._push(data, touch, patch_mass, outward)
            if impulse:
                velocity[texels] -= impulse * shares / mass[texels]  # what the next touch meets
                loads.append((touch.target, Load(texels, impulse * shares / elapsed)))
        return loads

    def _push(self, data: mujoco.MjData, touch: Touch, patch_mass: float, outward: float) -> float:
        """Push the bodies with the impulse that they exchange with the patch under a touch, and return it [N s].

        Parameters
        ----------
        data : mujoco.MjData
        touch : Touch
        patch_mass, outward : float
            Mass [kg] and outward velocity [m/s] of the patch.
        """
        if outward <= 0 or self._bodies[touch.other] < 0:
            return 0.0
        model, point = self._model, touch.point
        body, base = int(self._bodies[touch.other]), int(self._bodies[touch.target])
        along = touch.normal @ (_jacobian(model, data, body, point) - _jacobian(model, data, base, point))
        response = np.zeros((1, model.nv))
        mujoco.mj_solveM(model, data, response, along[None])
        inverse_mass = float(along @ response[0])
        approach = outward - max(0.0, float(along @ data.qvel))
        if inverse_mass <= 0 or approach <= 0:
            return 0.0
        impulse = approach / (1 / patch_mass + inverse_mass)
        data.qvel += impulse * response[0]
        return impulse


def _jacobian(model: mujoco.MjModel, data: mujoco.MjData, body: int, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Velocity of a body's point over qvel, [3, nv]."""
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, point, body)
    return jacobian
