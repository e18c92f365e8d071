"""All contacts on all targets, with geoms and with flex colliders."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from ripple_sim.coupling.model.coupled_model import CoupledModel
from ripple_sim.solver import Mesh

from .flex_contacts import FlexContacts
from .geom_contacts import geom_contacts
from .target_contacts import TargetContacts


class ContactReader:
    """Reads the contacts on each target from MuJoCo's data.

    Parameters
    ----------
    coupled : CoupledModel
    meshes : mapping
        Geom id of every target to its surface, in the geom's frame [m].
    """

    def __init__(self, coupled: CoupledModel, meshes: Mapping[int, Mesh]) -> None:
        self._coupled = coupled
        self._is_target = np.zeros(coupled.model.ngeom, dtype=np.bool_)
        self._is_target[list(meshes)] = True
        self._flexes = None
        if coupled.flex_colliders:
            self._flexes = FlexContacts(coupled, meshes)
            self._is_target[self._flexes.targets] = False

    def read(self, data: mujoco.MjData) -> dict[int, TargetContacts]:
        """Contacts of each target that is touched, by geom id."""
        model, extents = self._coupled.model, self._coupled.extents
        if self._flexes is None:
            return geom_contacts(model, data, self._is_target, extents)
        geoms = self._flexes.geoms(data)
        contacts = geom_contacts(model, data, self._is_target, extents, geoms)
        return contacts | self._flexes.contacts(data, geoms, extents)
