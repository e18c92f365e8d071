"""Warnings of targets whose collisions are off their true surface."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from ripple_sim.solver import Atlas

from .flex_collider import GAP_TOLERANCE
from .flex_colliders import flex_thickness
from .model import CoupledModel
from .surface_gap import collision_gap, hull_gap

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
