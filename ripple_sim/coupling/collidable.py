"""Collision with the true surface: a geom's route to it, and how far its convex hull is off."""

from __future__ import annotations

import mujoco
import numpy as np
import trimesh

from ripple_sim.solver import Atlas

from ..errors import SceneError
from .speeds import SPECULATIVE

_GEOM = mujoco.mjtGeom
ROUTES = ("sdf", "hull")

# Starting points of MuJoCo's search for contacts with a signed distance: fewer miss contacts, its default of 40 costs
# five times as much.
SDF_INITPOINTS = 10

# A hull this share of the target's size off its surface is seen: bodies stop in mid-air.
HULL_TOLERANCE = 0.02


def make_collidable(spec: mujoco.MjSpec, geom: str, route: str = "sdf") -> mujoco.MjsGeom:
    """Let a mesh geom collide as its true surface.

    Primitive geoms do so by themselves and are left as they are. For them and for hulls MuJoCo's speculative contacts
    are enabled where the version has them (from 4 on): fast bodies are then stopped in time. SDF geoms have none.

    Parameters
    ----------
    spec : mujoco.MjSpec
        Changed in place, before it is compiled.
    geom : str
        Name of a geom.
    route : str
        "sdf": as its signed distance, which MuJoCo computes when it compiles the model; for moving targets too. A plane
        still meets the mesh's convex hull, and height fields do not collide with it at all.
        "hull": as its convex hull, MuJoCo's way for mesh geoms: fast, and right for convex meshes only.

        A rigid flex of the mesh's triangles is no route. Its contacts are those of single triangles, and of a flat
        surface too many triangles touch a box or a cylinder edge-on: the normal forces on a box at rest added up to 14
        times, on a cylinder to 19 times the momentum that was exchanged (spheres, capsules and ellipsoids were right;
        MuJoCo 3.17). Besides it is a thin shell, which bodies pass at 20 m/s and a time step of 2 ms.

    Returns
    -------
    mujoco.MjsGeom
        The geom.

    Raises
    ------
    SceneError
        For an unknown route or geom.
    """
    if route not in ROUTES:
        flex = " (flat bodies get sideways forces from a flex's triangles, and fast ones pass through its thin shell)"
        reason = flex if route == "flex" else ""
        raise SceneError(
            f"collision route {route!r} is not supported{reason}; valid are {', '.join(map(repr, ROUTES))}"
        )
    found = spec.geom(geom)
    if found is None:
        names = ", ".join(repr(g.name) for g in spec.geoms if g.name)
        raise SceneError(f"the specification has no geom {geom!r}; its named geoms are {names or 'none'}")
    if not found.meshname or route == "hull":
        spec.option.enableflags |= SPECULATIVE
    if not found.meshname:
        return found
    found.type = _GEOM.mjGEOM_SDF if route == "sdf" else _GEOM.mjGEOM_MESH
    if route == "sdf":
        spec.option.sdf_initpoints = min(spec.option.sdf_initpoints, SDF_INITPOINTS)
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
    if gap <= HULL_TOLERANCE * size:
        return None
    return (
        f"geom {name!r} collides as its convex hull, up to {gap:.3g} m ({gap / size:.0%} of its size) off the surface "
        f'that ripples; give it type="sdf" in the MJCF, or call make_collidable(spec, {name!r})'
    )
