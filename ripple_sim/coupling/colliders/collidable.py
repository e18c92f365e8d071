"""Collision with the true surface: a geom's route to it, and how far its convex hull is off."""

from __future__ import annotations

import mujoco
import numpy as np
import trimesh

from ripple_sim.coupling.model.target import contact_masks, geom_name, shell_thickness, shells
from ripple_sim.errors import SceneError
from ripple_sim.solver import Atlas

from .flex_shell import GAP_TOLERANCE, add_shell, remove_shell
from .tunnelling import SPECULATIVE

_GEOM = mujoco.mjtGeom
ROUTES = ("sdf", "flex", "hull")

# Starting points of MuJoCo's search for contacts with a signed distance: fewer miss contacts, its default of 40 costs
# five times as much.
SDF_INITPOINTS = 10


def make_collidable(spec: mujoco.MjSpec, geom: str, route: str = "sdf") -> mujoco.MjsGeom:
    """Let a mesh geom collide as its true surface.

    Primitive geoms do so by themselves and are left as they are. For them and for hulls MuJoCo's speculative contacts
    are enabled where the version has them (from 4 on): fast bodies are then stopped in time. SDF geoms have none.

    Parameters
    ----------
    spec : mujoco.MjSpec
        Changed in place, before it is compiled. A route taken before is left again.
    geom : str
        Name of a geom.
    route : str
        "sdf": as its signed distance, which MuJoCo computes when it compiles the model; for moving targets too, and
        right for bodies of all shapes. Only a plane meets the mesh's convex hull, and height fields nothing at all.
        "flex": through a rigid flex of its triangles, with the geom's name and on its body; the geom itself stays for
        looks and mass. Planes and height fields meet it too. A step takes half to a sixth of the time of a signed
        distance with up to ten thousand triangles, as long with forty thousand. Right for spheres, capsules and
        ellipsoids, and for cylinders and meshes that get in by less than 0.7 of the shell's thickness (2 to 5 % of the
        mesh's size). Boxes may be thrown aside, and SDF geoms sink in; both are warned of. See `add_shell`.
        "hull": as its convex hull, MuJoCo's way for mesh geoms: fast, and right for convex meshes only.

    Returns
    -------
    mujoco.MjsGeom
        The geom.

    Raises
    ------
    SceneError
        For an unknown route or geom, or a specification from which no flex can be made.
    MeshError
        If the mesh of a flex is not a closed genus-0 surface.
    """
    if route not in ROUTES:
        raise SceneError(f"collision route {route!r} is not known; valid are {', '.join(map(repr, ROUTES))}")
    found = spec.geom(geom)
    if found is None:
        names = ", ".join(repr(g.name) for g in spec.geoms if g.name)
        raise SceneError(f"the specification has no geom {geom!r}; its named geoms are {names or 'none'}")
    if not found.meshname or route == "hull":
        spec.option.enableflags |= SPECULATIVE
    if not found.meshname:
        return found
    remove_shell(spec, found)
    found.type = _GEOM.mjGEOM_SDF if route == "sdf" else _GEOM.mjGEOM_MESH
    if route == "sdf":
        spec.option.sdf_initpoints = min(spec.option.sdf_initpoints, SDF_INITPOINTS)
    elif route == "flex":
        add_shell(spec, found)
    return found


def collides_as_hull(model: mujoco.MjModel, geom: int) -> bool:
    """Whether bodies meet the convex hull of a geom's mesh in place of its surface."""
    touches = model.geom_contype[geom] or model.geom_conaffinity[geom]
    return bool(touches) and int(model.geom_type[geom]) == int(_GEOM.mjGEOM_MESH)


def hull_gap(atlas: Atlas) -> float:
    """Greatest distance from the convex hull of a mesh to its surface [m], on points 1/24 of its size apart."""
    hull = trimesh.Trimesh(atlas.mesh.V, atlas.mesh.F, process=False).convex_hull
    points, _ = trimesh.remesh.subdivide_to_size(hull.vertices, hull.faces, max_edge=float(hull.extents.max()) / 24)
    closest, _ = atlas.project(points)
    return float(np.linalg.norm(points - closest, axis=1).max())


def hull_warning(name: str, atlas: Atlas) -> str | None:
    """What to warn of where the hull of a geom is off its surface by more than can be overlooked, else None."""
    gap, size = hull_gap(atlas), float(np.ptp(atlas.mesh.V, axis=0).max())
    if gap <= GAP_TOLERANCE * size:
        return None
    return (
        f"geom {name!r} collides as its convex hull, up to {gap:.3g} m ({gap / size:.0%} of its size) off the surface "
        f'that ripples; give it type="sdf" in the MJCF, or call make_collidable(spec, {name!r})'
    )


def shell_warning(model: mujoco.MjModel, geom: int) -> str | None:
    """What to warn of where the flex that stands for a geom meets others in a way that nobody wants, else None."""
    flex, body, name = shells(model)[geom], int(model.geom_bodyid[geom]), geom_name(model, geom)
    types, affinities = contact_masks(model)
    weld = model.body_weldid[model.geom_bodyid]
    meets = ((types[geom] & affinities) | (affinities[geom] & types) != 0) & (weld != weld[geom])
    reasons = (
        (
            model.geom_type == _GEOM.mjGEOM_BOX,
            "MuJoCo may throw boxes aside, and impulses be off by a tenth, though not with box-shaped meshes",
        ),
        (
            model.geom_type == _GEOM.mjGEOM_SDF,
            f"SDF geoms sink {shell_thickness(model, flex):.2g} m into it before they are pushed out",
        ),
        (
            np.isin(model.geom_bodyid, _kept_apart(model, body)),
            "MuJoCo does not keep a flex apart from bodies that are joined to its own or excluded",
        ),
    )
    found = [
        f"{why} ({', '.join(repr(geom_name(model, other)) for other in np.flatnonzero(which & meets).tolist())})"
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
