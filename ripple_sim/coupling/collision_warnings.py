"""Warnings of targets that nothing can touch, or whose collisions are off the surface that ripples."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import igl
import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray

from ripple_sim.solver import Atlas

from .geoms import TARGET_TYPES
from .model import CoupledModel, flex_thickness
from .target_mesh import mesh_arrays, primitive_triangles

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
    V, F, _ = mesh_arrays(model, int(model.geom_dataid[geom]))
    if kind == "mesh" and not coupled.has_flex[geom]:
        hull = trimesh.convex.convex_hull(V)
        V, F = np.array(hull.vertices), np.array(hull.faces)
    return V, F


# A collision surface off the true one by this share of the target's size shows: bodies stop in mid-air. The coarse
# tolerance is for geoms that were made to collide in place of a finer one.
GAP_TOLERANCE, COARSE_TOLERANCE = 0.02, 0.1

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
    model = coupled.model
    if model.geom_type[geom] == _GEOM.mjGEOM_MESH and (model.geom_contype[geom] or model.geom_conaffinity[geom]):
        return _hull_warning(coupled.names[geom], atlas)
    return _distance_warning(coupled, geom)


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
