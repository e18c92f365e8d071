"""What touches in MuJoCo's contacts: geoms, also by their flex or convex colliders, and vertices of soft flexes."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.kernel import Floats, Ints, Ints32, kernel

from .contacts import contiguous
from .model import CoupledModel


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
