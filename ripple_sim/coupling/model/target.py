"""The targets of a MuJoCo model: which geom, which surface, its atlas in the geom's own frame, and its shell."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver import Atlas, Mesh, build_atlas, sphere_atlas

_GEOM = mujoco.mjtGeom
TARGET_TYPES = {
    int(getattr(_GEOM, f"mjGEOM_{name.upper()}")): name
    for name in ("mesh", "sdf", "sphere", "ellipsoid", "capsule", "cylinder", "box")
}

# Primitives are cut into triangles of about this share of their size before they are mapped.
_FINENESS = 1 / 24
_SECTIONS = 96  # round a cylinder


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
    return build_atlas(target_mesh(model, geom), resolution)


def target_mesh(model: mujoco.MjModel, geom: int) -> Mesh:
    """Surface of a geom in the geom's frame [m]; see `target_atlas`."""
    kind, size = TARGET_TYPES[int(model.geom_type[geom])], model.geom_size[geom]
    name = f"mesh of geom {geom_name(model, geom)!r}"
    if kind in ("mesh", "sdf"):
        mesh = model.geom_dataid[geom]
        first_vertex, first_face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        V = model.mesh_vert[first_vertex : first_vertex + model.mesh_vertnum[mesh]]
        F = model.mesh_face[first_face : first_face + model.mesh_facenum[mesh]]
        return _textured(Mesh.from_arrays(V, F, name=name), F, _texture_coordinates(model, mesh))
    if kind == "ellipsoid":
        solid = trimesh.creation.icosphere(subdivisions=4)
        solid.apply_scale(size)
    elif kind == "capsule":
        solid = trimesh.creation.capsule(height=2 * size[1], radius=size[0], count=(48, 48))
        solid.apply_translation([0, 0, -solid.bounds.mean(axis=0)[2]])
    elif kind == "cylinder":
        solid = trimesh.creation.cylinder(radius=size[0], height=2 * size[1], sections=_SECTIONS)
    else:
        solid = trimesh.creation.box(extents=2 * size)
    longest = float(np.max(solid.extents)) * _FINENESS
    V, F = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, max_edge=longest)
    return Mesh.from_arrays(_on_round_surface(kind, size, V), F, name=name)


def shells(model: mujoco.MjModel) -> dict[int, int]:
    """Flex that collides in place of a geom, by geom id: a rigid one of triangles, of its name and on its body."""
    found = {}
    for flex in range(model.nflex):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex)
        geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name) if name else -1
        if geom < 0 or model.flex_dim[flex] != 2 or not model.flex_rigid[flex]:
            continue
        if model.flex_vertbodyid[model.flex_vertadr[flex]] == model.geom_bodyid[geom]:
            found[geom] = flex
    return found


def shell_thickness(model: mujoco.MjModel, flex: int) -> float:
    """How far off its triangles a flex holds bodies [m]."""
    return float(model.flex_margin[flex] + model.flex_radius[flex])


def contact_masks(model: mujoco.MjModel) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Contact types and affinities of all geoms, or of the flexes that stand for them, [ngeom]."""
    types, affinities = model.geom_contype.copy(), model.geom_conaffinity.copy()
    for geom, flex in shells(model).items():
        types[geom], affinities[geom] = model.flex_contype[flex], model.flex_conaffinity[flex]
    return types, affinities


def _on_round_surface(kind: str, size: NDArray[np.float64], V: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vertices moved from the chords of a round solid onto its surface, along the radius [m]."""
    if kind == "ellipsoid":
        return V / np.linalg.norm(V / size, axis=1, keepdims=True)
    if kind == "capsule":
        axis = np.clip(V[:, 2:], -size[1], size[1]) * [0.0, 0.0, 1.0]
        return axis + size[0] * (V - axis) / np.linalg.norm(V - axis, axis=1, keepdims=True)
    if kind == "cylinder":
        radius = np.linalg.norm(V[:, :2], axis=1)
        round_part = radius > size[0] * (np.cos(np.pi / _SECTIONS) - 1e-9)  # the rest lies inside the flat ends
        V = V.copy()
        V[round_part, :2] *= (size[0] / radius[round_part])[:, None]
    return V


def _texture_coordinates(model: mujoco.MjModel, mesh: int) -> NDArray[np.float64] | None:
    """A mesh's own texture coordinates at the corners of its triangles, [face_count, 3, 2], or None.

    MuJoCo counts v from the picture's upper edge.
    """
    first, first_face = model.mesh_texcoordadr[mesh], model.mesh_faceadr[mesh]
    if first < 0:
        return None
    pairs = model.mesh_texcoord[first : first + model.mesh_texcoordnum[mesh]]
    corners = pairs[model.mesh_facetexcoord[first_face : first_face + model.mesh_facenum[mesh]]].astype(np.float64)
    return np.stack([corners[..., 0], 1 - corners[..., 1]], axis=-1)


def _textured(mesh: Mesh, F: NDArray[np.int32], corner_uv: NDArray[np.float64] | None) -> Mesh:
    """The mesh with texture coordinates, unless its triangles had to be mended."""
    if corner_uv is None or not np.array_equal(mesh.F, F):
        return mesh
    uv = np.zeros((len(mesh.V), 2))
    uv[F] = corner_uv
    return dataclasses.replace(mesh, uv=uv, corner_uv=corner_uv)
