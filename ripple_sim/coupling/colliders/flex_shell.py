"""Shells: rigid flexes that collide in place of mesh geoms."""

from __future__ import annotations

import dataclasses
from typing import Any

import igl
import mujoco
import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh
from numpy.typing import NDArray

from ripple_sim.coupling.model.target import target_mesh
from ripple_sim.errors import SceneError
from ripple_sim.solver import Mesh

# A collision surface this share of the target's size off the true one is seen: bodies stop in mid-air.
GAP_TOLERANCE = 0.02
# Thicknesses over the mesh's size, of which the first that stays within the tolerance is taken, or else the last one.
_THICKNESSES = (0.05, 0.04, 0.03, 0.02)
# At sharp corners vertices move by this many thicknesses at most; those of a cube need 1.73.
_SHARPEST = 2.0
# Share of the weight of a mesh's own planes, for directions that they leave open.
_ROUNDING = 1e-3
# Opposite sides of a thin part stay apart by a tenth of it.
_REACH = 0.45

_SETTINGS = ("contype", "conaffinity", "condim", "priority", "solmix", "gap")
_LISTS = ("friction", "solref", "solimp")


def add_shell(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> None:
    """Let a mesh geom collide through a rigid flex of its triangles, of the same name; itself it no longer does.

    MuJoCo's contacts with a triangle are right as long as nothing gets through it: then they push along the shortest
    way between the two. What has got through is pushed out through the nearest side: a flat body, where a triangle lies
    under its rim, sideways. So the triangles lie inside of the surface, and a contact margin as thick holds bodies off:
    outside they meet the true surface. Sharp edges are rounded, and thin parts thickened; the shell is as thick as it
    can be (2 to 5 % of the mesh's size) without either being off by more than 2 %.

    Parameters
    ----------
    spec : mujoco.MjSpec
    geom : mujoco.MjsGeom
        Of type mesh.

    Raises
    ------
    SceneError
        If the specification cannot be compiled as it stands, or drops geoms that do not collide.
    MeshError
        If the mesh is not a closed genus-0 surface.
    """
    if spec.compiler.discardvisual:
        raise SceneError(
            f"geom {geom.name!r} cannot collide through a flex, since the compiler's discardvisual would then discard "
            "it; set spec.compiler.discardvisual = False"
        )
    body = geom.parent
    body.name = body.name or f"body of {geom.name}"
    mesh = _mesh_on_body(spec, geom.name)
    core, thickness = _core(mesh)
    spec.add_flex(
        name=geom.name,
        dim=2,
        vertbody=[body.name],
        vert=core.ravel(),
        elem=mesh.F.ravel().astype(np.int32),
        radius=0.0,
        margin=geom.margin + thickness,
        # a group that MuJoCo's own viewer leaves out
        group=3,
        **{name: getattr(geom, name) for name in _SETTINGS},
        **{name: np.array(getattr(geom, name)) for name in _LISTS},
    )
    geom.contype = geom.conaffinity = 0


def remove_shell(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> None:
    """Let a geom collide itself again, if a flex does so in its place."""
    flex = spec.flex(geom.name)
    if flex is not None and set(flex.vertbody) == {geom.parent.name}:
        geom.contype, geom.conaffinity = flex.contype, flex.conaffinity
        spec.delete(flex)


def _core(mesh: Mesh) -> tuple[NDArray[np.float64], float]:
    """Vertices inside of a mesh [m], and how thick a shell round them comes near its surface [m]."""
    size = float(np.ptp(mesh.V, axis=0).max())
    points = np.concatenate([mesh.V, mesh.V[mesh.F].mean(axis=1)])
    for share in _THICKNESSES:
        thickness = share * size
        core = inset(mesh, thickness)
        squared, _, _ = igl.point_mesh_squared_distance(points, core, mesh.F)
        if np.abs(np.sqrt(squared) - thickness).max() <= GAP_TOLERANCE * size:
            break
    return core, thickness


def inset(mesh: Mesh, depth: float) -> NDArray[np.float64]:
    """Vertices moved so far inwards that the planes of their triangles lie deeper by a length [m].

    Where more than three planes meet, the squared distances that are left are least, weighted with the corners'
    angles. Parts too thin for that keep a tenth of their thickness.
    """
    V, F = mesh.V, mesh.F
    corners = V[F]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    squares, sums, weights = np.zeros((len(V), 3, 3)), np.zeros((len(V), 3)), np.zeros(len(V))
    for k in range(3):
        a, b = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
        np.add.at(squares, F[:, k], angle[:, None, None] * normals[:, :, None] * normals[:, None, :])
        np.add.at(sums, F[:, k], angle[:, None] * normals)
        np.add.at(weights, F[:, k], angle)
    squares += _ROUNDING * weights[:, None, None] * np.eye(3)
    outward = (1 + _ROUNDING) * np.linalg.solve(squares, sums[:, :, None])[:, :, 0]
    length = np.maximum(np.linalg.norm(outward, axis=1), np.finfo(np.float64).tiny)
    outward /= length[:, None]
    moved = np.minimum(depth * np.minimum(length, _SHARPEST), _REACH * _thickness(V, F, -outward, 1e-3 * depth))
    return V - moved[:, None] * outward


def _mesh_on_body(spec: mujoco.MjSpec, geom: str) -> Mesh:
    """A geom's mesh in the frame of its body, as MuJoCo compiles it."""
    try:
        model = spec.copy().compile()
    except ValueError as error:
        raise SceneError(
            f"geom {geom!r} gets its flex from the compiled mesh, but the specification does not compile: {error}"
        ) from error
    index = model.geom(geom).id
    mesh, rotation = target_mesh(model, index), np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[index])
    return dataclasses.replace(mesh, V=model.geom_pos[index] + mesh.V @ rotation.reshape(3, 3).T)


def _thickness(V: NDArray[np.float64], F: NDArray[np.int64], inward: NDArray[Any], start: float) -> NDArray[np.float64]:
    """Way from each vertex to the other side of a mesh [m], infinite where there is none."""
    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene, V.astype(np.float32), F.astype(np.int32))
    hit = scene.run((V + start * inward).astype(np.float32), inward.astype(np.float32), output=1)
    return np.where(hit["primID"] >= 0, start + hit["tfar"], np.inf)
