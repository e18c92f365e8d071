"""MuJoCo's contacts with flex colliders, by target."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import RippleWarning
from ripple_sim.solver import Mesh

from .contacts import TargetContacts, contiguous
from .flex_forces import FlexNormals, MujocoFlexContacts, summed_contacts
from .geom_contacts import PYRAMIDAL
from .model import CoupledModel

# Share of the forces on a target that may be pushes sideways; old ones count less with each step.
_UNEXPLAINED, _MEMORY = 0.01, 0.99
_TINY = np.finfo(np.float64).tiny


class FlexContacts:
    """Contacts with flex colliders.

    Where the rim of a flat geom crosses a triangle, MuJoCo pushes sideways, and the friction of such contacts pushes
    along the normal. These forces cancel in pairs, but their amounts do not: they add up to many times the momentum
    exchanged. So the load of a pair is the sum of its whole forces along its mean normal. Contacts that push sideways
    count neither for that normal nor for the place of the load.

    Parameters
    ----------
    coupled : CoupledModel
    meshes : mapping
        Geom id of every target to its surface, in the geom's frame [m].

    Attributes
    ----------
    targets : list of int
        Geom ids of the targets with a flex collider, ascending.
    """

    def __init__(self, coupled: CoupledModel, meshes: Mapping[int, Mesh]) -> None:
        self._model, model, flexes = coupled.model, coupled.model, coupled.flex_colliders
        self.targets = sorted(flexes.keys() & meshes.keys())
        count = len(coupled.owners)
        self._names, self._warned, self._amounts = coupled.names, set[int](), np.zeros((count, 2))
        self._normals = FlexNormals(np.full(count, -1), np.zeros((model.nflexelem, 3)), np.zeros(count, np.bool_))
        for geom in self.targets:
            first = self._normals.first[geom] = model.flex_elemadr[flexes[geom]]
            normals = _outward_normals(model, geom, flexes[geom], meshes[geom])
            self._normals.normals[first : first + len(normals)] = normals
            self._normals.sheet[geom] = not meshes[geom].closed

    def contacts(
        self, data: mujoco.MjData, colliders: NDArray[np.int64], extents: NDArray[np.float64]
    ) -> dict[int, TargetContacts]:
        """As `geom_contacts`, for these targets."""
        if not data.ncon:
            return {}
        each = data.contact
        fields = (
            each.efc_address,
            each.dim,
            each.friction,
            each.elem,
            each.frame,
            each.pos,
            each.dist,
            each.includemargin,
            each.adhesion,
            data.efc_force,
            data.geom_xmat,
        )
        contacts = MujocoFlexContacts(*contiguous(*fields))
        pyramidal = self._model.opt.cone == PYRAMIDAL
        found, amounts = summed_contacts(colliders, contacts, self._normals, extents, pyramidal)
        self._judge(amounts)
        return found.by_target()

    def _judge(self, amounts: NDArray[np.float64]) -> None:
        """Warn, once for each, of targets whose forces are not those of a contact; see `summed_contacts`."""
        self._amounts = _MEMORY * self._amounts + amounts
        whole, unexplained = self._amounts[self.targets].T
        for i in np.flatnonzero(unexplained > _UNEXPLAINED * whole).tolist():
            target = self.targets[i]
            if target in self._warned:
                continue
            self._warned.add(target)
            name, share = self._names[target], unexplained[i] / whole[i]
            warnings.warn(
                f"the impulses on geom {name!r} are wrong by about {share:.1%}: MuJoCo pushes sideways what touches "
                "its flex, where a geom has sunk in or edges and corners meet; use a shorter time step, no override of "
                f'contact margins, or make_collidable(spec, {name!r}, "sdf")',
                RippleWarning,
                stacklevel=7,
            )


def _outward_normals(model: mujoco.MjModel, geom: int, flex: int, mesh: Mesh) -> NDArray[np.float64]:
    """Outward unit normals of a surface at the triangles of its flex, in the geom's frame, [element_count, 3]."""
    first, count = model.flex_elemdataadr[flex], model.flex_elemnum[flex]
    F, V = model.flex_elem[first : first + 3 * count].reshape(-1, 3), mesh.V
    if not np.array_equal(F, mesh.F):
        # a flex not made by `make_collidable`
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        V = model.flex_vert[model.flex_vertadr[flex] :][: model.flex_vertnum[flex]] @ rotation.reshape(3, 3)
    corners = V[F]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # they point outwards where the volume that they enclose is positive
    outward = np.sign(np.einsum("ij,ij->", normals, corners[:, 0])) if mesh.closed else 1.0
    return outward * normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _TINY)
