"""How far the surface that collides lies off the surface that ripples."""

from __future__ import annotations

from collections.abc import Iterable

import igl
import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray

from ripple_sim.solver import Atlas

from .geoms import TARGET_TYPES
from .model import CoupledModel
from .primitives import primitive_triangles

_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
# Points of the rippling surface at which its distance is taken.
_POINTS = 1500


def hull_gap(atlas: Atlas) -> float:
    """Greatest distance from the convex hull of a mesh to its surface [m], on points 1/24 of its size apart."""
    hull = trimesh.Trimesh(atlas.mesh.V, atlas.mesh.F, process=False).convex_hull
    points, _ = trimesh.remesh.subdivide_to_size(hull.vertices, hull.faces, max_edge=float(hull.extents.max()) / 24)
    closest, _ = atlas.project(points)
    return float(np.linalg.norm(points - closest, axis=1).max())


def collision_gap(coupled: CoupledModel, target: int, atlas: Atlas, geoms: Iterable[int]) -> float:
    """How deep bodies sink into a target's surface before they meet the geoms that collide for it [m].

    Or how far above the surface they are held, where that is more: over half of it, since a part of it may well lie
    inside a geom that collides for the target's neighbour too.

    Parameters
    ----------
    coupled : CoupledModel
    target : int
        Geom id.
    atlas : Atlas
        Of the target.
    geoms : iterable of int
        Ids of geoms on its body or on bodies welded to it. Planes and height fields have no surface to be off from.
    """
    model, data = coupled.model, mujoco.MjData(coupled.model)
    mujoco.mj_kinematics(model, data)
    points = atlas.positions.reshape(-1, 3)
    points = points[:: -(-len(points) // _POINTS)]
    points = data.geom_xpos[target] + points @ data.geom_xmat[target].reshape(3, 3).T
    solids = [geom for geom in geoms if TARGET_TYPES.get(int(model.geom_type[geom]), "hfield") != "hfield"]
    if not solids:
        return 0.0
    outside = np.full(len(points), np.inf)
    for geom in solids:
        V, F = _solid(coupled, geom)
        local = (points - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
        outside = np.minimum(outside, igl.signed_distance(local, V, F)[0])
    return float(max(outside.max(), -np.median(outside)))


def _solid(coupled: CoupledModel, geom: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices [m], [n, 3], and triangles of a geom as it collides, in its own frame."""
    model, kind = coupled.model, TARGET_TYPES[int(coupled.model.geom_type[geom])]
    if kind not in ("mesh", "sdf"):
        return primitive_triangles(kind, model.geom_size[geom])
    mesh = model.geom_dataid[geom]
    V = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]].astype(np.float64)
    F = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]].astype(np.int64)
    if kind == "mesh" and not coupled.has_flex[geom]:
        hull = trimesh.convex.convex_hull(V)
        V, F = np.array(hull.vertices), np.array(hull.faces)
    return V, F
