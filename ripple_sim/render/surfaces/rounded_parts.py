"""A mesh cut into the parts of its chart map, as round as before it was cut."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.visuals.corners import corner_normals, normalized, split_corners
from ripple_sim.solver import Mesh
from ripple_sim.solver.texels.chart_map import ChartMap, PartsMesh, parts_mesh

from .tessellation import bulges, edges_of

_ALIKE = 1e-4  # normals at a vertex that differ by less are one


class RoundedParts(NamedTuple):
    """Parts, the places of their vertices [m], float64 [n, 3], and the normals of their corners, [m, 3, 3]."""

    parts: PartsMesh
    V: NDArray[np.float64]
    normals: NDArray[np.float64]


def rounded_parts(mesh: Mesh, chart_map: ChartMap) -> RoundedParts:
    """Cut a mesh; normals go over from the mesh's triangles, whose parts bulge out as the triangles themselves would.

    A triangle is the quadratic patch whose edges have the midpoints of `tessellate`: flat where its normals say so.
    """
    parts, normals = parts_mesh(chart_map, mesh), corner_normals(mesh.V, mesh.F)
    if parts.V is mesh.V:
        return RoundedParts(parts, mesh.V, normals)
    w, out = parts.barycentrics, _bulges_of_sides(mesh)[parts.triangle]
    V = parts.V.copy()
    V[parts.F] += 4 * np.einsum("pck,pck,pkj->pcj", w, np.roll(w, -1, axis=2), out)
    return RoundedParts(parts, V, _unified(parts.F, normalized(parts.carry(normals))))


def _bulges_of_sides(mesh: Mesh) -> NDArray[np.float64]:
    """How far the midpoint of each triangle's side from corner k to k + 1 bulges out [m], [m, 3, 3]."""
    split = split_corners(mesh.V, mesh.F)
    attributes = np.concatenate([mesh.V[split.vertices], split.normals], axis=1)
    edges = edges_of(split.F, np.arange(len(attributes)))
    return bulges(edges, attributes, slice(0, 3), slice(3, 6))[edges.of_side]


def _unified(F: NDArray[np.int64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corner normals [m, 3, 3] that are the same to the last bit where they differ by round-off at a vertex."""
    key = np.column_stack([F.ravel(), np.rint(normals.reshape(-1, 3) / _ALIKE).astype(np.int64)])
    _, first, group = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return normals.reshape(-1, 3)[first[group.ravel()]].reshape(normals.shape)
