"""`make_collidable`: let a mesh geom collide as its true surface."""

from __future__ import annotations

import mujoco

from ripple_sim.errors import SceneError

from .flex_collider import add_flex_collider, remove_flex_collider
from .tunnelling import SPECULATIVE

_GEOM = mujoco.mjtGeom
ROUTES = ("sdf", "flex", "hull")

# Starting points of MuJoCo's search for contacts with a signed distance. Fewer miss contacts; its default of 40 takes
# five times as long.
SDF_INITPOINTS = 10


def make_collidable(spec: mujoco.MjSpec, geom: str, route: str = "sdf") -> mujoco.MjsGeom:
    """Let a mesh geom collide as its true surface.

    Primitive geoms do so by themselves and are left as they are. For them and for hulls MuJoCo's speculative contacts
    are enabled where the version has them (from 4 on): fast geoms are then stopped in time. SDF geoms have none.

    Parameters
    ----------
    spec : mujoco.MjSpec
        Changed in place, before it is compiled. A route taken earlier is undone.
    geom : str
        Name of a geom.
    route : str
        "sdf": as a signed distance, which MuJoCo computes when it compiles the model. For moving targets too, and right
        for geoms of all shapes. Only planes meet the mesh's convex hull, and height fields nothing at all.
        "flex": through a rigid flex of its triangles, with the geom's name and on its body; the geom itself keeps its
        looks and mass. Planes and height fields meet it too. A step takes half to a sixth of the time of a signed
        distance with up to ten thousand triangles, and as long with forty thousand. Right for spheres, capsules and
        ellipsoids, and for cylinders and meshes that sink in by less than 0.7 of the flex's thickness (2 to 5 % of the
        mesh's size). Boxes may be thrown aside, and SDF geoms sink in; a warning names both. See `add_flex_collider`.
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
    remove_flex_collider(spec, found)
    found.type = _GEOM.mjGEOM_SDF if route == "sdf" else _GEOM.mjGEOM_MESH
    if route == "sdf":
        spec.option.sdf_initpoints = min(spec.option.sdf_initpoints, SDF_INITPOINTS)
    elif route == "flex":
        add_flex_collider(spec, found)
    return found
