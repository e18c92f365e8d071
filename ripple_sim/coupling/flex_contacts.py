"""Contacts with flex colliders: the load is the sum of their whole forces."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Mesh
from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.kernel import Bools, Floats, Ints

from .geoms import rotation_in_body
from .ids import FlexId, GeomId
from .model import CoupledModel
from .target_warnings import CLOSED_ADVICE

# Cosine between the normals of a contact and of the surface, up to which MuJoCo is taken to push
# sideways: geoms that hit an edge or a corner push at down to 0.5.
_MAX_SIDEWAYS_COSINE = 0.1

# Share of the forces on a target that may be pushes sideways.
_MAX_UNEXPLAINED = 0.01

# Forces of past steps count less by this factor with each step.
_MEMORY = 0.99

# Lengths of normals are divided by no less than this.
_MIN_LENGTH = np.finfo(np.float64).tiny


class FlexContacts:
    """Contacts with flex colliders.

    Where the rim of a flat geom crosses a triangle, MuJoCo pushes sideways, and the friction of
    such contacts pushes along the normal. These forces cancel in pairs, but their amounts do not:
    they add up to many times the momentum exchanged. So the load of a pair is the sum of its whole
    forces along its mean normal. Contacts that push sideways count neither for that normal nor for
    the place of the load.

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

    def __init__(self, coupled: CoupledModel, meshes: Mapping[GeomId, Mesh]) -> None:
        model = coupled.model
        flexes = coupled.flex_colliders
        ids = len(coupled.owners)
        self.is_target = np.zeros(ids, dtype=np.bool_)
        self._is_sheet = np.zeros(ids, dtype=np.bool_)
        self._extents = coupled.extents
        self._names = coupled.names
        # outward unit normals of all triangles, in the frames of the geoms
        self._normals = np.zeros((model.nflexelem, 3))
        # the row of each target's first normal
        self._first = np.full(ids, -1)
        for geom in flexes.keys() & meshes.keys():
            flex = flexes[geom]
            mesh = meshes[geom]
            first = model.flex_elemadr[flex]
            count = model.flex_elemnum[flex]
            self._normals[first : first + count] = _outward_normals(model, geom, flex, mesh)
            self._first[geom] = first
            self.is_target[geom] = True
            self._is_sheet[geom] = not mesh.closed
        # amounts of the sums of forces on each target [N], and the part of them that neither a
        # normal force nor friction explains
        self._amounts = np.zeros((ids, 2))
        self._warned = set[int]()

    def loads(
        self,
        data: mujoco.MjData,
        contacts: Ints,
        sides: Ints,
        targets: Ints,
        others: Ints,
        starts: Ints,
        along: Floats,
    ) -> tuple[Bools, Floats, Floats, Floats]:
        """Contacts with their shares of the whole force of their pair.

        Pairs whose whole force does not push are left out.

        Parameters
        ----------
        data : mujoco.MjData
        contacts, sides, targets, others : int64 [k]
            Contacts on these targets, pair by pair; see `pair_rows`.
        starts : int64 [p]
            The first of each pair.
        along : float64 [k, 3]
            Their forces along the axes of their frames [N].

        Returns
        -------
        kept : bool [k]
            Which contacts share in the force of their pair.
        points, forces, normals
            Of the contacts that are kept; see `Contacts`.
        """
        contact = data.contact
        counts = np.diff(np.append(starts, len(contacts)))
        frames = contact.frame[contacts].reshape(-1, 3, 3)
        sign = np.where(sides == 1, 1.0, -1.0)[:, None]
        outward = -sign * frames[:, 0]
        rotations = data.geom_xmat[targets].reshape(-1, 3, 3)
        elements = contact.elem[contacts, sides]
        normals = np.einsum("kij,kj->ki", rotations, self._normals[self._first[targets] + elements])
        # a plane touches vertices, which are no element, and its own normal is right
        normals = np.where(elements[:, None] >= 0, normals, outward)
        straight = np.einsum("ij,ij->i", outward, normals)
        behind = self._is_sheet[targets] & (straight < 0)
        normals[behind] = -normals[behind]
        straight[behind] = -straight[behind]
        kept = (along[:, 0] > 0) & (straight > _MAX_SIDEWAYS_COSINE)
        pushes = np.where(kept, along[:, 0], 0.0)
        whole = np.add.reduceat(sign * np.einsum("ki,kij->kj", along, frames), starts)
        mean = np.add.reduceat(pushes[:, None] * outward, starts)
        length = np.linalg.norm(mean, axis=1)
        along_mean = -np.einsum("ij,ij->i", whole, mean)
        force = np.where(length > 0, along_mean / np.where(length > 0, length, 1.0), 0.0)
        friction = np.where(
            contact.dim[contacts] > 1, contact.friction[contacts, :2].max(axis=1), 0.0
        )
        self._judge(
            targets[starts],
            force,
            np.linalg.norm(whole, axis=1),
            np.maximum.reduceat(friction, starts),
        )
        kept &= np.repeat(force > 0, counts)
        weights = np.where(kept, pushes * straight**2, 0.0)
        sums = np.add.reduceat(weights, starts)
        forces = weights * np.repeat(force / np.where(sums > 0, sums, 1.0), counts)
        # from the other geom's surface, which is in by a depth, to as far outside the target's own
        depth = contact.includemargin[contacts] - contact.dist[contacts]
        outside = depth + np.minimum(depth, self._extents[others])
        met = contact.pos[contacts] - sign * contact.dist[contacts, None] / 2 * frames[:, 0]
        return kept, (met + outside[:, None] * normals)[kept], forces[kept], normals[kept]

    def _judge(self, targets: Ints, force: Floats, amount: Floats, friction: Floats) -> None:
        """Warn once for each target whose forces do not come from a contact.

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
        wrong = self._amounts[:, 1] > _MAX_UNEXPLAINED * self._amounts[:, 0]
        for target in np.flatnonzero(wrong).tolist():
            if target in self._warned:
                continue
            self._warned.add(target)
            name = self._names[target]
            share = self._amounts[target, 1] / self._amounts[target, 0]
            other_route = f'make_collidable(spec, {name!r}, "sdf")'
            if self._is_sheet[target]:
                other_route = CLOSED_ADVICE
            warn_caller(
                f"the impulses on geom {name!r} are wrong by about {share:.1%}: MuJoCo pushes "
                "sideways what touches its flex, where a geom has sunk in or edges and corners "
                "meet; use a shorter time step, no override of contact margins, or "
                f"{other_route}"
            )


def _outward_normals(
    model: mujoco.MjModel, geom: GeomId, flex: FlexId, mesh: Mesh
) -> NDArray[np.float64]:
    """Outward unit normals of a flex collider's triangles in the geom's frame, [m, 3]."""
    begin = model.flex_elemdataadr[flex]
    count = model.flex_elemnum[flex]
    F = model.flex_elem[begin : begin + 3 * count].reshape(-1, 3)
    V = mesh.V
    if not np.array_equal(F, mesh.F):
        # a flex not made by `make_collidable`
        first_vertex = model.flex_vertadr[flex]
        in_body = model.flex_vert[first_vertex:][: model.flex_vertnum[flex]]
        V = in_body @ rotation_in_body(model, geom)
    corners = V[F]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # they point outwards where the volume that they enclose is positive
    outward = np.sign(np.einsum("ij,ij->", normals, corners[:, 0])) if mesh.closed else 1.0
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return outward * normals / np.maximum(lengths, _MIN_LENGTH)
