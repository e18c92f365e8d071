"""MuJoCo's contacts as arrays: what touches each target, where, and with how much force.

A `ContactReader` reads them from MuJoCo's data at every step. Contacts of geoms that collide in
place of a target are handed to it, at places on its surface.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel

from .flex_contacts import FlexContacts
from .model import CoupledModel
from .solver_balance import SolverBalance
from .target_mesh import target_mesh
from .wrap_check import WrapCheck

_PYRAMIDAL = int(mujoco.mjtCone.mjCONE_PYRAMIDAL)

# MuJoCo's marks of contacts that pull though they do not push: all right, or within the gap.
_FORCE = 0
_GAP = 1

# Cosine between the normals of a contact and of the surface, above which the surface faces the
# contact.
_FACING = 0.25


class Contacts(NamedTuple):
    """All contacts that load one target in one step.

    Attributes
    ----------
    others : int64 [k]
        Collider id of what touches, ascending; see `CoupledModel`.
    points : float64 [k, 3]
        Contact points in the world [m], just outside the target's surface.
    forces : float64 [k]
        Normal forces [N]: positive, or all negative with a geom that sticks to the target and
        pulls.
    normals : float64 [k, 3]
        Unit normals in the world, from the target to the other geom.
    """

    others: Ints
    points: Floats
    forces: Floats
    normals: Floats

    def rows(self, which: slice | NDArray) -> Contacts:
        """Some of the contacts."""
        return Contacts(
            self.others[which], self.points[which], self.forces[which], self.normals[which]
        )

    def split(self, ids: Ints) -> dict[int, Contacts]:
        """The contacts of each id, from the ids of all, [k], ascending."""
        bounds = [*first_rows(ids).tolist(), len(ids)]
        return {int(ids[a]): self.rows(slice(a, b)) for a, b in itertools.pairwise(bounds)}

    @classmethod
    def together(cls, parts: Sequence[Contacts]) -> Contacts:
        """Several on one target, sorted by what touches it."""
        joined = cls(*map(np.concatenate, zip(*parts, strict=True)))
        return joined.rows(np.argsort(joined.others, kind="stable"))


def first_rows(*sorted_ids: NDArray) -> Ints:
    """Where runs of equal ids, or of equal pairs of ids, begin."""
    begins = np.ones(len(sorted_ids[0]), dtype=np.bool_)
    begins[1:] = False
    for ids in sorted_ids:
        begins[1:] |= ids[1:] != ids[:-1]
    return begins.nonzero()[0]


def pair_rows(
    colliders: NDArray[np.integer], bears: Bools, is_target: Bools
) -> tuple[Ints, Ints, Ints, Ints]:
    """MuJoCo's contacts that bear on targets, sorted by target and other; where two targets touch, one for each.

    Parameters
    ----------
    colliders : int [ncon, 2]
        Collider ids, -1 for what is none.
    bears : bool [ncon]
        Whether a contact carries a force: one without a row in the constraint solver (excluded, or
        in the margin only) does not.
    is_target : bool [c]

    Returns
    -------
    contacts : int64 [k]
        Indices among MuJoCo's contacts.
    sides : int64 [k]
        0 where the target is the first geom of the contact, 1 where it is the second.
    targets, others : int64 [k]
        Collider ids.
    """
    # the two sides of a contact stand together: of row i the other is i ^ 1
    both = colliders.astype(np.int64).ravel()
    rows = np.flatnonzero(is_target[both] & np.repeat(bears, 2))
    targets = both[rows]
    others = both[rows ^ 1]
    order = np.lexsort((others, targets))
    order = order[np.minimum(targets, others)[order] >= 0]
    rows = rows[order]
    return rows >> 1, rows & 1, targets[order], others[order]


def normal_rows(model: mujoco.MjModel, data: mujoco.MjData, contacts: Ints) -> tuple[Ints, Ints]:
    """Rows of the constraint solver that share the normal forces of some contacts, and the contact of each, [m] both.

    Those of a contact are the edges of its friction pyramid, or one; its normal motion is their
    mean.
    """
    address = data.contact.efc_address[contacts]
    dim = data.contact.dim[contacts]
    edges = np.maximum(2 * dim - 2, 1) if is_pyramidal(model) else np.ones_like(dim)
    edges = np.where(address >= 0, edges, 0)
    ends = edges.cumsum()
    return np.repeat(address - ends + edges, edges) + np.arange(edges.sum()), np.repeat(
        np.arange(len(edges)), edges
    )


def normal_forces(model: mujoco.MjModel, data: mujoco.MjData, contacts: Ints) -> Floats:
    """Normal forces of some contacts [N], as `mj_contactForce` gives them; 0 without a row in the constraint solver."""
    rows, of = normal_rows(model, data, contacts)
    return np.bincount(of, data.efc_force[rows], len(contacts)).astype(np.float64)


def friction_forces(model: mujoco.MjModel, data: mujoco.MjData, contacts: Ints) -> Floats:
    """Forces of some contacts, which have rows in the solver, along the other two axes of their frames [N], [k, 2]."""
    each = data.contact
    axis = np.arange(2)
    address = each.efc_address[contacts, None]
    friction = each.friction[contacts, :2]
    has_axis = each.dim[contacts, None] > axis + 1
    if is_pyramidal(model):
        # each direction has two opposite edges of the pyramid: friction is their difference
        edge = np.where(has_axis, address + 2 * axis, 0)
        forces = friction * (data.efc_force[edge] - data.efc_force[np.where(has_axis, edge + 1, 0)])
    else:
        forces = data.efc_force[np.where(has_axis, address + 1 + axis, 0)]
    return np.where(has_axis, forces, 0.0)


def is_pyramidal(model: mujoco.MjModel) -> bool:
    """Whether friction cones are pyramids, whose edges share the normal force."""
    return bool(model.opt.cone == _PYRAMIDAL)


def points_outside(
    data: mujoco.MjData, contacts: Ints, sides: Ints, targets: Ints, others: Ints, extents: Floats
) -> tuple[Floats, Floats]:
    """Points just outside the targets' surfaces [m], and unit normals from the targets to what touches, [k, 3] each.

    Both are in the world. The contacts are those of `pair_rows`; `extents` [c] are those of
    `CoupledModel`.
    """
    each = data.contact
    normals = each.frame[contacts, :3] * (1.0 - 2.0 * sides)[:, None]
    # an overlap deeper than a geom is not real: a speculative contact's `dist` only says how hard
    # to stop
    depths = np.minimum(np.abs(each.dist[contacts]), np.minimum(extents[targets], extents[others]))
    # MuJoCo's point lies half-way between the two surfaces, which overlap by -dist: the target's
    # surface is dist/2 away. A little outside it the nearest surface point is on this side, even of
    # a thin part.
    return each.pos[contacts] + 1.5 * depths[:, None] * normals, normals


def adhesion(model: mujoco.MjModel, data: mujoco.MjData) -> Floats | None:
    """Pull of every contact [N], [ncon], by sticky geoms and adhesion actuators; None where nothing pulls.

    MuJoCo's constraint solver holds geoms apart against the pull, so that its forces contain it:
    what a target receives is their difference. An actuator shares its force among all contacts of
    its body, and also those within the gap.
    """
    actuators = (
        np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_BODY).tolist()
        if model.nu
        else []
    )
    if not (model.flg_adhesion or actuators):
        return None
    contacts = data.contact
    pulls = contacts.adhesion.copy()
    if actuators:
        bodies = np.where(contacts.geom >= 0, model.geom_bodyid[contacts.geom], -1)
        bodies[(bodies < 0).any(axis=1) | ~np.isin(contacts.exclude, (_FORCE, _GAP))] = -1
        for actuator in actuators:
            on_body = (bodies == model.actuator_trnid[actuator, 0]).any(axis=1)
            pulls[on_body] += data.actuator_force[model.actuator_outadr[actuator]] / max(
                on_body.sum(), 1
            )
    return pulls


def collider_ids(coupled: CoupledModel, data: mujoco.MjData) -> NDArray[np.integer]:
    """Collider ids of the two sides of every contact, [ncon, 2]; of an element of a flex, of the vertex nearest."""
    model = coupled.model
    geom = data.contact.geom
    if not (model.nflex or coupled.convex_colliders or coupled.soft):
        return geom
    flex = data.contact.flex
    found = np.where(geom >= 0, coupled.of_geom[geom], coupled.of_flex[flex])
    contact, side = np.nonzero((geom < 0) & (found < 0))
    if len(contact):
        flex = flex[contact, side]
        vertex = data.contact.vert[contact, side].astype(np.int64)
        of_element = np.flatnonzero(vertex < 0)
        elements = data.contact.elem[contact, side][of_element]
        first = model.flex_vertadr[flex]
        dim = model.flex_dim[flex[of_element]]
        # the last corner of an element stands for those that it has not
        corner = np.minimum(np.arange(4), dim[:, None])
        begins = model.flex_elemdataadr[flex[of_element]] + (dim + 1) * elements
        vertices = model.flex_elem[begins[:, None] + corner]
        places = data.flexvert_xpos[first[of_element, None] + vertices]
        distances = np.linalg.norm(places - data.contact.pos[contact[of_element], None], axis=2)
        vertex[of_element] = vertices[np.arange(len(vertices)), distances.argmin(axis=1)]
        found[contact, side] = model.ngeom + first + vertex
    found[found[:, 0] == found[:, 1]] = -1  # what is soft touches itself
    return found


def places_facing(
    atlas: Atlas, points: NDArray[np.float64], normals: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Surface points [m], [k, 3], nearest to contact points among those that face the contacts.

    The other side of a thin part may be nearer. Where no part of the surface faces a contact, it is
    the nearest point.

    Parameters
    ----------
    atlas : Atlas
    points : float64 [k, 3]
        In the frame of the target [m].
    normals : float64 [k, 3]
        From the target to the other geom, unit vectors.
    """
    found, texels = atlas.nearest(points)
    outward = atlas.normals.reshape(-1, 3)
    away = np.flatnonzero(np.einsum("ij,ij->i", outward[texels], normals) <= _FACING)
    if len(away):
        positions = atlas.positions.reshape(-1, 3)
        facing = _nearest_facing(positions, outward, points[away], normals[away])
        found[away[facing >= 0]] = positions[facing[facing >= 0]]
    return found


@kernel
def _nearest_facing(positions: Floats, outward: Floats, points: Floats, normals: Floats) -> Ints:
    """Nearest texel to each point, [k], whose normal agrees with the point's; -1 where none does."""
    found = np.full(len(points), -1)
    for i in range(len(points)):
        least = np.inf
        for texel in range(len(positions)):
            distance2 = 0.0
            along = 0.0
            for k in range(3):
                distance2 += (positions[texel, k] - points[i, k]) ** 2
                along += outward[texel, k] * normals[i, k]
            if distance2 < least and along > _FACING:
                least = distance2
                found[i] = texel
    return found


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
        self._atlases = {
            target: atlas for target, atlas in atlases.items() if target not in coupled.soft
        }
        # the targets of the geoms that collide for others, or through their convex parts
        self._targets_of: dict[int, list[int]] = {}
        for target in self._atlases:
            for geom in coupled.collision_geoms(target):
                if geom != target or geom in coupled.convex_colliders:
                    self._targets_of.setdefault(geom, []).append(target)
        meshes = {target: atlas.mesh for target, atlas in self._atlases.items()}
        for geom in coupled.flex_colliders.keys() & self._targets_of.keys():
            meshes[geom] = target_mesh(coupled.model, geom)
        self._is_read = np.zeros(len(coupled.owners), dtype=np.bool_)
        self._is_read[[*meshes, *self._targets_of, *coupled.soft]] = True
        self._check_solver = SolverBalance(coupled)
        self._check_wraps = WrapCheck(coupled)
        self._flexes = FlexContacts(coupled, meshes) if coupled.flex_colliders else None
        if self._flexes is not None:
            self._is_read[self._flexes.is_target] = False

    def read(self, data: mujoco.MjData) -> dict[int, Contacts]:
        """Contacts of each target that is touched, by geom id.

        Where two targets touch, their contacts are reported for each of them. What sticks to a
        target and pulls more than it pushes has negative forces, at all contacts of the pair.
        """
        found: dict[int, Contacts] = {}
        if data.ncon:
            colliders = collider_ids(self._coupled, data)
            found = self._geom_contacts(data, colliders) | self._flex_contacts(data, colliders)
            if self._targets_of.keys() & found.keys():
                self._hand_over(data, found)
        self._check_solver(data, found)
        self._check_wraps(found)
        return found

    def _geom_contacts(
        self, data: mujoco.MjData, colliders: NDArray[np.integer]
    ) -> dict[int, Contacts]:
        """The same of what collides without a flex, by its own id, in ascending order.

        Triangles of a flex that touches push sideways in pairs: the contacts of such a pair add up
        to the sum of their vectors, as for the flex; see `FlexContacts`.
        """
        model = self._coupled.model
        pulls = adhesion(self._coupled.model, data)
        bears = data.contact.efc_address >= 0
        if pulls is not None:
            bears |= pulls > 0  # those within the gap pull without a row in the constraint solver
        rows = contacts, *_ = pair_rows(colliders, bears, self._is_read)
        if not len(contacts):
            return {}
        forces = normal_forces(model, data, contacts)
        if pulls is not None:
            forces += pulls[contacts]
        pushing = forces > 0
        contacts, sides, targets, others = (each[pushing] for each in rows)
        forces = forces[pushing]
        points, normals = points_outside(
            data, contacts, sides, targets, others, self._coupled.extents
        )
        found = Contacts(others, points, forces, normals)
        if pulls is not None or self._coupled.has_flex[others].any():
            # the forces of a pair are to add up to what it bears: without pulls, and as vectors
            # with a flex
            starts = first_rows(targets, others)
            whole = np.add.reduceat(forces, starts)
            factors = np.ones(len(starts))
            if pulls is not None:
                factors -= 2 * np.add.reduceat(pulls[contacts], starts) / whole
            sums = np.linalg.norm(np.add.reduceat(forces[:, None] * normals, starts), axis=1)
            factors *= np.where(self._coupled.has_flex[others[starts]], sums / whole, 1.0)
            factors = np.repeat(factors, np.diff(np.append(starts, len(forces))))
            found = found._replace(forces=factors * forces).rows(factors != 0)
            targets = targets[factors != 0]
        return found.split(targets)

    def _flex_contacts(
        self, data: mujoco.MjData, colliders: NDArray[np.integer]
    ) -> dict[int, Contacts]:
        """The same of targets with a flex collider, by theirs."""
        model = self._coupled.model
        flexes = self._flexes
        if flexes is None:
            return {}
        rows = contacts, _, targets, others = pair_rows(
            colliders, data.contact.efc_address >= 0, flexes.is_target
        )
        if not len(contacts):
            return {}
        normal, friction = (
            read(model, data, contacts) for read in (normal_forces, friction_forces)
        )
        forces = np.column_stack([normal - data.contact.adhesion[contacts], friction])
        kept, *loads = flexes.loads(data, *rows, first_rows(targets, others), forces)
        return Contacts(others[kept], *loads).split(targets[kept])

    def _hand_over(self, data: mujoco.MjData, found: dict[int, Contacts]) -> None:
        """Hand every contact of a collision geom to one target: where several share the geom, to the nearest."""
        theirs = {geom: found.pop(geom) for geom in sorted(self._targets_of.keys() & found.keys())}
        for geom, contacts in theirs.items():
            placed = []
            for target in self._targets_of[geom]:
                position = data.geom_xpos[target]
                rotation = data.geom_xmat[target].reshape(3, 3)
                points = (contacts.points - position) @ rotation
                normals = contacts.normals @ rotation
                placed.append(
                    position + places_facing(self._atlases[target], points, normals) @ rotation.T
                )
            nearest = np.linalg.norm(np.array(placed) - contacts.points, axis=2).argmin(axis=0)
            for i, target in enumerate(self._targets_of[geom]):
                if (nearest == i).any():
                    mine = contacts._replace(points=placed[i]).rows(nearest == i)
                    found[target] = (
                        Contacts.together([found[target], mine]) if target in found else mine
                    )
