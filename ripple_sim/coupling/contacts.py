"""MuJoCo's contacts as arrays: what touches each target, where, and with how much force.

A `ContactReader` reads the contacts from MuJoCo's data at every step. The contacts of a geom that
collides in place of a target are handed to that target, at places on its surface.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel

from .flex_contacts import FlexContacts
from .ids import ColliderId, GeomId, TargetId, is_geom
from .model import CoupledModel
from .solver_balance import SolverBalance
from .target_mesh import target_mesh
from .wrap_check import WrapCheck

_PYRAMIDAL = int(mujoco.mjtCone.mjCONE_PYRAMIDAL)

# Values of MuJoCo's `contact.exclude` with which a contact pulls: it is included, or in the gap.
_INCLUDED = 0
_IN_GAP = 1

# Distance of the points on which contacts act from MuJoCo's contact points, over the depth of the
# overlap: half the depth is on the surface.
_OUTSIDE = 1.5

# Cosine between the normals of a contact and of the surface, above which the surface faces the
# contact.
_MIN_FACING_COSINE = 0.25


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

    def rows(self, rows: slice | NDArray) -> Contacts:
        """Some of the contacts, by a slice, a mask or indices."""
        return Contacts(
            others=self.others[rows],
            points=self.points[rows],
            forces=self.forces[rows],
            normals=self.normals[rows],
        )

    def by_other(self) -> dict[ColliderId, Contacts]:
        """The contacts with each collider that touches."""
        return {ColliderId(other): contacts for other, contacts in self._runs(self.others)}

    def by_target(self, targets: Ints) -> dict[TargetId, Contacts]:
        """The contacts of each target, from the targets of all contacts, [k], ascending."""
        return {TargetId(ColliderId(target)): contacts for target, contacts in self._runs(targets)}

    def _runs(self, ids: Ints) -> Iterator[tuple[int, Contacts]]:
        """Each of some ids, [k], ascending, and its contacts."""
        bounds = [*first_rows(ids).tolist(), len(ids)]
        for first, last in itertools.pairwise(bounds):
            yield int(ids[first]), self.rows(slice(first, last))

    @classmethod
    def together(cls, groups: Sequence[Contacts]) -> Contacts:
        """Groups of contacts on one target as one, sorted by what touches the target."""
        joined = cls(*map(np.concatenate, zip(*groups, strict=True)))
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
    """MuJoCo's contacts that bear on targets, sorted by target and other.

    Where two targets touch, each of them gets a row.

    Parameters
    ----------
    colliders : int [ncon, 2]
        Collider ids, -1 where there is no collider.
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
    # two rows for each contact, one for each side: the other side of row i is row i ^ 1
    sides = colliders.astype(np.int64).ravel()
    rows = np.flatnonzero(is_target[sides] & np.repeat(bears, 2))
    targets = sides[rows]
    others = sides[rows ^ 1]
    order = np.lexsort((others, targets))
    order = order[np.minimum(targets, others)[order] >= 0]
    rows = rows[order]
    return rows >> 1, rows & 1, targets[order], others[order]


def normal_rows(model: mujoco.MjModel, data: mujoco.MjData, contacts: Ints) -> tuple[Ints, Ints]:
    """Rows of the constraint solver that share the normal forces of some contacts.

    The rows of a contact are the edges of its friction pyramid, or one row; the normal motion of
    the contact is the mean over its rows.

    Returns
    -------
    rows : int64 [m]
    contact_of_row : int64 [m]
        The contact of each row, as an index into `contacts`.
    """
    address = data.contact.efc_address[contacts]
    dim = data.contact.dim[contacts]
    edges = np.maximum(2 * dim - 2, 1) if is_pyramidal(model) else np.ones_like(dim)
    edges = np.where(address >= 0, edges, 0)
    begins = edges.cumsum() - edges
    rows = np.repeat(address - begins, edges) + np.arange(edges.sum())
    contact_of_row = np.repeat(np.arange(len(edges)), edges)
    return rows, contact_of_row


def normal_forces(model: mujoco.MjModel, data: mujoco.MjData, contacts: Ints) -> Floats:
    """Normal forces of some contacts [N], [k], as `mj_contactForce` gives them.

    A contact without a row in the constraint solver has none.
    """
    rows, contact_of_row = normal_rows(model, data, contacts)
    return np.bincount(contact_of_row, data.efc_force[rows], len(contacts)).astype(np.float64)


def friction_forces(model: mujoco.MjModel, data: mujoco.MjData, contacts: Ints) -> Floats:
    """Forces of some contacts along the two tangents of their frames [N], [k, 2].

    The contacts must have rows in the constraint solver.
    """
    axis = np.arange(2)
    address = data.contact.efc_address[contacts, None]
    friction = data.contact.friction[contacts, :2]
    has_axis = data.contact.dim[contacts, None] > axis + 1
    if is_pyramidal(model):
        # each direction has two opposite edges of the pyramid: friction is their difference
        edge = np.where(has_axis, address + 2 * axis, 0)
        opposite_edge = np.where(has_axis, edge + 1, 0)
        forces = friction * (data.efc_force[edge] - data.efc_force[opposite_edge])
    else:
        forces = data.efc_force[np.where(has_axis, address + 1 + axis, 0)]
    return np.where(has_axis, forces, 0.0)


def is_pyramidal(model: mujoco.MjModel) -> bool:
    """Whether friction cones are pyramids, whose edges share the normal force."""
    return bool(model.opt.cone == _PYRAMIDAL)


def points_outside(
    data: mujoco.MjData, contacts: Ints, sides: Ints, targets: Ints, others: Ints, extents: Floats
) -> tuple[Floats, Floats]:
    """Points just outside the targets' surfaces, and normals there, both in the world.

    Parameters
    ----------
    data : mujoco.MjData
    contacts, sides, targets, others
        See `pair_rows`.
    extents : float64 [c]
        See `CoupledModel`.

    Returns
    -------
    points : float64 [k, 3]
        [m].
    normals : float64 [k, 3]
        Unit vectors from the targets to the other colliders.
    """
    normals = data.contact.frame[contacts, :3] * (1.0 - 2.0 * sides)[:, None]
    # an overlap deeper than a geom is not real: a speculative contact's `dist` only says how hard
    # to stop
    overlaps = np.abs(data.contact.dist[contacts])
    depths = np.minimum(overlaps, np.minimum(extents[targets], extents[others]))
    # MuJoCo's point lies half-way between the two surfaces, which overlap by -dist: the target's
    # surface is dist/2 away. A little outside it the nearest surface point is on this side, even of
    # a thin part.
    points = data.contact.pos[contacts] + _OUTSIDE * depths[:, None] * normals
    return points, normals


def adhesion(model: mujoco.MjModel, data: mujoco.MjData) -> Floats | None:
    """Pull of every contact by sticky geoms and adhesion actuators [N], [ncon]; None without any.

    MuJoCo's constraint solver holds geoms apart against the pull, so that its forces contain the
    pull: a target receives the difference. An actuator shares its force among all contacts of its
    body, also the contacts within the gap.
    """
    actuators: list[int] = []
    if model.nu:
        on_bodies = model.actuator_trntype == mujoco.mjtTrn.mjTRN_BODY
        actuators = np.flatnonzero(on_bodies).tolist()
    if not (model.flg_adhesion or actuators):
        return None
    contacts = data.contact
    pulls = contacts.adhesion.copy()
    if actuators:
        bodies = np.where(contacts.geom >= 0, model.geom_bodyid[contacts.geom], -1)
        bodies[(bodies < 0).any(axis=1) | ~np.isin(contacts.exclude, (_INCLUDED, _IN_GAP))] = -1
        for actuator in actuators:
            on_body = (bodies == model.actuator_trnid[actuator, 0]).any(axis=1)
            force = data.actuator_force[model.actuator_outadr[actuator]]
            pulls[on_body] += force / max(on_body.sum(), 1)
    return pulls


def collider_ids(coupled: CoupledModel, data: mujoco.MjData) -> NDArray[np.integer]:
    """Collider ids of the two sides of every contact, [ncon, 2].

    An element of a flex counts as its vertex that is nearest to the contact. Self-contact of a flex
    is ignored: both ids are -1.
    """
    model = coupled.model
    geom = data.contact.geom
    if not (model.nflex or coupled.convex_colliders or coupled.soft):
        return geom
    flex = data.contact.flex
    colliders = np.where(geom >= 0, coupled.of_geom[geom], coupled.of_flex[flex])
    contact, side = np.nonzero((geom < 0) & (colliders < 0))
    if len(contact):
        first_vertex = model.flex_vertadr[flex[contact, side]]
        vertex = _flex_vertices(model, data, contact, side)
        colliders[contact, side] = model.ngeom + first_vertex + vertex
    colliders[colliders[:, 0] == colliders[:, 1]] = -1
    return colliders


def _flex_vertices(
    model: mujoco.MjModel, data: mujoco.MjData, contacts: Ints, sides: Ints
) -> NDArray[np.int64]:
    """Vertex, within its flex, that touches on each side of contacts, [k].

    Where an element touches, it is the element's vertex nearest to the contact.
    """
    flex = data.contact.flex[contacts, sides]
    vertex = data.contact.vert[contacts, sides].astype(np.int64)
    of_element = np.flatnonzero(vertex < 0)
    flex = flex[of_element]
    element = data.contact.elem[contacts, sides][of_element]
    dim = model.flex_dim[flex]
    # an element has at most 4 corners: its last corner stands for missing ones
    corner = np.minimum(np.arange(4), dim[:, None])
    begins = model.flex_elemdataadr[flex] + (dim + 1) * element
    vertices = model.flex_elem[begins[:, None] + corner]
    points = data.flexvert_xpos[model.flex_vertadr[flex][:, None] + vertices]
    distances = np.linalg.norm(points - data.contact.pos[contacts[of_element], None], axis=2)
    vertex[of_element] = vertices[np.arange(len(vertices)), distances.argmin(axis=1)]
    return vertex


def places_facing(
    atlas: Atlas, points: NDArray[np.float64], normals: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Surface points [m], [k, 3], nearest to contact points among those that face the contacts.

    The other side of a thin part may be nearer. Where no part of the surface faces a contact, the
    nearest point is taken.

    Parameters
    ----------
    atlas : Atlas
    points : float64 [k, 3]
        In the frame of the target [m].
    normals : float64 [k, 3]
        From the target to the other geom, unit vectors.
    """
    places, texels = atlas.nearest(points)
    outward = atlas.normals.reshape(-1, 3)
    cosines = np.einsum("ij,ij->i", outward[texels], normals)
    away = np.flatnonzero(cosines <= _MIN_FACING_COSINE)
    if len(away):
        positions = atlas.positions.reshape(-1, 3)
        facing = _nearest_facing(positions, outward, points[away], normals[away])
        exists = facing >= 0
        places[away[exists]] = positions[facing[exists]]
    return places


@kernel
def _nearest_facing(positions: Floats, outward: Floats, points: Floats, normals: Floats) -> Ints:
    """Nearest texel to each point that faces the point's normal, [k]; -1 without one."""
    nearest = np.full(len(points), -1)
    for i in range(len(points)):
        least = np.inf
        for texel in range(len(positions)):
            distance2 = 0.0
            along = 0.0
            for k in range(3):
                distance2 += (positions[texel, k] - points[i, k]) ** 2
                along += outward[texel, k] * normals[i, k]
            if distance2 < least and along > _MIN_FACING_COSINE:
                least = distance2
                nearest[i] = texel
    return nearest


class ContactReader:
    """Reads the contacts on each target from MuJoCo's data.

    Parameters
    ----------
    coupled : CoupledModel
    atlases : mapping
        Every target to its atlas, in the target's frame [m].
    """

    def __init__(self, coupled: CoupledModel, atlases: Mapping[TargetId, Atlas]) -> None:
        self._coupled = coupled
        self._atlases: dict[GeomId, Atlas] = {}
        for target, atlas in atlases.items():
            if is_geom(target, coupled.model):
                self._atlases[target] = atlas
        # targets of each geom that collides for another geom, or of a target with convex parts
        self._targets_of: dict[GeomId, list[GeomId]] = {}
        for rigid_target in self._atlases:
            for geom in coupled.collision_geoms(rigid_target):
                if geom != rigid_target or geom in coupled.convex_colliders:
                    self._targets_of.setdefault(geom, []).append(rigid_target)
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

    def read(self, data: mujoco.MjData) -> dict[TargetId, Contacts]:
        """Contacts of each target that is touched.

        Where two targets touch, their contacts are reported for each of them. A geom that sticks to
        a target and pulls more than it pushes has negative forces, at all contacts of the pair.
        """
        contacts: dict[TargetId, Contacts] = {}
        if data.ncon:
            colliders = collider_ids(self._coupled, data)
            contacts = self._geom_contacts(data, colliders) | self._flex_contacts(data, colliders)
            if self._targets_of.keys() & contacts.keys():
                self._hand_over(data, contacts)
        self._check_solver(data, contacts)
        self._check_wraps(contacts)
        return contacts

    def _geom_contacts(
        self, data: mujoco.MjData, colliders: NDArray[np.integer]
    ) -> dict[TargetId, Contacts]:
        """Contacts of colliders without a flex collider, by collider id, in ascending order.

        Triangles of a flex that touches push sideways in pairs: the forces of such a pair are
        scaled to add up to the length of their vector sum, as for the flex; see `FlexContacts`.
        """
        model = self._coupled.model
        pulls = adhesion(self._coupled.model, data)
        bears = data.contact.efc_address >= 0
        if pulls is not None:
            # contacts within the gap pull without a row in the constraint solver
            bears |= pulls > 0
        rows = pair_rows(colliders, bears, self._is_read)
        contacts = rows[0]
        if not len(contacts):
            return {}
        forces = normal_forces(model, data, contacts)
        if pulls is not None:
            forces += pulls[contacts]
        pushing = forces > 0
        contacts, sides, targets, others = (column[pushing] for column in rows)
        points, normals = points_outside(
            data, contacts, sides, targets, others, self._coupled.extents
        )
        touching = Contacts(others, points, forces[pushing], normals)
        if pulls is not None or self._coupled.has_flex[others].any():
            contact_pulls = None if pulls is None else pulls[contacts]
            factors = self._pair_factors(targets, touching, contact_pulls)
            touching = touching._replace(forces=factors * touching.forces).rows(factors != 0)
            targets = targets[factors != 0]
        return touching.by_target(targets)

    def _pair_factors(self, targets: Ints, touching: Contacts, pulls: Floats | None) -> Floats:
        """Factors, [k], after which the forces of each pair add up to the force that it bears.

        The pulls of sticky geoms are taken off. Forces of a flex are added up as vectors.

        Parameters
        ----------
        targets : int64 [k]
            Target of each contact, ascending.
        touching : Contacts
        pulls : float64 [k], optional
            Pull of each contact [N]; its force contains the pull twice.
        """
        others = touching.others
        forces = touching.forces
        starts = first_rows(targets, others)
        force_sums = np.add.reduceat(forces, starts)
        factors = np.ones(len(starts))
        if pulls is not None:
            factors -= 2 * np.add.reduceat(pulls, starts) / force_sums
        vector_sums = np.add.reduceat(forces[:, None] * touching.normals, starts)
        amounts = np.linalg.norm(vector_sums, axis=1)
        factors *= np.where(self._coupled.has_flex[others[starts]], amounts / force_sums, 1.0)
        return np.repeat(factors, np.diff(np.append(starts, len(forces))))

    def _flex_contacts(
        self, data: mujoco.MjData, colliders: NDArray[np.integer]
    ) -> dict[TargetId, Contacts]:
        """Contacts of targets with a flex collider, by the target's id."""
        model = self._coupled.model
        flexes = self._flexes
        if flexes is None:
            return {}
        bears = data.contact.efc_address >= 0
        rows = pair_rows(colliders, bears, flexes.is_target)
        contacts, _, targets, others = rows
        if not len(contacts):
            return {}
        normal = normal_forces(model, data, contacts) - data.contact.adhesion[contacts]
        friction = friction_forces(model, data, contacts)
        forces = np.column_stack([normal, friction])
        starts = first_rows(targets, others)
        shares, points, shared_forces, normals = flexes.loads(data, *rows, starts, forces)
        touching = Contacts(others[shares], points, shared_forces, normals)
        return touching.by_target(targets[shares])

    def _hand_over(self, data: mujoco.MjData, contacts: dict[TargetId, Contacts]) -> None:
        """Hand the contacts of each collision geom to its target, or to the nearest of several."""
        geoms = sorted(self._targets_of.keys() & contacts.keys())
        contacts_of_geoms = {geom: contacts.pop(geom) for geom in geoms}
        for geom, on_geom in contacts_of_geoms.items():
            targets = self._targets_of[geom]
            places = [self._places_on(data, target, on_geom) for target in targets]
            distances = np.linalg.norm(np.array(places) - on_geom.points, axis=2)
            nearest = distances.argmin(axis=0)
            for i, target in enumerate(targets):
                if not (nearest == i).any():
                    continue
                on_target = on_geom._replace(points=places[i]).rows(nearest == i)
                if target in contacts:
                    on_target = Contacts.together([contacts[target], on_target])
                contacts[target] = on_target

    def _places_on(self, data: mujoco.MjData, target: GeomId, contacts: Contacts) -> Floats:
        """Points on a target's surface nearest to contacts that they face, in the world [m]."""
        position = data.geom_xpos[target]
        rotation = data.geom_xmat[target].reshape(3, 3)
        points = (contacts.points - position) @ rotation
        normals = contacts.normals @ rotation
        return position + places_facing(self._atlases[target], points, normals) @ rotation.T
