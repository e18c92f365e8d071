"""Exact distances along the surface of a mesh."""

from __future__ import annotations

import igl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Mesh


def geodesic_distance(mesh: Mesh, source: int) -> NDArray[np.float64]:
    """Exact distance along the surface of every vertex from one of them [m]; infinite on other parts of the mesh."""
    vertices, none = _reached_vertices(mesh, source), np.empty(0, dtype=np.int64)
    distance = np.full(len(mesh.V), np.inf)
    distance[vertices] = igl.exact_geodesic(mesh.V, mesh.F, np.array([source]), none, vertices, none)
    return distance


def _reached_vertices(mesh: Mesh, source: int) -> NDArray[np.int64]:
    """Vertices on the same part of a mesh as `source`, ascending: no wave comes to another."""
    part = np.full(len(mesh.V), -1)
    part[mesh.F] = mesh.components[:, None]
    return np.flatnonzero(part == part[source])
