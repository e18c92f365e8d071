"""Warnings of targets whose collisions are off their true surface.

Pairs of geoms that approach each other too fast, found before they touch.

How far the surface that collides lies off the surface that ripples.

Tunnelling: geoms so fast that they would pass through a target or get stuck in it are reported before they touch.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator

import igl
import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray

from ripple_sim.errors import RippleWarning
from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Floats, Ints, Ints32

from .flex_collider import GAP_TOLERANCE
from .geoms import TARGET_TYPES
from .model import CoupledModel, flex_thickness
from .target_mesh import primitive_triangles

# A pair to watch.
APPROACH = np.dtype(
    [
        ("target", np.int64),  # geom ids
        ("other", np.int64),
        ("limit", np.float64),  # depth up to which a contact is safe [m]
        ("range", np.float64),  # distance of the geoms' centres at which they may touch [m]
        ("stopping_time", np.float64),  # depth over speed after the first contact [s]
    ]
)


def too_fast(
    pairs: np.ndarray,
    geom_xpos: Floats,
    cvel: Floats,
    subtree_com: Floats,
    bodies: Ints32,
    timestep: float,
    steps: int,
) -> tuple[Ints, Floats]:
    """Find pairs that may touch within some steps and would sink in beyond their limits.

    Parameters
    ----------
    pairs : APPROACH [p]
    geom_xpos, cvel, subtree_com
        From MuJoCo's data.
    bodies : int32 [ngeom, 2]
        Body of each geom, and the root of that body's tree.
    timestep : float
        [s].
    steps : int

    Returns
    -------
    rows : int64 [k]
        Rows of the pairs.
    speeds : float64 [k]
        Their relative speeds [m/s].
    """
    target, other = pairs["target"], pairs["other"]
    velocities = _velocities(geom_xpos, cvel, subtree_com, bodies)
    away, relative = geom_xpos[other] - geom_xpos[target], velocities[other] - velocities[target]
    distances, speeds = np.linalg.norm(away, axis=1), np.linalg.norm(relative, axis=1)
    near = distances < pairs["range"] + (1 + steps) * speeds * timestep
    approaching = np.einsum("ij,ij->i", away, relative) < 0
    rows = np.flatnonzero(near & approaching & (speeds * (timestep + pairs["stopping_time"]) > pairs["limit"]))
    return rows, speeds[rows]


def _velocities(geom_xpos: Floats, cvel: Floats, subtree_com: Floats, bodies: Ints32) -> Floats:
    """Velocities of all geoms' centres in the world [m/s], [ngeom, 3]."""
    body, root = bodies.T
    # MuJoCo gives a body's velocity at the centre of mass of the tree that it belongs to
    return cvel[body, 3:] + np.cross(cvel[body, :3], geom_xpos - subtree_com[root])


_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
# Points of the rippling surface at which its distance is taken.
_POINTS = 1500


def hull_gap(atlas: Atlas) -> float:
    """Greatest distance from the convex hull of a mesh to its surface [m], on points 1/24 of its size apart."""
    hull = trimesh.Trimesh(atlas.mesh.V, atlas.mesh.F, process=False).convex_hull
    points, _ = trimesh.remesh.subdivide_to_size(hull.vertices, hull.faces, max_edge=float(hull.extents.max()) / 24)
    closest, _ = atlas.project(points)
    return float(np.linalg.norm(points - closest, axis=1).max())


def collision_gap(coupled: CoupledModel, target: int, atlas: Atlas, geoms: Iterable[int]) -> float:
    """How deep bodies sink into a target's surface before they meet the geoms that collide for it [m].

    Or how far above the surface they are held, where that is more: over half of it, since a part of it may well lie
    inside a geom that collides for the target's neighbour too.

    Parameters
    ----------
    coupled : CoupledModel
    target : int
        Geom id.
    atlas : Atlas
        Of the target.
    geoms : iterable of int
        Ids of geoms on its body or on bodies welded to it. Planes and height fields have no surface to be off from.
    """
    model, data = coupled.model, mujoco.MjData(coupled.model)
    mujoco.mj_kinematics(model, data)
    points = atlas.positions.reshape(-1, 3)
    points = points[:: -(-len(points) // _POINTS)]
    points = data.geom_xpos[target] + points @ data.geom_xmat[target].reshape(3, 3).T
    solids = [geom for geom in geoms if TARGET_TYPES.get(int(model.geom_type[geom]), "hfield") != "hfield"]
    if not solids:
        return 0.0
    outside = np.full(len(points), np.inf)
    for geom in solids:
        V, F = _solid(coupled, geom)
        local = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
        outside = np.minimum(outside, igl.signed_distance(local, V, F)[0])
    return float(max(outside.max(), -np.median(outside)))


def _solid(coupled: CoupledModel, geom: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices [m], [n, 3], and triangles of a geom as it collides, in its own frame."""
    model, kind = coupled.model, TARGET_TYPES[int(coupled.model.geom_type[geom])]
    if kind not in ("mesh", "sdf"):
        return primitive_triangles(kind, model.geom_size[geom])
    mesh = model.geom_dataid[geom]
    V = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]].astype(np.float64)
    F = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]].astype(np.int64)
    if kind == "mesh" and not coupled.has_flex[geom]:
        hull = trimesh.convex.convex_hull(V)
        V, F = np.array(hull.vertices), np.array(hull.faces)
    return V, F


# The tolerance for geoms that were made to collide in place of a finer one.
COARSE_TOLERANCE = 0.1

_GEOM = mujoco.mjtGeom


def collision_warnings(coupled: CoupledModel, geom: int, atlas: Atlas) -> Iterator[str]:
    """What to warn of where nothing touches a target, it collides off its surface, or contacts tell no forces."""
    message = _shape_warning(coupled, geom, atlas)
    if message is not None:
        yield message
    passive = getattr(coupled.model, "flex_passive", np.zeros(coupled.model.nflex))  # not in MuJoCo's older versions
    for flex in coupled.masks.soft_flexes(coupled.collision_geoms(geom)).tolist():
        if passive[flex]:
            name = coupled.names[coupled.model.ngeom + flex]
            yield (
                f"MuJoCo tells no forces of the passive contacts of flex {name!r}, under which geom "
                f'{coupled.names[geom]!r} will not ripple; set passive="false" in the flex\'s <contact>'
            )


def _shape_warning(coupled: CoupledModel, geom: int, atlas: Atlas) -> str | None:
    colliders = coupled.collision_geoms(geom)
    if coupled.masks.out_of_touch(geom, colliders):
        return _touch_warning(coupled, geom)
    if any(each != geom for each in colliders) or geom in coupled.convex_colliders:
        return _gap_warning(coupled, geom, atlas)
    if coupled.has_flex[geom]:
        return _flex_warning(coupled, geom)
    if _collides_as_hull(coupled.model, geom):
        return _hull_warning(coupled.names[geom], atlas)
    return _distance_warning(coupled, geom)


def _collides_as_hull(model: mujoco.MjModel, geom: int) -> bool:
    collides = model.geom_contype[geom] or model.geom_conaffinity[geom]
    return bool(collides) and int(model.geom_type[geom]) == int(_GEOM.mjGEOM_MESH)


def _touch_warning(coupled: CoupledModel, geom: int) -> str:
    """Of a target that nothing can touch."""
    model, name, colliders = coupled.model, coupled.names[geom], coupled.collision_geoms(geom)
    if not colliders:
        return (
            f"nothing can touch geom {name!r}: it does not collide (contype and conaffinity are 0), nor does another "
            f"geom of its body; name the geoms that collide for it, contacts={{{name!r}: [...]}}, or give it a contype"
        )
    masks = ", ".join(
        f"{coupled.names[each]!r} has contype {model.geom_contype[each]} and conaffinity {model.geom_conaffinity[each]}"
        for each in colliders
    )
    return f"nothing can touch geom {name!r}: {masks}, which match no geom of a body that is not welded to its own"


def _gap_warning(coupled: CoupledModel, geom: int, atlas: Atlas) -> str | None:
    """Of collision geoms that are visibly off the surface."""
    name, solids = coupled.names[geom], coupled.collision_geoms(geom)
    colliders = [part for each in solids for part in coupled.convex_colliders.get(each, [each])]
    gap, size = collision_gap(coupled, geom, atlas, colliders), float(np.ptp(atlas.mesh.V, axis=0).max())
    if gap <= COARSE_TOLERANCE * size:
        return None
    names = ", ".join(repr(coupled.names[each]) for each in colliders)
    return (
        f"geom {name!r} collides as {names}, up to {gap:.3g} m ({gap / size:.0%} of its size) off the surface that "
        f"ripples: contacts load it where it is nearest to them; name other geoms in contacts=, or call "
        f"make_collidable(spec, {name!r})"
    )


def _hull_warning(name: str, atlas: Atlas) -> str | None:
    """Of a convex hull that is visibly off the surface."""
    gap, size = hull_gap(atlas), float(np.ptp(atlas.mesh.V, axis=0).max())
    if gap <= GAP_TOLERANCE * size:
        return None
    return (
        f"geom {name!r} collides as its convex hull, up to {gap:.3g} m ({gap / size:.0%} of its size) off the surface "
        f'that ripples; give it type="sdf" in the MJCF, or call make_collidable(spec, {name!r})'
    )


def _flex_warning(coupled: CoupledModel, geom: int) -> str | None:
    """Of geoms that a flex collider meets badly, or not at all."""
    model, name = coupled.model, coupled.names[geom]
    body, weld = int(model.geom_bodyid[geom]), model.body_weldid[model.geom_bodyid]
    meets = coupled.masks_match(geom) & (weld != weld[geom])
    thickness = flex_thickness(model, coupled.flex_colliders[geom])
    reasons = (
        (
            model.geom_type == _GEOM.mjGEOM_BOX,
            "MuJoCo may throw boxes ({}) aside, with impulses off by a tenth, though not box-shaped meshes",
        ),
        (
            model.geom_type == _GEOM.mjGEOM_SDF,
            f"SDF geoms ({{}}) sink {thickness:.2g} m into it before they are pushed out",
        ),
        (
            np.isin(model.geom_bodyid, _kept_apart(model, body)),
            "MuJoCo finds no contacts of a flex with bodies that are joined to its own or excluded ({})",
        ),
    )
    found = [
        why.format(", ".join(repr(coupled.names[other]) for other in np.flatnonzero(which & meets).tolist()))
        for which, why in reasons
        if (which & meets).any()
    ]
    if not found:
        return None
    return (
        f'geom {name!r} collides through a flex: {"; ".join(found)}; call make_collidable(spec, {name!r}, "sdf"), or '
        "choose contype and conaffinity so that they do not meet"
    )


def _distance_warning(coupled: CoupledModel, geom: int) -> str | None:
    """Of what an SDF geom does not meet."""
    model, name = coupled.model, coupled.names[geom]
    hills = coupled.can_collide(geom) & (model.geom_type == int(_GEOM.mjGEOM_HFIELD))
    if int(model.geom_type[geom]) != int(_GEOM.mjGEOM_SDF) or not hills.any():
        return None
    names = ", ".join(repr(coupled.names[other]) for other in np.flatnonzero(hills).tolist())
    return (
        f"MuJoCo finds no contacts of the SDF geom {name!r} with height fields ({names}): call "
        f'make_collidable(spec, {name!r}, "flex"), or choose contype and conaffinity so that they do not meet'
    )


def _kept_apart(model: mujoco.MjModel, body: int) -> list[int]:
    """Bodies whose geoms MuJoCo lets pass through those of a body: joined to it, or excluded by name."""
    weld = model.body_weldid
    above = weld[model.body_parentid[weld]]
    joined = (weld != weld[body]) & (weld != 0) & ((above == weld[body]) | (above[body] == weld)) & bool(weld[body])
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        joined[:] = False
    pairs = [(int(signature) >> 16, int(signature) & 0xFFFF) for signature in model.exclude_signature]
    excluded = {b for pair in pairs if body in pair for b in pair if b != body}
    return sorted(excluded.union(np.flatnonzero(joined).tolist()))


_SDF = int(mujoco.mjtGeom.mjGEOM_SDF)
_CYLINDER = int(mujoco.mjtGeom.mjGEOM_CYLINDER)
# The flag that enables MuJoCo's speculative contacts, which it has from version 4 on; 0 before.
SPECULATIVE = int(getattr(mujoco.mjtEnableBit, "mjENBL_SPECULATIVE", 0))

_SAFE = 0.85
# Depth over a geom's smallest half-extent at which contacts with a signed distance begin to push from all sides: seen
# at 1.4, not yet at 1.2.
_SAFE_IN_SDF = 1.2
# Depth over a flex's thickness at which it begins to throw cylinders aside.
_SAFE_IN_FLEX = 0.7
# The check runs once in so many steps, and looks as many steps ahead.
_EVERY = 5


class TunnellingCheck:
    """Compares how deep geoms will sink into the targets with how thick both are.

    A geom that arrives at speed v sinks in by about v dt before MuJoCo sees the contact, and then by v t_stop before
    the contact's spring has stopped it: t_stop = tau zeta exp(-zeta) for a `solref` of time constant tau and damping
    ratio zeta (a critically damped spring at zeta = 1). Past the sum of the two geoms' smallest half-extents it comes
    out on the other side or stays inside; the first that did so were seen at 0.9 of that sum. A geom that is inside an
    SDF geom by more than its own half-extent is pushed from all sides: the normal forces then add up to many times the
    momentum exchanged. A warning is given once for each pair. MuJoCo's speculative contacts, where the version has them
    and they are enabled, stop geoms in time, but not at SDF geoms or flexes: then only those are checked.

    A flex collider holds geoms off by its thickness, which counts in place of the half-extent of its geom. Cylinders
    that sink in by 0.7 of the thickness begin to be thrown aside.

    Parameters
    ----------
    coupled : CoupledModel
    targets : sequence of int
        Geom ids.
    """

    def __init__(self, coupled: CoupledModel, targets: list[int]) -> None:
        self._model, self._names = coupled.model, coupled.names
        self._pairs = _watched_pairs(coupled, targets)
        roots = coupled.model.body_rootid[coupled.model.geom_bodyid]
        self._bodies = np.column_stack([coupled.model.geom_bodyid, roots])
        self._warned = np.zeros(len(self._pairs), dtype=bool)
        self._steps = 0

    def __call__(self, data: mujoco.MjData) -> None:
        """Warn of the pairs that are about to meet too fast. Call it after each physics step."""
        self._steps += 1
        if not len(self._warned) or (self._steps - 1) % _EVERY:
            return
        rows, speeds = too_fast(
            self._pairs,
            data.geom_xpos,
            data.cvel,
            data.subtree_com,
            self._bodies,
            self._model.opt.timestep,
            _EVERY,
        )
        for i, speed in zip(rows.tolist(), speeds.tolist(), strict=True):
            if not self._warned[i]:
                self._warned[i] = True
                warnings.warn(self._message(i, speed), RippleWarning, stacklevel=4)

    def _message(self, i: int, speed: float) -> str:
        model, names, timestep = self._model, self._names, self._model.opt.timestep
        target, other, limit, _, stopping_time = self._pairs[i].item()
        body = model.body(int(model.geom_bodyid[other])).name or names[other]
        needed = limit / speed - stopping_time
        # MuJoCo keeps a contact's time constant at two time steps or more
        advice = (
            f"use a time step of {needed:.2g} s or less"
            if needed > 0
            else f"use a time step of {limit / speed / (1 + 2 / np.e):.2g} s or less, and a solref of twice that"
        )
        return (
            f"body {body!r} meets geom {names[target]!r} at {speed:.3g} m/s and would pass through it, get stuck or "
            f"give a wrong impulse: with a time step of {timestep:.2g} s it sinks in by "
            f"{speed * (timestep + stopping_time):.2g} m, of which {limit:.2g} m are safe; {advice}"
        )


def _watched_pairs(coupled: CoupledModel, targets: list[int]) -> NDArray[np.void]:
    """Pairs of a geom that collides for a target and another geom, which may tunnel, `APPROACH` [p]."""
    model, extents, flex = coupled.model, coupled.collider_extents, coupled.has_flex
    sdf, cylinder = model.geom_type == _SDF, model.geom_type == _CYLINDER
    unchecked = sdf | flex if model.opt.enableflags & SPECULATIVE else np.ones(model.ngeom, dtype=bool)
    pairs = [
        (target, other)
        for target in dict.fromkeys(geom for each in targets for geom in coupled.collision_geoms(each))
        for other in np.flatnonzero(coupled.can_collide(target)).tolist()
        if np.isfinite(extents[other]) and (unchecked[target] or unchecked[other])
    ]
    target, other = np.array(pairs, dtype=np.int64).reshape(-1, 2).T.copy()
    limit = _SAFE * (extents[target] + extents[other])
    for geom, around in ((target, other), (other, target)):
        safe = np.where(sdf[around], _SAFE_IN_SDF * extents[geom], np.inf)
        safe = np.where(flex[around] & cylinder[geom], _SAFE_IN_FLEX * extents[around], safe)
        limit = np.minimum(limit, safe)
    reach = model.geom_rbound[target] + model.geom_rbound[other]
    solref = (coupled.solref[target] + coupled.solref[other]) / 2
    stopping_times = _stopping_times(solref, model.opt.timestep)
    return np.array(list(zip(target, other, limit, reach, stopping_times, strict=True)), APPROACH)


def _stopping_times(solref: NDArray[np.float64], timestep: float) -> NDArray[np.float64]:
    """Depth over speed [s], [k], of contacts with these parameters, [k, 2]."""
    # negative pairs are -stiffness and -damping for each kg: omega = sqrt(stiffness), ratio = damping / (2 omega)
    direct = solref[:, 0] <= 0
    omega = np.sqrt(np.where(direct, np.maximum(-solref[:, 0], 1e-12), 1.0))
    constant = np.maximum(solref[:, 0], 2 * timestep)
    ratio = np.where(direct, -solref[:, 1] / (2 * omega), solref[:, 1])
    period = np.where(direct, 1 / omega, constant * ratio)
    return period * np.exp(-np.clip(ratio, 0, 1))
