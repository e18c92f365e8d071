"""`CoupledModel`: what collides in a MuJoCo model, computed once and shared by all steps.

It says which geoms and flexes MuJoCo lets touch each other, and what collides in place of a mesh
geom: geoms of its convex parts (convex colliders), or a rigid flex of its triangles (flex
collider). Of a soft flex each vertex touches for itself. The load of a flex collider is the sum of
the whole forces of its contacts, not of the normal forces alone; see `FlexContacts`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Mesh
from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.kernel import Bools, Floats, Ints

from .collision_geoms import ENDLESS, find_collision_geoms
from .geoms import geom_name, rotation_in_body
from .soft import SoftSurface, is_soft, soft_names

# The flag that enables MuJoCo's speculative contacts, which it has from version 4 on; 0 before.
SPECULATIVE = int(getattr(mujoco.mjtEnableBit, "mjENBL_SPECULATIVE", 0))

_VISIBLE = (int(mujoco.mjtGeom.mjGEOM_MESH), int(mujoco.mjtGeom.mjGEOM_SDF))

_NOT_CONVEX = (int(mujoco.mjtGeom.mjGEOM_SDF), int(mujoco.mjtGeom.mjGEOM_HFIELD))
_AWAKE = int(mujoco.mjtSleepState.mjS_AWAKE)

# Footprint radius of a contact over the touching geom's smallest half-extent: about the patch of a
# ball that is sunk in by an eighth of its radius.
_FOOTPRINT = 0.5

# Cosine between the normals of a contact and of the surface, up to which MuJoCo is taken to push
# sideways: geoms that hit an edge or a corner push at down to 0.5.
_SIDEWAYS = 0.1

# Share of the forces on a target that may be pushes sideways; old ones count less with each step.
_UNEXPLAINED = 0.01
_MEMORY = 0.99
_TINY = np.finfo(np.float64).tiny


def part_name(geom: str, index: int) -> str:
    """Name of a convex part of a geom: of its collider, and of that one's mesh."""
    return f"{geom}#{index}"


def find_convex_colliders(model: mujoco.MjModel) -> dict[int, list[int]]:
    """Convex colliders by the id of their geom, which does not collide itself.

    They are mesh geoms on its body, called by its name, "#" and a number.
    """
    found: dict[int, list[int]] = {}
    for part in np.flatnonzero(model.geom_type == _VISIBLE[0]).tolist():
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, part) or ""
        whole, mark, number = name.rpartition("#")
        geom = (
            mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, whole)
            if mark and number.isdecimal()
            else -1
        )
        if (
            geom < 0
            or model.geom_type[geom] not in _VISIBLE
            or model.geom_bodyid[geom] != model.geom_bodyid[part]
        ):
            continue
        if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            found.setdefault(geom, []).append(part)
    return found


def find_flex_colliders(model: mujoco.MjModel) -> dict[int, int]:
    """Flex that collides in place of a geom, by geom id.

    It is rigid, of triangles, and has the geom's name and body.
    """
    found = {}
    for flex in range(model.nflex):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex)
        geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name) if name else -1
        if geom < 0 or model.flex_dim[flex] != 2 or not model.flex_rigid[flex]:
            continue
        if model.flex_vertbodyid[model.flex_vertadr[flex]] == model.geom_bodyid[geom]:
            found[geom] = flex
    return found


def flex_thickness(model: mujoco.MjModel, flex: int) -> float:
    """Distance from its triangles at which a flex holds other geoms off [m]."""
    return float(model.flex_margin[flex] + model.flex_radius[flex])


class CoupledModel:
    """The geoms of a MuJoCo model as the coupling sees them.

    A mesh geom may collide through a flex, its flex collider: then the flex's contact settings are
    the geom's. It may collide through its convex parts, which then touch as that geom. Of any other
    flex each vertex is a collider. Collider ids are those of the geoms, and after them one for each
    vertex, each flex and each skin; there are c of them. A flex or a skin that ripples touches as a
    whole, with the last ones, see `find_soft`. A target may have collision geoms, whose contacts
    load it; see `find_collision_geoms`.

    Parameters
    ----------
    model : mujoco.MjModel
    targets : iterable of int
        Geom ids, and of soft targets.
    named : mapping, optional
        Of some targets' ids to those of their collision geoms.

    Attributes
    ----------
    model : mujoco.MjModel
    names : list of str
        Of all geoms, see `geom_name`, and then of all flexes and skins.
    owners : int64 [c]
        What a collider is part of, by its place among the names: a geom itself, or the flex of a
        vertex.
    bodies : int64 [c]
        The body of each collider, -1 for vertices between several.
    flex_colliders : dict of int to int
        Geom id to the id of its flex collider.
    convex_colliders : dict of int to list of int
        Geom id to the ids of its convex colliders.
    has_flex : bool [c]
        Whether a geom collides through a flex.
    extents : float64 [c]
        Smallest half-extents [m]; infinite for planes and height fields, the spacing of a flex's
        vertices for them.
    collider_extents : float64 [ngeom]
        Of the geoms alone, with the thickness of its flex where a geom has one [m].
    solref : float64 [ngeom, 2]
        Of what collides, the geom or its flex.
    footprint_radii : float64 [c]
        Footprint radius of a contact with each collider [m]; of a pair the smaller one counts.
    convex : bool [c]
        Whether what touches at two points touches between them too.
    soft : dict of int to SoftSurface
        The soft targets.
    of_geom : int64 [ngeom]
        Collider id of each geom: its own, or of what it collides for.
    of_flex : int64 [nflex + 1]
        Geom that a flex collides for, or itself where it is a target; -1 for none, and after the
        last flex.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        targets: Iterable[int] = (),
        named: Mapping[int, Sequence[int]] | None = None,
    ) -> None:
        self.model = model
        geoms = range(model.ngeom)
        softs = model.nflex + model.nskin
        self.names = [geom_name(model, geom) for geom in geoms] + soft_names(model)
        vertex_flexes = np.repeat(np.arange(model.nflex), model.flex_vertnum)
        whole = model.ngeom + np.arange(softs)
        self.owners = np.concatenate([geoms, model.ngeom + vertex_flexes, whole]).astype(np.int64)
        self.bodies = np.concatenate(
            [model.geom_bodyid, model.flex_vertbodyid, np.full(softs, -1)]
        ).astype(np.int64)
        self.flex_colliders = find_flex_colliders(model)
        self.convex_colliders = find_convex_colliders(model)
        self.has_flex = np.zeros(len(self.owners), dtype=np.bool_)
        self.has_flex[list(self.flex_colliders)] = True
        extents = np.where(
            np.isin(model.geom_type, ENDLESS), np.inf, model.geom_aabb[:, 3:].min(axis=1)
        )
        self.collider_extents = extents.copy()
        self.solref = model.geom_solref.copy()
        # the masks of what collides: the geom, its flex, or its convex colliders
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
            contype[parts] = conaffinity[parts] = 0
        self._contype = contype
        self._conaffinity = conaffinity
        self._collides = (contype | conaffinity).astype(np.bool_)
        self._collides |= np.isin(np.arange(model.ngeom), [model.pair_geom1, model.pair_geom2])
        self._soft_flexes = np.setdiff1d(np.arange(model.nflex), list(self.flex_colliders.values()))
        edges = zip(model.flex_edgeadr, model.flex_edgenum, strict=True)
        lengths = [
            model.flexedge_length0[i : i + count].mean() if count else 0.0 for i, count in edges
        ]
        spacing = np.array(lengths)[vertex_flexes]
        endless = np.full(softs, np.inf)
        self.extents = np.concatenate([extents, spacing, endless])
        self.footprint_radii = np.concatenate([_FOOTPRINT * extents, spacing, endless])
        convex = ~np.isin(model.geom_type, _NOT_CONVEX) & ~self.has_flex[: model.ngeom]
        convex[[geom for geom, parts in self.convex_colliders.items() if len(parts) > 1]] = False
        self.convex = np.concatenate([convex, np.zeros(model.nflexvert + softs, dtype=np.bool_)])
        targets = list(targets)
        self.soft = {each: SoftSurface(model, each) for each in targets if is_soft(model, each)}
        for target, surface in self.soft.items():
            # the mean distance between vertices side by side: no contact is known more closely
            V = surface.mesh.V
            F = surface.mesh.F
            self.footprint_radii[target] = np.linalg.norm(
                V[F] - V[np.roll(F, 1, axis=1)], axis=2
            ).mean()
        geoms_alone = [each for each in targets if each not in self.soft]
        self._collision_geoms = find_collision_geoms(
            model, self._collides, geoms_alone, named or {}
        )
        self.of_geom = np.arange(model.ngeom)
        self.of_flex = np.full(model.nflex + 1, -1)
        for geom, parts in self.convex_colliders.items():
            self.of_geom[parts] = geom
        for geom, flex in self.flex_colliders.items():
            self.of_flex[flex] = geom
        for target, surface in self.soft.items():
            self.of_geom[surface.geoms] = target
            if surface.flex >= 0:
                self.of_flex[surface.flex] = target

    def collision_geoms(self, geom: int) -> tuple[int, ...]:
        """Geoms whose contacts load this one: the geoms that collide for a target, or itself."""
        return self._collision_geoms.get(geom, (geom,))

    def are_still(self, data: mujoco.MjData, colliders: Sequence[int]) -> bool:
        """Whether all colliders sleep or are static, so that they press as before.

        Vertices between several bodies never sleep.
        """
        bodies = self.bodies[list(colliders)]
        return bool((bodies >= 0).all() and (data.body_awake[bodies] != _AWAKE).all())

    def can_collide(self, geom: int) -> NDArray[np.bool_]:
        """Geoms, [ngeom], that MuJoCo may collide with this one, or with geoms that collide for it.

        Explicit pairs count too. The geoms are on bodies that are not welded to this geom's body.
        """
        model = self.model
        types = self._contype
        affinities = self._conaffinity
        found = np.zeros(model.ngeom, dtype=np.bool_)
        pairs = (model.pair_geom1, model.pair_geom2)
        for each in self.collision_geoms(geom):
            found |= (types[each] & affinities | types & affinities[each]) != 0
            for one, two in (pairs, pairs[::-1]):
                found[two[one == each]] = True
        return found & self._apart(geom)

    def out_of_touch(self, geom: int) -> bool:
        """Whether geoms or flexes collide in the model, but none of them can touch this geom."""
        meets = self.can_collide(geom).any() or len(self.soft_flexes(geom))
        return not meets and bool(
            len(self._soft_flexes) or (self._collides & self._apart(geom)).any()
        )

    def soft_flexes(self, geom: int) -> NDArray[np.int64]:
        """Flexes that MuJoCo collides with geoms that collide for this one; no flex colliders."""
        model = self.model
        soft = self._soft_flexes
        of = list(self.collision_geoms(geom))
        types = model.flex_contype[soft, None]
        affinities = model.flex_conaffinity[soft, None]
        return soft[
            ((self._contype[of] & affinities | types & self._conaffinity[of]) != 0).any(axis=1)
        ]

    def _apart(self, geom: int) -> NDArray[np.bool_]:
        """Geoms, [ngeom], on bodies not welded to that of this one."""
        weld = self.model.body_weldid[self.model.geom_bodyid]
        return np.asarray(weld != weld[geom])


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

    def __init__(self, coupled: CoupledModel, meshes: Mapping[int, Mesh]) -> None:
        model = coupled.model
        flexes = coupled.flex_colliders
        ids = len(coupled.owners)
        self.is_target, self._is_sheet = np.zeros((2, ids), dtype=np.bool_)
        self._extents = coupled.extents
        self._names = coupled.names
        # outward unit normals of all triangles, in the frames of the geoms, and the row of a
        # target's first one
        self._normals = np.zeros((model.nflexelem, 3))
        self._first = np.full(ids, -1)
        for geom in flexes.keys() & meshes.keys():
            flex = flexes[geom]
            mesh = meshes[geom]
            first = model.flex_elemadr[flex]
            begin = model.flex_elemdataadr[flex]
            count = model.flex_elemnum[flex]
            F = model.flex_elem[begin : begin + 3 * count].reshape(-1, 3)
            V = mesh.V
            if not np.array_equal(F, mesh.F):
                # a flex not made by `make_collidable`
                own = model.flex_vert[model.flex_vertadr[flex] :][: model.flex_vertnum[flex]]
                V = own @ rotation_in_body(model, geom)
            corners = V[F]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            # they point outwards where the volume that they enclose is positive
            outward = np.sign(np.einsum("ij,ij->", normals, corners[:, 0])) if mesh.closed else 1.0
            normals = (
                outward
                * normals
                / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), _TINY)
            )
            self._normals[first : first + count] = normals
            self._first[geom] = first
            self.is_target[geom] = True
            self._is_sheet[geom] = not mesh.closed
        # amounts of the sums of forces [N], and the part of them that neither a normal force nor
        # friction explains
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
        points, forces, normals
            Of those that are kept; see `Contacts`.
        """
        each = data.contact
        counts = np.diff(np.append(starts, len(contacts)))
        frames = each.frame[contacts].reshape(-1, 3, 3)
        sign = np.where(sides == 1, 1.0, -1.0)[:, None]
        outward = -sign * frames[:, 0]
        rotations = data.geom_xmat[targets].reshape(-1, 3, 3)
        elements = each.elem[contacts, sides]
        normals = np.einsum("kij,kj->ki", rotations, self._normals[self._first[targets] + elements])
        # a plane touches vertices, which are no element, and its own normal is right
        normals = np.where(elements[:, None] >= 0, normals, outward)
        straight = np.einsum("ij,ij->i", outward, normals)
        behind = self._is_sheet[targets] & (straight < 0)
        normals[behind] = -normals[behind]
        straight[behind] = -straight[behind]
        kept = (along[:, 0] > 0) & (straight > _SIDEWAYS)
        pushes = np.where(kept, along[:, 0], 0.0)
        whole = np.add.reduceat(sign * np.einsum("ki,kij->kj", along, frames), starts)
        mean = np.add.reduceat(pushes[:, None] * outward, starts)
        length = np.linalg.norm(mean, axis=1)
        force = np.where(
            length > 0, -np.einsum("ij,ij->i", whole, mean) / np.where(length > 0, length, 1.0), 0.0
        )
        friction = np.where(each.dim[contacts] > 1, each.friction[contacts, :2].max(axis=1), 0.0)
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
        depth = each.includemargin[contacts] - each.dist[contacts]
        outside = depth + np.minimum(depth, self._extents[others])
        met = each.pos[contacts] - sign * each.dist[contacts, None] / 2 * frames[:, 0]
        return kept, (met + outside[:, None] * normals)[kept], forces[kept], normals[kept]

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
        for target in np.flatnonzero(
            self._amounts[:, 1] > _UNEXPLAINED * self._amounts[:, 0]
        ).tolist():
            if target in self._warned:
                continue
            self._warned.add(target)
            name = self._names[target]
            share = self._amounts[target, 1] / self._amounts[target, 0]
            warn_caller(
                f"the impulses on geom {name!r} are wrong by about {share:.1%}: MuJoCo pushes "
                "sideways what touches its flex, where a geom has sunk in or edges and corners "
                "meet; use a shorter time step, no override of contact margins, or "
                f'make_collidable(spec, {name!r}, "sdf")'
            )
