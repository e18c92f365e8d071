"""`make_collidable`: let a mesh geom collide as its true surface."""

from __future__ import annotations

import mujoco

from ripple_sim.errors import SceneError

from .collision_warnings import SPECULATIVE
from .convex_collider import add_convex_collider, convex_parts_of, is_closed, remove_convex_collider
from .flex_collider import add_flex_collider, flex_core, remove_flex_collider

_GEOM = mujoco.mjtGeom
ROUTES = ("auto", "sdf", "flex", "convex", "hull")

# Starting points of MuJoCo's search for contacts with a signed distance. Fewer miss contacts; its default of 40 takes
# five times as long.
SDF_INITPOINTS = 10
# MuJoCo makes room for as many contacts of a pair, but finds up to 50 where the other geom is a mesh.
_MESH_INITPOINTS = 50


def make_collidable(spec: mujoco.MjSpec, geom: str, route: str = "auto") -> mujoco.MjsGeom:
    """Let a mesh geom collide as its true surface.

    Primitive geoms do so by themselves and are left as they are. For them and for hulls MuJoCo's speculative contacts
    are enabled where the version has them (from 4 on): fast geoms are then stopped in time. SDF geoms have none.

    Parameters
    ----------
    spec : mujoco.MjSpec
        Changed in place, before it is compiled. A route taken earlier is undone, but not by one that fails.
    geom : str
        Name of a geom, or "body/index" of an unnamed one, which gets that name. One that collides with nothing gets a
        contype and a conaffinity of 1; other geoms of its body go on colliding.
    route : str
        "auto": "sdf" for a closed mesh, "flex" for an open one.
        "sdf": as a signed distance, which MuJoCo computes when it compiles the model. For moving targets too, and right
        for geoms of all shapes. Only planes meet the mesh's convex hull, and height fields nothing at all.
        "flex": through a rigid flex of its triangles, with the geom's name and on its body; the geom itself keeps its
        looks and mass. Planes and height fields meet it too, and an open mesh is met from both
        sides. A step takes half to a sixth of the time of a signed
        distance with up to ten thousand triangles, and as long with forty thousand. Right for spheres, capsules and
        ellipsoids, and for cylinders and meshes that sink in by less than 0.7 of the flex's thickness (2 to 5 % of the
        mesh's size). Boxes may be thrown aside, and SDF geoms sink in; a warning names both. See `add_flex_collider`.
        "convex": as the convex parts of its mesh, geoms of their own without mass, which CoACD finds in some ten
        seconds and which are then kept in the user's cache (needs the package coacd). The most robust: boxes stack on
        it, and all geoms meet it. Bodies are held up to 2.5 % of the mesh's size off the surface. For closed meshes.
        See `add_convex_collider`.
        "hull": as its convex hull, MuJoCo's way for mesh geoms: fast, and right for convex meshes only.

    Returns
    -------
    mujoco.MjsGeom
        The geom.

    Raises
    ------
    SceneError
        For an unknown route or geom, a specification from which no collider can be made, or a package that is missing.
    MeshError
        If the mesh cannot be used.
    """
    if route not in ROUTES:
        raise SceneError(f"collision route {route!r} is not known; valid are {', '.join(map(repr, ROUTES))}")
    found = _find(spec, geom)
    if found.meshname and route == "auto":
        route = "sdf" if is_closed(spec, found) else "flex"
    # what can fail comes first: then nothing has been changed
    core = flex_core(spec, found) if found.meshname and route == "flex" else None
    parts = convex_parts_of(spec, found) if found.meshname and route == "convex" else None
    if not found.meshname or route in ("convex", "hull"):
        spec.option.enableflags |= SPECULATIVE
    if found.meshname:
        remove_flex_collider(spec, found)
        remove_convex_collider(spec, found)
        found.type = _GEOM.mjGEOM_SDF if route == "sdf" else _GEOM.mjGEOM_MESH
    if not (found.contype or found.conaffinity):
        found.contype = found.conaffinity = 1
    if found.meshname and route == "sdf":
        spec.option.sdf_initpoints = _initpoints(spec, found)
    if core is not None:
        add_flex_collider(spec, found, core)
    if parts is not None:
        add_convex_collider(spec, found, parts)
    return found


def _initpoints(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> int:
    """Starting points for a geom of type sdf among the others of its specification."""
    others = (each for each in spec.geoms if each.name != geom.name and (each.contype or each.conaffinity))
    if any(each.meshname for each in others):
        return max(spec.option.sdf_initpoints, _MESH_INITPOINTS)
    return min(spec.option.sdf_initpoints, SDF_INITPOINTS)


def _find(spec: mujoco.MjSpec, key: str) -> mujoco.MjsGeom:
    """The geom of a name, or of a place among the geoms of its body, which it is then called by."""
    found = spec.geom(key)
    if found is not None:
        return found
    body_name, _, index = key.rpartition("/")
    body = spec.body(body_name) if body_name else None
    if body is not None and index.isdecimal() and int(index) < len(body.geoms):
        found = body.geoms[int(index)]
        found.name = found.name or key
        return found
    names = ", ".join(repr(each.name) for each in spec.geoms if each.name)
    raise SceneError(f"the specification has no geom {key!r}; its named geoms are {names or 'none'}")
