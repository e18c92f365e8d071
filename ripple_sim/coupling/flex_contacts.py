"""MuJoCo's contacts with flex colliders: the sum of whole forces, in place of that of normal ones."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import RippleWarning
from ripple_sim.solver import Mesh
from ripple_sim.solver.kernel import Bools, Floats, Ints

from .model import CoupledModel

# Cosine between the normals of a contact and of the surface, up to which MuJoCo is taken to push sideways: geoms that
# hit an edge or a corner push at down to 0.5.
_SIDEWAYS = 0.1

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
    is_target : bool [c]
        By collider id, whether it is a target with a flex collider.
    """

    def __init__(self, coupled: CoupledModel, meshes: Mapping[int, Mesh]) -> None:
        model, flexes, count = coupled.model, coupled.flex_colliders, len(coupled.owners)
        self.is_target, self._is_sheet = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
        self._extents, self._names = coupled.extents, coupled.names
        # outward unit normals of all triangles, in the frames of the geoms, and the row of a target's first one
        self._normals, self._first = np.zeros((model.nflexelem, 3)), np.full(count, -1)
        for geom in flexes.keys() & meshes.keys():
            first = model.flex_elemadr[flexes[geom]]
            normals = _outward_normals(model, geom, flexes[geom], meshes[geom])
            self._normals[first : first + len(normals)] = normals
            self._first[geom], self.is_target[geom], self._is_sheet[geom] = first, True, not meshes[geom].closed
        # amounts of the sums of forces [N], and the part of them that neither a normal force nor friction explains
        self._amounts, self._warned = np.zeros((count, 2)), set[int]()

    def loads(
        self, data: mujoco.MjData, contacts: Ints, sides: Ints, targets: Ints, others: Ints, starts: Ints, along: Floats
    ) -> tuple[Bools, Floats, Floats, Floats]:
        """Contacts that share the sum of the whole forces of their pair; pairs whose sum does not push are left out.

        Parameters
        ----------
        data : mujoco.MjData
        contacts, sides, targets, others : int64 [k]
            Contacts on these targets, pair by pair; see `PairRows`.
        starts : int64 [p]
            The first of each pair.
        along : float64 [k, 3]
            Their forces along the axes of their frames [N].

        Returns
        -------
        kept : bool [k]
        points, forces, normals
            Of those that are kept; see `Contacts`.
        """
        each, counts = data.contact, np.diff(np.append(starts, len(contacts)))
        frames, sign = each.frame[contacts].reshape(-1, 3, 3), np.where(sides == 1, 1.0, -1.0)[:, None]
        outward = -sign * frames[:, 0]
        normals = self._surface_normals(data, each.elem[contacts, sides], targets, outward)
        straight = np.einsum("ij,ij->i", outward, normals)
        behind = self._is_sheet[targets] & (straight < 0)
        normals[behind], straight[behind] = -normals[behind], -straight[behind]
        kept = (along[:, 0] > 0) & (straight > _SIDEWAYS)
        pushes = np.where(kept, along[:, 0], 0.0)
        whole = np.add.reduceat(sign * np.einsum("ki,kij->kj", along, frames), starts)
        mean = np.add.reduceat(pushes[:, None] * outward, starts)
        length = np.linalg.norm(mean, axis=1)
        force = np.where(length > 0, -np.einsum("ij,ij->i", whole, mean) / np.where(length > 0, length, 1.0), 0.0)
        friction = np.where(each.dim[contacts] > 1, each.friction[contacts, :2].max(axis=1), 0.0)
        self._judge(targets[starts], force, np.linalg.norm(whole, axis=1), np.maximum.reduceat(friction, starts))
        kept &= np.repeat(force > 0, counts)
        weights = np.where(kept, pushes * straight**2, 0.0)
        sums = np.add.reduceat(weights, starts)
        forces = weights * np.repeat(force / np.where(sums > 0, sums, 1.0), counts)
        # from the other geom's surface, which is in by a depth, to as far outside the target's own
        depth = each.includemargin[contacts] - each.dist[contacts]
        outside = depth + np.minimum(depth, self._extents[others])
        met = each.pos[contacts] - sign * each.dist[contacts, None] / 2 * frames[:, 0]
        return kept, (met + outside[:, None] * normals)[kept], forces[kept], normals[kept]

    def _surface_normals(self, data: mujoco.MjData, elements: Ints, targets: Ints, outward: Floats) -> Floats:
        """Normals of the surface at contacts with elements, [k, 3].

        A plane touches vertices, which are no element, and its own normal is right.
        """
        rotations = data.geom_xmat[targets].reshape(-1, 3, 3)
        normals = np.einsum("kij,kj->ki", rotations, self._normals[self._first[targets] + elements])
        return np.where(elements[:, None] >= 0, normals, outward)

    def _judge(self, targets: Ints, force: Floats, amount: Floats, friction: Floats) -> None:
        """Warn, once for each, of targets whose forces are not those of a contact.

        Parameters
        ----------
        targets : int64 [p]
            Of each pair.
        force, amount : float64 [p]
            Its force along the mean normal, and the amount of its whole force [N].
        friction : float64 [p]
            Its greatest coefficient of friction.
        """
        across = np.minimum(np.sqrt(np.maximum(amount**2 - force**2, 0.0)), friction * force)
        unexplained = amount - np.where(force > 0, np.hypot(force, across), 0.0)
        self._amounts *= _MEMORY
        np.add.at(self._amounts, targets, np.column_stack([amount, unexplained]))
        for target in np.flatnonzero(self._amounts[:, 1] > _UNEXPLAINED * self._amounts[:, 0]).tolist():
            if target in self._warned:
                continue
            self._warned.add(target)
            name, share = self._names[target], self._amounts[target, 1] / self._amounts[target, 0]
            warnings.warn(
                f"the impulses on geom {name!r} are wrong by about {share:.1%}: MuJoCo pushes sideways what touches "
                "its flex, where a geom has sunk in or edges and corners meet; use a shorter time step, no override of "
                f'contact margins, or make_collidable(spec, {name!r}, "sdf")',
                RippleWarning,
                stacklevel=8,
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
