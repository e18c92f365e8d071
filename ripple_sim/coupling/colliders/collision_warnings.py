"""Warnings of targets whose collisions are off their true surface."""

from __future__ import annotations

import mujoco
import numpy as np
import trimesh

from ripple_sim.coupling.model.coupled_model import CoupledModel
from ripple_sim.coupling.model.flex_colliders import flex_thickness
from ripple_sim.solver import Atlas

from .flex_collider import GAP_TOLERANCE

_GEOM = mujoco.mjtGeom


def collision_warning(coupled: CoupledModel, geom: int, atlas: Atlas) -> str | None:
    """What to warn of where a target collides other than as its true surface, else None."""
    if coupled.has_flex[geom]:
        return _flex_warning(coupled, geom)
    if _collides_as_hull(coupled.model, geom):
        return _hull_warning(coupled.names[geom], atlas)
    return None


def hull_gap(atlas: Atlas) -> float:
    """Greatest distance from the convex hull of a mesh to its surface [m], on points 1/24 of its size apart."""
    hull = trimesh.Trimesh(atlas.mesh.V, atlas.mesh.F, process=False).convex_hull
    points, _ = trimesh.remesh.subdivide_to_size(hull.vertices, hull.faces, max_edge=float(hull.extents.max()) / 24)
    closest, _ = atlas.project(points)
    return float(np.linalg.norm(points - closest, axis=1).max())


def _collides_as_hull(model: mujoco.MjModel, geom: int) -> bool:
    collides = model.geom_contype[geom] or model.geom_conaffinity[geom]
    return bool(collides) and int(model.geom_type[geom]) == int(_GEOM.mjGEOM_MESH)


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
