"""All contacts on all targets, with geoms, flexes and collision geoms.

How strongly contacts pull: sticky geoms, and MuJoCo's adhesion actuators, such as suckers.

What touches in MuJoCo's contacts: geoms, also by their flex or convex colliders, and vertices of soft flexes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Floats, Ints, Ints32, kernel

from .contacts import TargetContacts, contiguous, geom_contacts
from .flex_contacts import FlexContacts
from .model import CoupledModel
from .placing import CollisionContacts
from .solver_balance import SolverBalance
from .target_mesh import target_mesh

# Contacts that pull though they do not push: all right, or within the gap.
_FORCE, _GAP = 0, 1


class Adhesion:
    """Forces with which contacts pull at their geoms.

    MuJoCo's constraint solver holds geoms apart against the pull, so that its forces contain it: what a target receives
    is their difference. An adhesion actuator shares its force among all contacts of its body, and also those within the
    gap.

    Parameters
    ----------
    model : mujoco.MjModel
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        # bodies and places among the forces of the actuators that pull
        pulling = np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_BODY)
        self._actuators = list(
            zip(model.actuator_trnid[pulling, 0].tolist(), model.actuator_outadr[pulling].tolist(), strict=True)
        )

    def __call__(self, data: mujoco.MjData) -> NDArray[np.float64] | None:
        """Pull of every contact [N], [ncon]; None where nothing in the model pulls."""
        if not (self._model.flg_adhesion or self._actuators):
            return None
        contacts = data.contact
        pulls = contacts.adhesion.copy()
        if self._actuators:
            bodies = np.where(contacts.geom >= 0, self._model.geom_bodyid[contacts.geom], -1)
            bodies[(bodies < 0).any(axis=1) | ~np.isin(contacts.exclude, (_FORCE, _GAP))] = -1
            for body, force in self._actuators:
                on_body = (bodies == body).any(axis=1)
                pulls[on_body] += data.actuator_force[force] / max(on_body.sum(), 1)
        return pulls


class _Flexes(NamedTuple):
    """Where the flexes' vertices are, by flex: more as in MuJoCo's model.

    Attributes
    ----------
    geoms : int64 [nflex]
        Geom that a flex collides for, or itself where it is a target; -1 for none.
    first : int64 [nflex]
        Collider id of the first vertex.
    """

    geoms: Ints
    first: Ints
    vertadr: Ints32
    elemdataadr: Ints32
    elem: Ints32
    dim: Ints32


class _Sides(NamedTuple):
    """MuJoCo's arrays of contacts, of the same names."""

    geom: Ints32
    flex: Ints32
    elem: Ints32
    vert: Ints32
    pos: Floats


class ColliderIds:
    """Collider ids of the two sides of every contact, see `CoupledModel`.

    Parameters
    ----------
    coupled : CoupledModel
    """

    def __init__(self, coupled: CoupledModel) -> None:
        model = coupled.model
        geoms = np.full(model.nflex, -1)
        geoms[list(coupled.flex_colliders.values())] = list(coupled.flex_colliders)
        first = model.ngeom + model.flex_vertadr.astype(np.int64)
        self._soft = bool(coupled.soft)
        self._plain = not (model.nflex or coupled.convex_colliders or self._soft)
        self._whole = np.arange(model.ngeom)
        for geom, parts in coupled.convex_colliders.items():
            self._whole[parts] = geom
        for target, surface in coupled.soft.items():
            self._whole[surface.geoms] = target
            if surface.flex >= 0:
                geoms[surface.flex] = target
        self._flexes = _Flexes(
            geoms, first, model.flex_vertadr, model.flex_elemdataadr, model.flex_elem, model.flex_dim
        )

    def __call__(self, data: mujoco.MjData) -> NDArray[np.int64]:
        """Collider ids, [ncon, 2]."""
        contacts = data.contact
        if self._plain:
            return contacts.geom.astype(np.int64)
        sides = _Sides(*contiguous(contacts.geom, contacts.flex, contacts.elem, contacts.vert, contacts.pos))
        found = _collider_ids(sides, self._whole, self._flexes, data.flexvert_xpos)
        if self._soft:
            found[found[:, 0] == found[:, 1]] = -1  # what is soft touches itself
        return found


@kernel
def _collider_ids(sides: _Sides, whole: Ints, flexes: _Flexes, vertices: Floats) -> Ints:
    """Collider ids, [ncon, 2]; of a contact with an element, of the vertex nearest to the contact."""
    found = np.empty(sides.geom.shape, np.int64)
    for i in range(len(found)):
        for side in range(2):
            flex = sides.flex[i, side]
            if sides.geom[i, side] >= 0:
                found[i, side] = whole[sides.geom[i, side]]
            elif flexes.geoms[flex] >= 0:
                found[i, side] = flexes.geoms[flex]
            elif sides.vert[i, side] >= 0:
                found[i, side] = flexes.first[flex] + sides.vert[i, side]
            else:
                found[i, side] = flexes.first[flex] + _nearest_vertex(sides, flexes, vertices, i, side)
    return found


@kernel
def _nearest_vertex(sides: _Sides, flexes: _Flexes, vertices: Floats, i: int, side: int) -> int:
    """Vertex of an element, counted from the first of its flex, that is nearest to a contact."""
    flex, nearest, least = sides.flex[i, side], -1, np.inf
    corners = flexes.dim[flex] + 1
    begin = flexes.elemdataadr[flex] + corners * sides.elem[i, side]
    for j in range(begin, begin + corners):
        distance2 = 0.0
        for k in range(3):
            distance2 += (vertices[flexes.vertadr[flex] + flexes.elem[j], k] - sides.pos[i, k]) ** 2
        if distance2 < least:
            nearest, least = flexes.elem[j], distance2
    return nearest


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
