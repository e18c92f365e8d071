"""`CoupledModel`: what a MuJoCo model says about what collides, computed once and shared by all steps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

import mujoco
import numpy as np
from numpy.typing import NDArray

from .collision_geoms import find_collision_geoms
from .contact_masks import ContactMasks
from .convex_colliders import find_convex_colliders
from .flex_colliders import find_flex_colliders, flex_thickness
from .flex_vertices import vertex_flexes, vertex_spacing
from .geoms import geom_name
from .soft import SoftSurface
from .soft_ids import is_soft, soft_names

_GEOM = mujoco.mjtGeom
_ENDLESS = (int(_GEOM.mjGEOM_PLANE), int(_GEOM.mjGEOM_HFIELD))
_NOT_CONVEX = (int(_GEOM.mjGEOM_SDF), int(_GEOM.mjGEOM_HFIELD))

# Footprint radius of a contact over the touching geom's smallest half-extent: about the patch of a ball that is sunk in
# by an eighth of its radius.
_FOOTPRINT = 0.5

_NONE_NAMED: Mapping[int, Sequence[int]] = MappingProxyType({})


class CoupledModel:
    """The geoms of a MuJoCo model as the coupling sees them.

    A mesh geom may collide through a flex, its flex collider: then the flex's contact settings are the geom's. It may
    collide through its convex parts, which then touch as that geom. Of any other flex each vertex is a collider.
    Collider ids are those of the geoms, and after them one for each vertex, each flex and each skin; there are c of
    them. A flex or a skin that ripples touches as a whole, with the last ones, see `soft_ids`. A target may have
    collision geoms, whose contacts load it; see `find_collision_geoms`.

    Parameters
    ----------
    model : mujoco.MjModel
    targets : iterable of int
        Geom ids, and of soft targets.
    named : mapping
        Of some targets' ids to those of their collision geoms.

    Attributes
    ----------
    model : mujoco.MjModel
    names : list of str
        Of all geoms, see `geom_name`, and then of all flexes and skins.
    owners : int64 [c]
        What a collider is part of, by its place among the names: a geom itself, or the flex of a vertex.
    bodies : int64 [c]
        The body of each collider, -1 for vertices between several.
    flex_colliders : dict of int to int
        Geom id to the id of its flex collider.
    convex_colliders : dict of int to list of int
        Geom id to the ids of its convex colliders.
    has_flex : bool [ngeom]
        Whether a geom collides through a flex.
    extents : float64 [c]
        Smallest half-extents [m]; infinite for planes and height fields, the spacing of a flex's vertices for them.
    collider_extents : float64 [ngeom]
        Of the geoms alone, with the thickness of its flex where a geom has one [m].
    solref : float64 [ngeom, 2]
        Of what collides, the geom or its flex.
    footprint_radii : float64 [c]
        Footprint radius of a contact with each collider [m]; of a pair the smaller one counts.
    convex : bool [c]
        Whether what touches at two points touches between them too.
    masks : ContactMasks
    soft : dict of int to SoftSurface
        The soft targets.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        targets: Iterable[int] = (),
        named: Mapping[int, Sequence[int]] = _NONE_NAMED,
    ) -> None:
        self.model = model
        geoms, softs = range(model.ngeom), model.nflex + model.nskin
        self.names = [geom_name(model, geom) for geom in geoms] + soft_names(model)
        whole = model.ngeom + np.arange(softs)
        self.owners = np.concatenate([geoms, model.ngeom + vertex_flexes(model), whole]).astype(np.int64)
        self.bodies = np.concatenate([model.geom_bodyid, model.flex_vertbodyid, np.full(softs, -1)]).astype(np.int64)
        self.flex_colliders = find_flex_colliders(model)
        self.convex_colliders = find_convex_colliders(model)
        self.has_flex = np.zeros(model.ngeom, dtype=np.bool_)
        self.has_flex[list(self.flex_colliders)] = True
        extents = np.where(np.isin(model.geom_type, _ENDLESS), np.inf, model.geom_aabb[:, 3:].min(axis=1))
        self.collider_extents, self.solref = extents.copy(), model.geom_solref.copy()
        for geom, flex in self.flex_colliders.items():
            self.collider_extents[geom], self.solref[geom] = flex_thickness(model, flex), model.flex_solref[flex]
        spacing = vertex_spacing(model)
        endless = np.full(softs, np.inf)
        self.extents = np.concatenate([extents, spacing, endless])
        self.footprint_radii = np.concatenate([_FOOTPRINT * extents, spacing, endless])
        convex = ~np.isin(model.geom_type, _NOT_CONVEX) & ~self.has_flex
        convex[[geom for geom, parts in self.convex_colliders.items() if len(parts) > 1]] = False
        self.convex = np.concatenate([convex, np.zeros(model.nflexvert + softs, dtype=np.bool_)])
        self.masks = ContactMasks(model, self.flex_colliders, self.convex_colliders)
        targets = list(targets)
        self.soft = {each: SoftSurface(model, each) for each in targets if is_soft(model, each)}
        for target, surface in self.soft.items():
            self.footprint_radii[target] = surface.spacing
        geoms_alone = [each for each in targets if each not in self.soft]
        self._collision_geoms = find_collision_geoms(model, self.masks.collides, geoms_alone, named)

    def collision_geoms(self, geom: int) -> tuple[int, ...]:
        """Geoms whose contacts are those of this one: itself, or of a target those that collide for it."""
        return self._collision_geoms.get(geom, (geom,))

    def masks_match(self, geom: int) -> NDArray[np.bool_]:
        """Geoms, [ngeom], that MuJoCo may collide with this one, or with those that collide for it."""
        return self.masks.match(self.collision_geoms(geom))

    def can_collide(self, geom: int) -> NDArray[np.bool_]:
        """The same on bodies that are not welded to that of this geom."""
        return self.masks_match(geom) & self.masks.apart(geom)
