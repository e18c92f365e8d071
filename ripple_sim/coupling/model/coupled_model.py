"""`CoupledModel`: what a MuJoCo model says about geoms as colliders, computed once and shared by all steps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

import mujoco
import numpy as np
from numpy.typing import NDArray

from .collision_geoms import find_collision_geoms
from .flex_colliders import find_flex_colliders, flex_thickness
from .geoms import geom_name

_GEOM = mujoco.mjtGeom
_ENDLESS = (int(_GEOM.mjGEOM_PLANE), int(_GEOM.mjGEOM_HFIELD))
_NOT_CONVEX = (int(_GEOM.mjGEOM_SDF), int(_GEOM.mjGEOM_HFIELD))

# Footprint radius of a contact over the touching geom's smallest half-extent: about the patch of a ball that is sunk in
# by an eighth of its radius.
_FOOTPRINT = 0.5

_NONE_NAMED: Mapping[int, Sequence[int]] = MappingProxyType({})


class CoupledModel:
    """The geoms of a MuJoCo model as the coupling sees them.

    A mesh geom may collide through a flex, its flex collider: then the flex's contact settings are the geom's. A target
    may have collision geoms, whose contacts load it; see `find_collision_geoms`.

    Parameters
    ----------
    model : mujoco.MjModel
    targets : iterable of int
        Geom ids.
    named : mapping
        Of some targets' ids to those of their collision geoms.

    Attributes
    ----------
    model : mujoco.MjModel
    names : list of str
        Of all geoms; see `geom_name`.
    flex_colliders : dict of int to int
        Geom id to the id of its flex collider.
    has_flex : bool [ngeom]
        Whether a geom collides through a flex.
    extents : float64 [ngeom]
        Smallest half-extents [m]; infinite for planes and height fields.
    collider_extents : float64 [ngeom]
        The same, with the thickness of its flex where a geom has one [m].
    solref : float64 [ngeom, 2]
        Of what collides, the geom or its flex.
    footprint_radii : float64 [ngeom]
        Footprint radius of a contact with each geom [m]; of a pair the smaller one counts.
    convex : bool [ngeom]
        Whether a geom that touches at two points touches between them too.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        targets: Iterable[int] = (),
        named: Mapping[int, Sequence[int]] = _NONE_NAMED,
    ) -> None:
        self.model = model
        self.names = [geom_name(model, geom) for geom in range(model.ngeom)]
        self.flex_colliders = find_flex_colliders(model)
        self.has_flex = np.zeros(model.ngeom, dtype=np.bool_)
        self.has_flex[list(self.flex_colliders)] = True
        self.extents = np.where(np.isin(model.geom_type, _ENDLESS), np.inf, model.geom_aabb[:, 3:].min(axis=1))
        self.collider_extents, self.solref = self.extents.copy(), model.geom_solref.copy()
        self._contype, self._conaffinity = model.geom_contype.copy(), model.geom_conaffinity.copy()
        for geom, flex in self.flex_colliders.items():
            self.collider_extents[geom], self.solref[geom] = flex_thickness(model, flex), model.flex_solref[flex]
            self._contype[geom], self._conaffinity[geom] = model.flex_contype[flex], model.flex_conaffinity[flex]
        self.footprint_radii = _FOOTPRINT * self.extents
        self.convex = ~np.isin(model.geom_type, _NOT_CONVEX) & ~self.has_flex
        paired = np.isin(np.arange(model.ngeom), [model.pair_geom1, model.pair_geom2])
        self._collides = (self._contype | self._conaffinity).astype(np.bool_) | paired
        self._collision_geoms = find_collision_geoms(model, self._collides, targets, named)

    def collision_geoms(self, geom: int) -> tuple[int, ...]:
        """Geoms whose contacts are those of this one: itself, or of a target those that collide for it."""
        return self._collision_geoms.get(geom, (geom,))

    def masks_match(self, geom: int) -> NDArray[np.bool_]:
        """Geoms, [ngeom], whose contype and conaffinity (or their flexes') let MuJoCo collide them with this one."""
        types, affinities = self._contype, self._conaffinity
        match = np.zeros(self.model.ngeom, dtype=np.bool_)
        for each in self.collision_geoms(geom):
            match |= (types[each] & affinities | types & affinities[each]) != 0
            match[self.model.pair_geom2[self.model.pair_geom1 == each]] = True
            match[self.model.pair_geom1[self.model.pair_geom2 == each]] = True
        return match

    def can_collide(self, geom: int) -> NDArray[np.bool_]:
        """Geoms, [ngeom], on bodies not welded to that of this one, whose masks match."""
        return self.masks_match(geom) & self._apart(geom)

    def out_of_touch(self, geom: int) -> bool:
        """Whether a model has geoms or flexes that collide, but none with this geom."""
        meets_flex = self._meets_soft_flex(geom)
        others = (self._collides & self._apart(geom)).any() or len(meets_flex)
        return bool(others) and not self.can_collide(geom).any() and not meets_flex.any()

    def _apart(self, geom: int) -> NDArray[np.bool_]:
        weld = self.model.body_weldid[self.model.geom_bodyid]
        return np.asarray(weld != weld[geom])

    def _meets_soft_flex(self, geom: int) -> NDArray[np.bool_]:
        """Whether the masks of a geom match those of each flex that is no flex collider."""
        model, colliders = self.model, list(self.collision_geoms(geom))
        soft = np.setdiff1d(np.arange(model.nflex), list(self.flex_colliders.values()))
        types, affinities = model.flex_contype[soft, None], model.flex_conaffinity[soft, None]
        match = self._contype[colliders] & affinities | types & self._conaffinity[colliders]
        return np.asarray((match != 0).any(axis=1))
