"""Solids of a few triangles."""

import numpy as np
import trimesh

from ripple_sim.solver import Mesh

BALL = trimesh.creation.icosphere(subdivisions=1)


def cube() -> tuple[np.ndarray, np.ndarray]:
    box = trimesh.creation.box()
    return np.array(box.vertices), np.array(box.faces)


def torus() -> tuple[np.ndarray, np.ndarray]:
    solid = trimesh.creation.torus(1.0, 0.3)
    return np.array(solid.vertices), np.array(solid.faces)


def is_closed_sphere(mesh: Mesh) -> bool:
    half_edges = mesh.F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    forward = {tuple(edge) for edge in half_edges}
    each_once = len(forward) == len(half_edges) and all((b, a) in forward for a, b in forward)
    return each_once and len(mesh.V) - len(half_edges) // 2 + len(mesh.F) == 2 and mesh.volume > 0
