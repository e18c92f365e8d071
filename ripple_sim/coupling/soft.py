"""Soft targets: flexes and skins, whose surfaces move in the world.

Their target ids are in `ids`. A `SoftSurface` is the mesh and where it is.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ripple_sim.errors import SceneError
from ripple_sim.solver import Mesh

from .ids import (
    GeomId,
    TargetId,
    flex_of,
    geom_id,
    is_geom,
    skin_of,
    target_of_flex,
    target_of_skin,
)

# Vertices that are nearer than this share of the surface's size are at one place.
_SAME_PLACE = 1e-6


def target_pose(
    data: mujoco.MjData, target: TargetId
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Position [3] [m] and rotation [3, 3] of a target's frame in the world, as copies.

    The frame of a flex or a skin is the world.
    """
    if is_geom(target, data.model):
        return data.geom_xpos[target].copy(), data.geom_xmat[target].reshape(3, 3).copy()
    return np.zeros(3), np.eye(3)


def find_soft(model: mujoco.MjModel, name: object) -> TargetId | None:
    """Target id of the flex or skin of a name, if there is one."""
    if not isinstance(name, str) or not name:
        return None
    flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, name)
    if flex >= 0:
        return target_of_flex(model, flex)
    skin = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SKIN, name)
    return target_of_skin(model, skin) if skin >= 0 else None


def soft_name(model: mujoco.MjModel, target: TargetId) -> str:
    """Name of a flex or a skin, see `soft_names`."""
    return soft_names(model)[target - target_of_flex(model, 0)]


def soft_names(model: mujoco.MjModel) -> list[str]:
    """Names of all flexes, then of all skins; without one "flex <id>", "skin <id>"."""
    flex = mujoco.mjtObj.mjOBJ_FLEX
    skin = mujoco.mjtObj.mjOBJ_SKIN
    flexes = [mujoco.mj_id2name(model, flex, i) or f"flex {i}" for i in range(model.nflex)]
    return flexes + [mujoco.mj_id2name(model, skin, i) or f"skin {i}" for i in range(model.nskin)]


class SoftSurface:
    """A flex's outer surface, a cloth's sheet, or a skin.

    Parameters
    ----------
    model : mujoco.MjModel
    target : TargetId
        See `find_soft`.

    Attributes
    ----------
    mesh : Mesh
        At the model's initial pose, in the world [m].
    geoms : list of GeomId
        Geoms of the bodies under a skin, whose contacts are the skin's; none for a flex.
    flex : FlexId
        -1 for a skin.
    """

    def __init__(self, model: mujoco.MjModel, target: TargetId) -> None:
        self._model = model
        self.flex = flex_of(model, target)
        self._skin = skin_of(model, target)
        if self.flex >= 0:
            F = self._flex_triangles(soft_name(model, target))
        else:
            first = int(model.skin_boneadr[self._skin])
            self._bones = slice(first, first + int(model.skin_bonenum[self._skin]))
            first = model.skin_faceadr[self._skin]
            F = model.skin_face[first : first + model.skin_facenum[self._skin]]
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_flex(model, data)
        V = self._model_vertices(data)
        self.mesh = Mesh.from_arrays(V, F, name=f"surface of {soft_name(model, target)!r}")
        # the mesh has merged vertices that lie at one place
        distance, self._vertices = cKDTree(V).query(self.mesh.V)
        if distance.max() > _SAME_PLACE * np.ptp(V, axis=0).max():
            raise SceneError(
                f"the surface of {soft_name(model, target)!r} is not that of its vertices"
            )
        self.geoms: list[GeomId] = []
        if self._skin >= 0:
            geoms = np.flatnonzero(np.isin(model.geom_bodyid, self.bodies))
            self.geoms = [geom_id(geom) for geom in geoms.tolist()]

    def _flex_triangles(self, name: str) -> NDArray[np.int32]:
        """Triangles of a flex, [m, 3]: its own triangles, or the outside of its tetrahedra."""
        model = self._model
        flex = self.flex
        if model.flex_dim[flex] == 1:
            raise SceneError(
                f"flex {name!r} is a cable, which cannot ripple: a target must be a surface or "
                "a solid (dim 2 or 3)"
            )
        if model.flex_dim[flex] == 3:
            first = model.flex_shelldataadr[flex]
            count = model.flex_shellnum[flex]
            return model.flex_shell[first : first + 3 * count].reshape(-1, 3)
        first = model.flex_elemdataadr[flex]
        count = model.flex_elemnum[flex]
        return model.flex_elem[first : first + 3 * count].reshape(-1, 3)

    def vertices(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Where the vertices of the mesh are in the world [m], [n, 3]."""
        return self._model_vertices(data)[self._vertices]

    @property
    def bodies(self) -> NDArray[np.int64]:
        """Bodies that carry the surface."""
        model = self._model
        if self._skin >= 0:
            return np.unique(model.skin_bonebodyid[self._bones]).astype(np.int64)
        first = model.flex_vertadr[self.flex]
        count = model.flex_vertnum[self.flex]
        bodies = model.flex_vertbodyid[first : first + count]
        if model.flex_interp[self.flex]:
            first_node = model.flex_nodeadr[self.flex]
            node_count = model.flex_nodenum[self.flex]
            bodies = model.flex_nodebodyid[first_node : first_node + node_count]
        return np.unique(bodies[bodies >= 0]).astype(np.int64)

    @property
    def degree(self) -> int:
        """Degree of the polynomials that interpolate a flex between its nodes: 1 or 2.

        It is 0 for a skin, and for a flex whose vertices move by themselves.
        """
        return 0 if self._skin >= 0 else int(self._model.flex_interp[self.flex])

    def _model_vertices(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Where the vertices of the flex or skin in the model are in the world [m].

        Several of them may be at one place.
        """
        model = self._model
        if self._skin >= 0:
            return self._skin_vertices(data)
        first = model.flex_vertadr[self.flex]
        count = model.flex_vertnum[self.flex]
        return np.array(data.flexvert_xpos[first : first + count], dtype=np.float64)

    def _skin_vertices(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Where the bones of the skin take its vertices, as weighted means [m]."""
        model = self._model
        first = model.skin_vertadr[self._skin]
        count = model.skin_vertnum[self._skin]
        V = model.skin_vert[first : first + count].astype(np.float64)
        moved = np.zeros_like(V)
        rotation = np.zeros(9)
        quaternion = np.zeros(4)
        inverse_bind = np.zeros(4)
        for bone in range(self._bones.start, self._bones.stop):
            body = model.skin_bonebodyid[bone]
            mujoco.mju_negQuat(inverse_bind, model.skin_bonebindquat[bone].astype(np.float64))
            mujoco.mju_mulQuat(quaternion, data.xquat[body], inverse_bind)
            mujoco.mju_quat2Mat(rotation, quaternion)
            begin = model.skin_bonevertadr[bone]
            rows = slice(begin, begin + model.skin_bonevertnum[bone])
            vertices = model.skin_bonevertid[rows]
            weights = model.skin_bonevertweight[rows, None]
            on_bone = V[vertices] - model.skin_bonebindpos[bone]
            in_world = on_bone @ rotation.reshape(3, 3).T + data.xpos[body]
            np.add.at(moved, vertices, weights * in_world)
        return moved
