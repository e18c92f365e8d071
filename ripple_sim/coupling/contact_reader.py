"""All contacts on all targets, with geoms, flexes and collision geoms."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from ripple_sim.solver import Atlas

from .adhesion import Adhesion
from .collider_ids import ColliderIds
from .collision_contacts import CollisionContacts
from .contacts import TargetContacts
from .flex_contacts import FlexContacts
from .geom_contacts import geom_contacts
from .model import CoupledModel
from .solver_balance import SolverBalance
from .target_mesh import target_mesh


class ContactReader:
    """Reads the contacts on each target from MuJoCo's data.

    Parameters
    ----------
    coupled : CoupledModel
    atlases : mapping
        Geom id of every target to its atlas, in the geom's frame [m].
    """

    def __init__(self, coupled: CoupledModel, atlases: Mapping[int, Atlas]) -> None:
        self._coupled = coupled
        rigid = {target: atlas for target, atlas in atlases.items() if target not in coupled.soft}
        self._collision_contacts = CollisionContacts(coupled, rigid)
        meshes = {target: atlas.mesh for target, atlas in rigid.items()}
        for geom in coupled.flex_colliders.keys() & self._collision_contacts.geoms:
            meshes[geom] = target_mesh(coupled.model, geom)
        self._colliders = ColliderIds(coupled)
        self._is_read = np.zeros(len(coupled.owners), dtype=np.bool_)
        self._is_read[[*meshes, *self._collision_contacts.geoms, *coupled.soft]] = True
        self._has_flex = np.zeros(len(coupled.owners), dtype=np.bool_)
        self._has_flex[list(coupled.flex_colliders)] = True
        self._adhesion = Adhesion(coupled.model)
        self._check_solver = SolverBalance(coupled)
        self._flexes = None
        if coupled.flex_colliders:
            self._flexes = FlexContacts(coupled, meshes)
            self._is_read[self._flexes.targets] = False

    def read(self, data: mujoco.MjData) -> dict[int, TargetContacts]:
        """Contacts of each target that is touched, by geom id."""
        model, extents, colliders = self._coupled.model, self._coupled.extents, self._colliders(data)
        contacts = geom_contacts(model, data, colliders, self._is_read, extents, self._adhesion(data), self._has_flex)
        if self._flexes is not None:
            contacts |= self._flexes.contacts(data, colliders, extents)
        contacts = self._collision_contacts.hand_over(data, contacts)
        self._check_solver(data, contacts)
        return contacts
