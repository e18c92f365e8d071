"""Flex colliders: rigid flexes of triangles, made so that mesh geoms collide through them."""

from __future__ import annotations

from typing import Any, NamedTuple

import igl
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Mesh
from ripple_sim.solver.mesh.rays import RayScene

from .convex_collider import LISTS, SETTINGS, mesh_on_body

# A collision surface off the true one by this share of the target's size shows: bodies stop in mid-air.
GAP_TOLERANCE = 0.02
# Thicknesses over the mesh's size: the first within the tolerance is taken, or else the last.
_THICKNESSES = (0.05, 0.04, 0.03, 0.02)
# Thickness of a sheet over its size, on either side.
_SHEET = 0.01
# Vertices at sharp corners move by this many thicknesses at most; those of a cube need 1.73.
_SHARPEST = 2.0
# Weight of the isotropic term over that of the triangles' planes: it settles the directions that they leave open.
_ROUNDING = 1e-3
# Vertices move by this share of the local thickness at most, so that opposite sides of a thin part stay apart.
_DEEPEST = 0.45


class FlexCore(NamedTuple):
    """Vertices of a flex inside a mesh [m], [n, 3], its triangles, and the margin that reaches to the surface [m]."""

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    thickness: float


def add_flex_collider(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, core: FlexCore) -> None:
    """Let a mesh geom collide through a rigid flex of its triangles, of the same name, and no longer by itself.

    MuJoCo's contacts with a triangle are right as long as nothing penetrates it: they push along the shortest line
    between the two. A geom that has penetrated is pushed out through the nearest side, which is sideways for a flat
    geom with a triangle under its rim. So the triangles lie inside the surface, and a contact margin of the same
    thickness holds other geoms off: they meet the true surface. Sharp edges become rounded and thin parts thicker; the
    flex is as thick as possible (2 to 5 % of the mesh's size) without putting either off by more than 2 %.

    An open mesh is a sheet that can be hit from both sides: the triangles are its own, and the margin, 1 % of its size,
    holds geoms off either side.

    Parameters
    ----------
    spec : mujoco.MjSpec
    geom : mujoco.MjsGeom
        Of type mesh.
    core : FlexCore
        See `flex_core`.
    """
    body = geom.parent
    body.name = body.name or f"body of {geom.name}"
    spec.add_flex(
        name=geom.name,
        dim=2,
        vertbody=[body.name],
        vert=core.V.ravel(),
        elem=core.F.ravel().astype(np.int32),
        radius=0.0,
        margin=geom.margin + core.thickness,
        # MuJoCo's own viewer does not show this group
        group=3,
        **{name: getattr(geom, name) for name in SETTINGS},
        **{name: np.array(getattr(geom, name)) for name in LISTS},
    )
    geom.contype = geom.conaffinity = 0


def remove_flex_collider(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> None:
    """Remove the flex collider of a geom, if it has one, and let the geom collide by itself again."""
    flex = spec.flex(geom.name)
    if flex is not None and set(flex.vertbody) == {geom.parent.name}:
        geom.contype, geom.conaffinity = flex.contype, flex.conaffinity
        spec.delete(flex)


def flex_core(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> FlexCore:
    """What a geom's flex collider is made of.

    Raises
    ------
    SceneError
        If the specification does not compile as it is, or discards geoms that do not collide.
    MeshError
        If the mesh has no triangle with an area.
    """
    mesh = mesh_on_body(spec, geom)
    size = float(np.ptp(mesh.V, axis=0).max())
    if not mesh.closed:
        return FlexCore(mesh.V, mesh.F, _SHEET * size)
    points = np.concatenate([mesh.V, mesh.V[mesh.F].mean(axis=1)])
    for share in _THICKNESSES:
        thickness = share * size
        core = inset(mesh, thickness)
        squared, _, _ = igl.point_mesh_squared_distance(points, core, mesh.F)
        if np.abs(np.sqrt(squared) - thickness).max() <= GAP_TOLERANCE * size:
            break
    return FlexCore(core, mesh.F, thickness)


def inset(mesh: Mesh, depth: float) -> NDArray[np.float64]:
    """Vertices [m], [n, 3], moved inwards until the planes of their triangles lie deeper by `depth` [m].

    Where more than three planes meet, the remaining squared distances, weighted by the corners' angles, are least.
    Parts too thin for that keep a tenth of their thickness.
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
    moved = np.minimum(depth * np.minimum(length, _SHARPEST), _DEEPEST * _thickness(V, F, -outward, 1e-3 * depth))
    return V - moved[:, None] * outward


def _thickness(V: NDArray[np.float64], F: NDArray[np.int64], inward: NDArray[Any], start: float) -> NDArray[np.float64]:
    """Distance from each vertex inwards to the other side of a mesh [m], [n]; infinite where there is none."""
    distance: NDArray[Any] = RayScene(V, F).cast(V + start * inward, inward).distance
    return start + distance
