"""Sphere maps of the shipped scenes' targets.

They are shipped because computing one takes kernels that nothing else needs.

Each is a NumPy array under a hash of its mesh, so that a changed mesh finds none and is mapped
anew. `make sphere-maps` writes them again.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Mesh
from ripple_sim.solver.cache import content_key

FOLDER = Path(__file__).parent


def shipped_sphere_map(mesh: Mesh) -> NDArray[np.float64] | None:
    """Progressive sphere map [vertex_count, 3] of a mesh, or None if none is shipped."""
    path = sphere_map_path(mesh)
    return np.load(path, allow_pickle=False) if path.is_file() else None


def sphere_map_path(mesh: Mesh) -> Path:
    """Where the sphere map of a mesh is kept."""
    return FOLDER / f"{content_key('sphere map', (mesh.V, mesh.F))}.npy"
