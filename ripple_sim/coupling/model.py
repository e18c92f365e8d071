"""`CoupledModel`: what collides in a MuJoCo model, computed once and shared by all steps.

It says which geoms and flexes MuJoCo lets touch each other, and what collides in place of a mesh
geom: geoms of its convex parts (convex colliders), or a rigid flex of its triangles (flex
collider). Of a soft flex each vertex touches for itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Mesh

from .collision_geoms import ENDLESS, find_collision_geoms
from .geoms import geom_name
from .ids import ColliderId, FlexId, GeomId, TargetId, geom_id, is_geom
from .soft import SoftSurface, soft_names

# The flag that enables MuJoCo's speculative contacts, which it has from version 4 on; 0 before.
SPECULATIVE = int(getattr(mujoco.mjtEnableBit, "mjENBL_SPECULATIVE", 0))

_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
_SDF = int(mujoco.mjtGeom.mjGEOM_SDF)
_HFIELD = int(mujoco.mjtGeom.mjGEOM_HFIELD)

# Types of geoms for which convex parts may collide.
_TYPES_WITH_PARTS = (_MESH, _SDF)

# Types of geoms that need not touch between two points of contact.
_TYPES_NOT_CONVEX = (_SDF, _HFIELD)

# MuJoCo's state of a body that does not sleep.
_AWAKE = int(mujoco.mjtSleepState.mjS_AWAKE)

# Footprint radius of a contact over the touching geom's smallest half-extent: about the patch of a
# ball that is sunk in by an eighth of its radius.
_FOOTPRINT_SHARE = 0.5


def part_name(geom: str, index: int) -> str:
    """Name of a convex part of a geom: the name of its collider, and of the collider's mesh."""
    return f"{geom}#{index}"


def find_convex_colliders(model: mujoco.MjModel) -> dict[GeomId, list[GeomId]]:
    """Convex colliders by the id of the geom that they collide for, which does not collide itself.

    They are mesh geoms on the body of that geom. Their names are its name, "#" and a number.
    """
    parts_by_geom: dict[GeomId, list[GeomId]] = {}
    for part in map(geom_id, np.flatnonzero(model.geom_type == _MESH).tolist()):
        geom = _whole_geom(model, part)
        if geom is None:
            continue
        if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            parts_by_geom.setdefault(geom, []).append(part)
    return parts_by_geom


def _whole_geom(model: mujoco.MjModel, part: GeomId) -> GeomId | None:
    """The geom that a convex part belongs to by its name and body, if there is one."""
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, part) or ""
    whole_name, mark, number = name.rpartition("#")
    if not mark or not number.isdecimal():
        return None
    geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, whole_name)
    if geom < 0 or model.geom_type[geom] not in _TYPES_WITH_PARTS:
        return None
    on_same_body = model.geom_bodyid[geom] == model.geom_bodyid[part]
    return GeomId(geom) if on_same_body else None


def find_flex_colliders(model: mujoco.MjModel) -> dict[GeomId, FlexId]:
    """The flexes that collide instead of a geom, by geom id.

    Such a flex is rigid, consists of triangles, and has the name and the body of the geom.
    """
    flex_by_geom: dict[GeomId, FlexId] = {}
    for flex in range(model.nflex):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex)
        if not name:
            continue
        geom = geom_id(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name))
        if geom < 0 or model.flex_dim[flex] != 2 or not model.flex_rigid[flex]:
            continue
        first_vertex = model.flex_vertadr[flex]
        if model.flex_vertbodyid[first_vertex] == model.geom_bodyid[geom]:
            flex_by_geom[geom] = FlexId(flex)
    return flex_by_geom


def flex_thickness(model: mujoco.MjModel, flex: FlexId) -> float:
    """Distance from its triangles at which a flex holds other geoms off [m]."""
    return float(model.flex_margin[flex] + model.flex_radius[flex])


def _edge_lengths(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Mean length of the edges of each flex [m], [nflex]; 0 for a flex without edges."""
    lengths = []
    for first, count in zip(model.flex_edgeadr, model.flex_edgenum, strict=True):
        edges = model.flexedge_length0[first : first + count]
        lengths.append(edges.mean() if count else 0.0)
    return np.array(lengths)


def _vertex_spacing(mesh: Mesh) -> float:
    """Mean distance between neighbouring vertices [m].

    The place of a contact is not known more closely.
    """
    V = mesh.V
    F = mesh.F
    edges = V[F] - V[np.roll(F, 1, axis=1)]
    return float(np.linalg.norm(edges, axis=2).mean())


class CoupledModel:
    """The geoms of a MuJoCo model as the coupling sees them.

    A mesh geom may collide through a flex, its flex collider; the flex's contact settings are then
    the geom's. It may collide through its convex parts, which then touch as the geom. Of any other
    flex each vertex is a collider. A target may have collision geoms, whose contacts load it; see
    `find_collision_geoms`.

    There are c collider ids, see `ids`. A flex or a skin that ripples touches as a whole.

    Parameters
    ----------
    model : mujoco.MjModel
    targets : iterable of TargetId
    named : mapping, optional
        Geom that is a target to the collision geoms that the user names for it.

    Attributes
    ----------
    model : mujoco.MjModel
    names : list of str
        Of all geoms, see `geom_name`, then of all flexes and skins.
    owners : int64 [c]
        Index among the names of the geom, flex or skin that a collider is, or is a vertex of.
    bodies : int64 [c]
        The body of each collider; -1 for vertices between several bodies.
    flex_colliders : dict of GeomId to FlexId
        Geom to its flex collider.
    convex_colliders : dict of GeomId to list of GeomId
        Geom to its convex colliders.
    has_flex : bool [c]
        Whether a geom collides through a flex.
    extents : float64 [c]
        Smallest half-extents [m]. They are infinite for planes and height fields; for a vertex of
        a flex, the mean length of the flex's edges.
    collider_extents : float64 [ngeom]
        Smallest half-extents of the geoms [m]; of a geom with a flex collider, the flex's
        thickness.
    solref : float64 [ngeom, 2]
        Contact setting of the geom or of its flex, whichever collides.
    footprint_radii : float64 [c]
        Footprint radius of a contact with each collider [m]; of a pair the smaller one counts.
    convex : bool [c]
        Whether a collider that touches at two points touches between them too.
    soft : dict of TargetId to SoftSurface
        The flexes and skins among the targets.
    of_geom : int64 [ngeom]
        Id of the geom, flex or skin that a geom collides for, or its own.
    of_flex : int64 [nflex + 1]
        Id of the geom that a flex collides for, or the flex's target id if it is a target; -1 for
        other flexes, and after the last flex.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        targets: Iterable[TargetId] = (),
        named: Mapping[GeomId, Sequence[GeomId]] | None = None,
    ) -> None:
        self.model = model
        geoms = [geom_id(i) for i in range(model.ngeom)]
        soft_count = model.nflex + model.nskin
        # the flex of each vertex of a flex
        vertex_flexes = np.repeat(np.arange(model.nflex), model.flex_vertnum)
        self.names = [geom_name(model, geom) for geom in geoms] + soft_names(model)
        soft_owners = model.ngeom + np.arange(soft_count)
        owners = [geoms, model.ngeom + vertex_flexes, soft_owners]
        self.owners = np.concatenate(owners).astype(np.int64)
        bodies = [model.geom_bodyid, model.flex_vertbodyid, np.full(soft_count, -1)]
        self.bodies = np.concatenate(bodies).astype(np.int64)
        self.flex_colliders = find_flex_colliders(model)
        self.convex_colliders = find_convex_colliders(model)
        self.has_flex = np.zeros(len(self.owners), dtype=np.bool_)
        self.has_flex[list(self.flex_colliders)] = True
        is_endless = np.isin(model.geom_type, ENDLESS)
        half_extents = np.where(is_endless, np.inf, model.geom_aabb[:, 3:].min(axis=1))
        self.collider_extents = half_extents.copy()
        self.solref = model.geom_solref.copy()
        self._take_settings()
        self._soft_flexes = np.setdiff1d(np.arange(model.nflex), list(self.flex_colliders.values()))
        spacing = _edge_lengths(model)[vertex_flexes]
        endless = np.full(soft_count, np.inf)
        self.extents = np.concatenate([half_extents, spacing, endless])
        radii = [_FOOTPRINT_SHARE * half_extents, spacing, endless]
        self.footprint_radii = np.concatenate(radii)
        convex = ~np.isin(model.geom_type, _TYPES_NOT_CONVEX) & ~self.has_flex[: model.ngeom]
        for geom, parts in self.convex_colliders.items():
            if len(parts) > 1:
                convex[geom] = False
        not_convex = np.zeros(model.nflexvert + soft_count, dtype=np.bool_)
        self.convex = np.concatenate([convex, not_convex])
        targets = list(targets)
        self.soft = {
            target: SoftSurface(model, target) for target in targets if not is_geom(target, model)
        }
        for target, surface in self.soft.items():
            self.footprint_radii[target] = _vertex_spacing(surface.mesh)
        rigid_targets = [target for target in targets if is_geom(target, model)]
        self._collision_geoms = find_collision_geoms(
            model, self._collides, rigid_targets, named or {}
        )
        self.of_geom = np.arange(model.ngeom)
        self.of_flex = np.full(model.nflex + 1, -1)
        self._assign_colliders()

    def _take_settings(self) -> None:
        """Take masks and settings of each geom from its flex or its convex colliders."""
        model = self.model
        contype = model.geom_contype.copy()
        conaffinity = model.geom_conaffinity.copy()
        for geom, flex in self.flex_colliders.items():
            self.collider_extents[geom] = flex_thickness(model, flex)
            self.solref[geom] = model.flex_solref[flex]
            contype[geom] = model.flex_contype[flex]
            conaffinity[geom] = model.flex_conaffinity[flex]
        for geom, parts in self.convex_colliders.items():
            contype[geom] = model.geom_contype[parts[0]]
            conaffinity[geom] = model.geom_conaffinity[parts[0]]
            contype[parts] = 0
            conaffinity[parts] = 0
        self._contype = contype
        self._conaffinity = conaffinity
        self._collides = (contype | conaffinity).astype(np.bool_)
        in_pair = np.isin(np.arange(model.ngeom), [model.pair_geom1, model.pair_geom2])
        self._collides |= in_pair

    def _assign_colliders(self) -> None:
        """Say what each geom and each flex collides for."""
        for geom, parts in self.convex_colliders.items():
            self.of_geom[parts] = geom
        for geom, flex in self.flex_colliders.items():
            self.of_flex[flex] = geom
        for target, surface in self.soft.items():
            self.of_geom[surface.geoms] = target
            if surface.flex >= 0:
                self.of_flex[surface.flex] = target

    def collision_geoms(self, geom: GeomId) -> tuple[GeomId, ...]:
        """Geoms whose contacts load this one: the geoms that collide for a target, or itself."""
        return self._collision_geoms.get(geom, (geom,))

    def are_still(self, data: mujoco.MjData, colliders: Sequence[ColliderId]) -> bool:
        """Whether all colliders sleep or are static, so that they press as before.

        Vertices between several bodies never sleep.
        """
        bodies = self.bodies[list(colliders)]
        return bool((bodies >= 0).all() and (data.body_awake[bodies] != _AWAKE).all())

    def can_collide(self, geom: GeomId) -> NDArray[np.bool_]:
        """Geoms, [ngeom], that MuJoCo may collide with this one, or with geoms that collide for it.

        Explicit pairs count too. The geoms are on bodies that are not welded to this geom's body.
        """
        model = self.model
        types = self._contype
        affinities = self._conaffinity
        can = np.zeros(model.ngeom, dtype=np.bool_)
        for solid in self.collision_geoms(geom):
            can |= (types[solid] & affinities | types & affinities[solid]) != 0
            can[model.pair_geom2[model.pair_geom1 == solid]] = True
            can[model.pair_geom1[model.pair_geom2 == solid]] = True
        return can & self._apart(geom)

    def out_of_touch(self, geom: GeomId) -> bool:
        """Whether geoms or flexes collide in the model, but none of them can touch this geom."""
        if self.can_collide(geom).any() or len(self.soft_flexes(geom)):
            return False
        others = self._collides & self._apart(geom)
        return bool(len(self._soft_flexes) or others.any())

    def soft_flexes(self, geom: GeomId) -> NDArray[np.int64]:
        """Flexes that MuJoCo may collide with this geom, or with geoms that collide for it.

        Flex colliders are left out.
        """
        model = self.model
        soft = self._soft_flexes
        solids = list(self.collision_geoms(geom))
        types = model.flex_contype[soft, None]
        affinities = model.flex_conaffinity[soft, None]
        meets = (self._contype[solids] & affinities | types & self._conaffinity[solids]) != 0
        return soft[meets.any(axis=1)]

    def _apart(self, geom: GeomId) -> NDArray[np.bool_]:
        """Geoms, [ngeom], on bodies that are not welded to the body of this geom."""
        weld = self.model.body_weldid[self.model.geom_bodyid]
        return np.asarray(weld != weld[geom])
