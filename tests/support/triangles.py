"""Areas and edges of triangles, for tests of meshes that are cut or refined."""

import numpy as np


def cross_products(corners: np.ndarray) -> np.ndarray:
    """Normals of triangles with corners [m, 3, 3], each as long as twice the area."""
    first_side = corners[:, 1] - corners[:, 0]
    second_side = corners[:, 2] - corners[:, 0]
    return np.cross(first_side, second_side)


def areas(corners: np.ndarray) -> np.ndarray:
    """Areas [m] of triangles with corners [m, 3, 3]."""
    return np.linalg.norm(cross_products(corners), axis=1) / 2


def directed_edges(F: np.ndarray) -> np.ndarray:
    """The three edges of each triangle as pairs [3m, 2], in the order of its winding."""
    return np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])


def place_numbers(points: np.ndarray) -> np.ndarray:
    """A number for each point [n, 3], the same where points are equal but for round-off."""
    _, number = np.unique(points.round(9), axis=0, return_inverse=True)
    return number.ravel()
