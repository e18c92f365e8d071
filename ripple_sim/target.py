"""The targets of a MuJoCo model: which geom, which surface, and its atlas in the geom's own frame."""

from __future__ import annotations

import mujoco
import numpy as np
import trimesh

from ripple_sim.solver import Atlas, Mesh, build_atlas, sphere_atlas

from .errors import SceneError

_GEOM = mujoco.mjtGeom
TARGET_TYPES = {
    int(getattr(_GEOM, f"mjGEOM_{name.upper()}")): name
    for name in ("mesh", "sdf", "sphere", "ellipsoid", "capsule", "cylinder", "box")
}

# Primitives are cut into triangles of about this share of their size before they are mapped.
_FINENESS = 1 / 24


def geom_name(model: mujoco.MjModel, geom: int) -> str:
    """Name of a geom, or "geom <id>" where it has none."""
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom) or f"geom {geom}"


def find_target(model: mujoco.MjModel, name: str) -> int:
    """Id of the geom that shall ripple.

    Raises
    ------
    SceneError
        If there is no such geom, or its type has no closed surface.
    """
    geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name)
    if geom < 0:
        names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, i) for i in range(model.ngeom)]
        known = ", ".join(repr(n) for n in names if n) or "none (give the geom a name in the MJCF)"
        raise SceneError(f"the model has no geom {name!r}; its named geoms are {known}")
    if int(model.geom_type[geom]) not in TARGET_TYPES:
        kind = _GEOM(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
        raise SceneError(
            f"geom {name!r} is a {kind}, which cannot ripple; valid are {', '.join(TARGET_TYPES.values())}"
        )
    return geom


def target_atlas(model: mujoco.MjModel, geom: int, resolution: int) -> Atlas:
    """Atlas of a geom's surface in the geom's frame [m].

    Raises
    ------
    MeshError
        If the geom's mesh is not a closed genus-0 surface.
    """
    if TARGET_TYPES[int(model.geom_type[geom])] == "sphere":
        return sphere_atlas(float(model.geom_size[geom, 0]), resolution)
    return build_atlas(_target_mesh(model, geom), resolution)


def _target_mesh(model: mujoco.MjModel, geom: int) -> Mesh:
    kind, size = TARGET_TYPES[int(model.geom_type[geom])], model.geom_size[geom]
    name = f"mesh of geom {geom_name(model, geom)!r}"
    if kind in ("mesh", "sdf"):
        mesh = model.geom_dataid[geom]
        first_vertex, first_face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        V = model.mesh_vert[first_vertex : first_vertex + model.mesh_vertnum[mesh]]
        F = model.mesh_face[first_face : first_face + model.mesh_facenum[mesh]]
        return Mesh.from_arrays(V, F, name=name)
    if kind == "ellipsoid":
        solid = trimesh.creation.icosphere(subdivisions=4)
        solid.apply_scale(size)
    elif kind == "capsule":
        solid = trimesh.creation.capsule(height=2 * size[1], radius=size[0], count=(48, 48))
        solid.apply_translation([0, 0, -solid.bounds.mean(axis=0)[2]])
    elif kind == "cylinder":
        solid = trimesh.creation.cylinder(radius=size[0], height=2 * size[1], sections=64)
    else:
        solid = trimesh.creation.box(extents=2 * size)
    longest = float(np.max(solid.extents)) * _FINENESS
    V, F = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, max_edge=longest)
    return Mesh.from_arrays(V, F, name=name)
