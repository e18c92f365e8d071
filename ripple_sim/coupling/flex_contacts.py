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

# Up to this cosine between the normals of a contact and of the surface MuJoCo counts as pushing
# sideways. The cosine is 0.5 or more for geoms that hit an edge or a corner.
_MAX_SIDEWAYS_COSINE = 0.1

# Share of the forces on a target that may be pushes sideways.
_MAX_UNEXPLAINED = 0.01

# Factor by which forces of past steps count less with each step.
_MEMORY = 0.99

# Keeps a division by the length of a normal finite [m^2].
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
        # amounts of the sums of forces on each target [N], and the part of the amounts that neither
        # a normal force nor friction explains
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
            Forces of the contacts along the axes of their frames [N].

        Returns
        -------
        shares : bool [k]
            Whether a contact has a share in the force of its pair.
        points, forces, normals
            Of the contacts that have a share; see `Contacts`.
        """
        contact = data.contact
        counts = np.diff(np.append(starts, len(contacts)))
        frames = contact.frame[contacts].reshape(-1, 3, 3)
        # -1 where the first axis of the frame points away from the target
        sign = np.where(sides == 1, 1.0, -1.0)[:, None]
        outward = -sign * frames[:, 0]
        elements = contact.elem[contacts, sides]
        normals, cosines = self._surface_normals(data, targets, elements, outward)
        shares = (along[:, 0] > 0) & (cosines > _MAX_SIDEWAYS_COSINE)
        pushes = np.where(shares, along[:, 0], 0.0)
        # the force of each pair: its vector sum, and its part along the mean normal
        force_sums = np.add.reduceat(sign * np.einsum("ki,kij->kj", along, frames), starts)
        mean_normals = np.add.reduceat(pushes[:, None] * outward, starts)
        lengths = np.linalg.norm(mean_normals, axis=1)
        along_mean = -np.einsum("ij,ij->i", force_sums, mean_normals)
        pair_forces = np.where(lengths > 0, along_mean / np.where(lengths > 0, lengths, 1.0), 0.0)
        has_friction = contact.dim[contacts] > 1
        friction = np.where(has_friction, contact.friction[contacts, :2].max(axis=1), 0.0)
        self._judge(
            targets[starts],
            pair_forces,
            np.linalg.norm(force_sums, axis=1),
            np.maximum.reduceat(friction, starts),
        )
        shares &= np.repeat(pair_forces > 0, counts)
        weights = np.where(shares, pushes * cosines**2, 0.0)
        weight_sums = np.add.reduceat(weights, starts)
        force_per_weight = pair_forces / np.where(weight_sums > 0, weight_sums, 1.0)
        forces = weights * np.repeat(force_per_weight, counts)
        # from the surface of the other geom, which has sunk in by a depth, to a place that is as
        # far outside the surface of the target
        depths = contact.includemargin[contacts] - contact.dist[contacts]
        steps_outwards = depths + np.minimum(depths, self._extents[others])
        half_gaps = contact.dist[contacts, None] / 2
        on_other = contact.pos[contacts] - sign * half_gaps * frames[:, 0]
        points = on_other + steps_outwards[:, None] * normals
        return shares, points[shares], forces[shares], normals[shares]

    def _surface_normals(
        self, data: mujoco.MjData, targets: Ints, elements: Ints, outward: Floats
    ) -> tuple[Floats, Floats]:
        """Unit normals of the triangles that are touched, in the world, on the side of the contact.

        Parameters
        ----------
        data : mujoco.MjData
        targets : int64 [k]
            Target of each contact.
        elements : int64 [k]
            Triangle of each contact within its flex; -1 for a vertex.
        outward : float64 [k, 3]
            Normals of the contacts, from the targets outwards.

        Returns
        -------
        normals : float64 [k, 3]
        cosines : float64 [k]
            Between the normals of the contacts and of the triangles.
        """
        rotations = data.geom_xmat[targets].reshape(-1, 3, 3)
        rows = self._first[targets] + elements
        normals = np.einsum("kij,kj->ki", rotations, self._normals[rows])
        # a plane touches vertices, which are no element, and its own normal is right
        normals = np.where(elements[:, None] >= 0, normals, outward)
        cosines = np.einsum("ij,ij->i", outward, normals)
        is_behind = self._is_sheet[targets] & (cosines < 0)
        normals[is_behind] = -normals[is_behind]
        cosines[is_behind] = -cosines[is_behind]
        return normals, cosines

    def _judge(self, targets: Ints, force: Floats, amount: Floats, friction: Floats) -> None:
        """Warn once for each target whose forces do not come from a contact.

        Parameters
        ----------
        targets : int64 [p]
            Target of each pair.
        force, amount : float64 [p]
            Force of each pair along the mean normal, and amount of its whole force [N].
        friction : float64 [p]
            Greatest coefficient of friction of each pair.
        """
        across = np.sqrt(np.maximum(amount**2 - force**2, 0.0))
        across = np.minimum(across, friction * force)
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
    # the normals point outwards where the volume inside the triangles is positive
    outward = np.sign(np.einsum("ij,ij->", normals, corners[:, 0])) if mesh.closed else 1.0
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return outward * normals / np.maximum(lengths, _MIN_LENGTH)
