"""`CoupledModel`: what a MuJoCo model says about geoms as colliders, computed once and shared by all steps."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from .flex_colliders import find_flex_colliders, flex_thickness
from .geoms import geom_name

_GEOM = mujoco.mjtGeom
_ENDLESS = (int(_GEOM.mjGEOM_PLANE), int(_GEOM.mjGEOM_HFIELD))
_NOT_CONVEX = (int(_GEOM.mjGEOM_SDF), int(_GEOM.mjGEOM_HFIELD))

# Footprint radius of a contact over the touching geom's smallest half-extent: about the patch of a ball that is sunk in
# by an eighth of its radius.
_FOOTPRINT = 0.5


class CoupledModel:
    """The geoms of a MuJoCo model as the coupling sees them.

    A mesh geom may collide through a flex, its flex collider: then the flex's contact settings are the geom's.

    Parameters
    ----------
    model : mujoco.MjModel

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

    def __init__(self, model: mujoco.MjModel) -> None:
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

    def masks_match(self, geom: int) -> NDArray[np.bool_]:
        """Geoms, [ngeom], whose contype and conaffinity (or their flexes') let MuJoCo collide them with this one."""
        types, affinities = self._contype, self._conaffinity
        return (types[geom] & affinities | types & affinities[geom]) != 0

    def can_collide(self, geom: int) -> NDArray[np.bool_]:
        """Geoms of other bodies, [ngeom], whose masks match those of this one."""
        return self.masks_match(geom) & (self.model.geom_bodyid != self.model.geom_bodyid[geom])
