"""MuJoCo's contacts with flex colliders, by target.

Forces of contacts with flex colliders: the sum of whole forces, in place of that of normal ones.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import RippleWarning
from ripple_sim.solver import Mesh
from ripple_sim.solver.kernel import Bools, Floats, Ints, Ints32, kernel

from .contacts import PYRAMIDAL, PairContacts, TargetContacts, close, contiguous, group_by_pair, room_for, trimmed
from .model import CoupledModel

# Cosine between the normals of a contact and of the surface, up to which MuJoCo is taken to push sideways: geoms that
# hit an edge or a corner push at down to 0.5.
_SIDEWAYS = 0.1


class FlexNormals(NamedTuple):
    """Outward unit normals of all flex colliders' triangles.

    Attributes
    ----------
    first : int64 [c]
        Row of the first triangle of a target among the normals; -1 for all other colliders.
    normals : float64 [nflexelem, 3]
        In the frames of the geoms.
    sheet : bool [c]
        Targets that are open: they can be touched from the inner side too.
    """

    first: Ints
    normals: Floats
    sheet: Bools


class MujocoFlexContacts(NamedTuple):
    """MuJoCo's arrays of contacts, of the same names, forces of its constraint solver, and rotations of its geoms."""

    efc_address: Ints32
    dim: Ints32
    friction: Floats
    elem: Ints32
    frame: Floats
    pos: Floats
    dist: Floats
    includemargin: Floats
    adhesion: Floats
    efc_force: Floats
    geom_xmat: Floats


def summed_contacts(
    colliders: Ints, contacts: MujocoFlexContacts, flex: FlexNormals, extents: Floats, pyramidal: bool
) -> tuple[PairContacts, Floats]:
    """Contacts that share the sum of the whole forces of their pair; pairs whose sum does not push are left out.

    Beside them, for each target, the amount of these sums [N], and the part of it that neither a normal force nor
    friction explains [N]: float64 [c, 2], by collider id.

    Parameters
    ----------
    colliders : int64 [ncon, 2]
        Collider ids of each contact.
    contacts : MujocoFlexContacts
    flex : FlexNormals
    extents : float64 [c]
        Smallest half-extents [m].
    pyramidal : bool
        Whether MuJoCo's friction cones are.
    """
    found, counts, amounts = _summed_contacts(colliders, contacts, flex, extents, pyramidal)
    return trimmed(found, counts), amounts


@kernel
def _summed_contacts(
    colliders: Ints, contacts: MujocoFlexContacts, flex: FlexNormals, extents: Floats, pyramidal: bool
) -> tuple[PairContacts, tuple[int, int, int], Floats]:
    pairs, forces = group_by_pair(colliders, contacts.efc_address, flex.first >= 0), _whole_forces(contacts, pyramidal)
    found, found_pairs, row, amounts = room_for(pairs), 0, 0, np.zeros((len(flex.first), 2))
    for pair in range(len(pairs.targets)):
        target, other = pairs.targets[pair], pairs.others[pair]
        first, sum_of_weights, friction = row, 0.0, 0.0
        whole, mean = np.zeros(3), np.zeros(3)
        for k in range(pairs.begins[pair], pairs.begins[pair + 1]):
            i, side = pairs.contacts[k], pairs.sides[k]
            sign = 1.0 if side else -1.0
            outward = -sign * contacts.frame[i, :3]
            normal = outward
            # a plane touches vertices, which are no element, and its own normal is right
            if contacts.elem[i, side] >= 0:
                rotation = contacts.geom_xmat[target].copy().reshape(3, 3)
                normal = rotation @ flex.normals[flex.first[target] + contacts.elem[i, side]]
            whole += sign * forces[i]
            if contacts.dim[i] > 1:
                friction = max(friction, contacts.friction[i, 0], contacts.friction[i, 1])
            force, along = (forces[i] * contacts.frame[i, :3]).sum(), (outward * normal).sum()
            if flex.sheet[target] and along < 0:
                normal, along = -normal, -along
            if force <= 0 or along <= _SIDEWAYS:
                continue
            mean += force * outward
            weight = force * along**2
            sum_of_weights += weight
            # from the other geom's surface, which is in by a depth, to as far outside the target's own
            depth = contacts.includemargin[i] - contacts.dist[i]
            outside = depth + min(depth, extents[other])
            met = contacts.pos[i] - sign * contacts.dist[i] / 2 * contacts.frame[i, :3]
            found.points[row], found.normals[row], found.forces[row] = met + outside * normal, normal, weight
            row += 1
        length, amount = np.sqrt((mean**2).sum()), np.sqrt((whole**2).sum())
        force = -(whole * mean).sum() / length if row > first else 0.0
        across = min(np.sqrt(max(amount**2 - force**2, 0.0)), friction * force)
        amounts[target, 0] += amount
        amounts[target, 1] += amount - np.hypot(force, across) if force > 0 else amount
        if force <= 0:
            row = first
            continue
        found.forces[first:row] *= force / sum_of_weights
        found.targets[found_pairs], found.others[found_pairs], found.begins[found_pairs] = target, other, first
        found_pairs += 1
    return found, close(found, found_pairs, row), amounts


@kernel
def _whole_forces(contacts: MujocoFlexContacts, pyramidal: bool) -> Floats:
    """Force of every contact on its second geom, in the world [N], [ncon, 3]; see `mj_contactForce`."""
    address, dim, frame, efc_force = contacts.efc_address, contacts.dim, contacts.frame, contacts.efc_force
    forces = np.zeros((len(address), 3))
    for i in range(len(address)):
        if address[i] < 0:
            continue
        along = np.zeros(3)
        if pyramidal and dim[i] > 1:
            # each direction has two opposite edges of the friction pyramid: normal force is their sum, friction their
            # difference
            for k in range(dim[i] - 1):
                one, two = efc_force[address[i] + 2 * k], efc_force[address[i] + 2 * k + 1]
                along[0] += one + two
                if k < 2:
                    along[k + 1] = contacts.friction[i, k] * (one - two)
        else:
            for k in range(min(dim[i], 3)):
                along[k] = efc_force[address[i] + k]
        along[0] -= contacts.adhesion[i]
        for k in range(3):
            for j in range(3):
                forces[i, j] += along[k] * frame[i, 3 * k + j]
    return forces


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
