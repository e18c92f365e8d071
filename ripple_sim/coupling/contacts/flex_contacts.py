"""Contacts with shells: the sum of whole forces, in place of that of normal ones."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numba
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.model.target import shells
from ripple_sim.solver import Mesh

from .geom_contacts import PYRAMIDAL, Contacts, by_target

_TINY = np.finfo(np.float64).tiny
# Cosine between the normals of a contact and of the surface, up to which MuJoCo is taken to push sideways: bodies that
# hit an edge or a corner push at down to 0.5.
_SIDEWAYS = 0.1


class ShellContacts:
    """Contacts with the flexes that stand for geoms.

    Where a flat body gets at a triangle with its rim, MuJoCo pushes sideways, and the friction of such contacts pushes
    along the normal. These forces cancel in pairs, but not their amounts, which add up to many times the momentum that
    is exchanged. So a pair presses with the sum of its whole forces along its mean normal. What pushes sideways has no
    part in that normal, nor in where the pair presses.

    Parameters
    ----------
    model : mujoco.MjModel
    meshes : mapping
        Geom id of every target to its surface, in the geom's frame [m].

    Attributes
    ----------
    targets : list of int
        Geom ids of the targets that a flex stands for, ascending.
    """

    def __init__(self, model: mujoco.MjModel, meshes: Mapping[int, Mesh]) -> None:
        self._model = model
        flexes = shells(model)
        # the last entry is that of no flex, whose id is -1
        self._geom_of = np.full(model.nflex + 1, -1)
        self._geom_of[list(flexes.values())] = list(flexes)
        self.targets = sorted(flexes.keys() & meshes.keys())
        self._first_normal, self._normals = np.full(model.ngeom, -1), np.zeros((model.nflexelem, 3))
        for geom in self.targets:
            first = self._first_normal[geom] = model.flex_elemadr[flexes[geom]]
            normals = _normals(model, geom, flexes[geom], meshes[geom])
            self._normals[first : first + len(normals)] = normals

    def geoms(self, data: mujoco.MjData) -> NDArray[np.int64]:
        """Ids of the geoms of each contact, [ncon, 2], also where a flex stands for one; -1 for other flexes."""
        contacts = data.contact
        return np.where(contacts.geom >= 0, contacts.geom, self._geom_of[contacts.flex])

    def pressing(
        self, data: mujoco.MjData, geoms: NDArray[np.int64], extents: NDArray[np.float64]
    ) -> dict[int, Contacts]:
        """As `pressing_contacts`, for these targets."""
        contacts = data.contact
        forces = _whole_forces(
            contacts.efc_address,
            contacts.dim,
            contacts.friction,
            contacts.frame,
            data.efc_force,
            self._model.opt.cone == PYRAMIDAL,
        )
        return by_target(
            *_by_pair(
                geoms,
                contacts.elem,
                forces,
                contacts.frame,
                contacts.pos,
                contacts.dist,
                contacts.includemargin,
                self._first_normal,
                self._normals,
                data.geom_xmat,
                extents,
            )
        )


def _normals(model: mujoco.MjModel, geom: int, flex: int, mesh: Mesh) -> NDArray[np.float64]:
    """Outward unit normals of a surface at the triangles of its flex, in the geom's frame, [element_count, 3]."""
    first, count = model.flex_elemdataadr[flex], model.flex_elemnum[flex]
    F, V = model.flex_elem[first : first + 3 * count].reshape(-1, 3), mesh.V
    if not np.array_equal(F, mesh.F):
        # a flex that somebody else has made
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        V = model.flex_vert[model.flex_vertadr[flex] :][: model.flex_vertnum[flex]] @ rotation.reshape(3, 3)
    corners = V[F]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # they point outwards where the volume that they enclose is positive
    outward = np.sign(np.einsum("ij,ij->", normals, corners[:, 0]))
    return outward * normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _TINY)


@numba.njit(cache=True, nogil=True)
def _whole_forces(address, dim, friction, frames, efc_force, pyramidal):
    """Force of every contact on the second of its two bodies, in the world, [ncon, 3] [N]; see mj_contactForce."""
    forces = np.zeros((len(address), 3))
    for i in range(len(address)):
        if address[i] < 0:
            continue
        along = np.zeros(3)
        if pyramidal and dim[i] > 1:
            # two opposite edges of the friction pyramid for each direction: together they push, apart they rub
            for k in range(dim[i] - 1):
                one, two = efc_force[address[i] + 2 * k], efc_force[address[i] + 2 * k + 1]
                along[0] += one + two
                if k < 2:
                    along[k + 1] = friction[i, k] * (one - two)
        else:
            for k in range(min(dim[i], 3)):
                along[k] = efc_force[address[i] + k]
        for k in range(3):
            for j in range(3):
                forces[i, j] += along[k] * frames[i, 3 * k + j]
    return forces


@numba.njit(cache=True, nogil=True)
def _by_pair(geoms, elements, forces, frames, positions, dist, margins, first_normal, face_normals, rotations, extents):
    """Shells in ascending order, pair by pair what touches them, and contact by contact how; see `by_target`.

    `first_normal` is the row of a shell's first triangle among the normals, by geom id, and -1 for other geoms.
    """
    most = 2 * len(geoms)
    pair, source, count = np.empty(most, np.int64), np.empty(most, np.int64), 0
    for i in range(len(geoms)):
        for side in range(2):
            target, other = geoms[i, side], geoms[i, 1 - side]
            if target >= 0 and other >= 0 and first_normal[target] >= 0:
                pair[count], source[count] = target * len(extents) + other, 2 * i + side
                count += 1
    order = np.argsort(pair[:count], kind="mergesort")
    starts, targets = np.empty(count + 1, np.int64), np.empty(count, np.int64)
    others, begins = np.empty(count, np.int64), np.empty(count + 1, np.int64)
    points, loads, normals = np.empty((count, 3)), np.empty(count), np.empty((count, 3))
    found, pairs, rows, begin = 0, 0, 0, 0
    while begin < count:
        target, other = divmod(pair[order[begin]], len(extents))
        first, sum_of_weights = rows, 0.0
        whole, mean = np.zeros(3), np.zeros(3)
        while begin < count and pair[order[begin]] == target * len(extents) + other:
            i, side = divmod(source[order[begin]], 2)
            begin += 1
            sign = 1.0 if side else -1.0
            outward = -sign * frames[i, :3]
            normal = outward
            # a plane touches vertices, which are no element, and its own normal is right
            if elements[i, side] >= 0:
                normal = rotations[target].copy().reshape(3, 3) @ face_normals[first_normal[target] + elements[i, side]]
            whole += sign * forces[i]
            force, along = (forces[i] * frames[i, :3]).sum(), (outward * normal).sum()
            if force <= 0 or along <= _SIDEWAYS:
                continue
            mean += force * outward
            weight = force * along**2
            sum_of_weights += weight
            # the other's surface, which has got in by a depth, and from there to as far outside of the target's own
            depth = margins[i] - dist[i]
            outside = depth + min(depth, extents[other])
            points[rows] = positions[i] - sign * dist[i] / 2 * frames[i, :3] + outside * normal
            loads[rows], normals[rows] = weight, normal
            rows += 1
        length = np.sqrt((mean**2).sum())
        if rows == first or -(whole * mean).sum() <= 0:
            rows = first
            continue
        loads[first:rows] *= -(whole * mean).sum() / length / sum_of_weights
        if found == 0 or target != targets[found - 1]:
            targets[found], starts[found] = target, pairs
            found += 1
        others[pairs], begins[pairs] = other, first
        pairs += 1
    starts[found], begins[pairs] = pairs, rows
    return (
        starts[: found + 1],
        targets[:found],
        others[:pairs],
        begins[: pairs + 1],
        points[:rows],
        loads[:rows],
        normals[:rows],
    )
