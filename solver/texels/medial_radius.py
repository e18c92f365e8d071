"""How far a surface may move along its normals before it meets itself: the radii of its medial balls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..kept import kept_with
from .atlas import Atlas
from .smoothing import smoothed

# Details closer to a texel than this share of the surface's size do not count: the edges of a box, for instance.
_DETAIL = 0.04

# No radius is less than this share of the size: a ball that touches two points a detail apart has half its diameter.
LEAST = _DETAIL / 2
_MOST = 0.55

_POINTS = 8_000  # among which the balls are sought
_ROUNDS = 12  # by then every ball has stopped to shrink
_TOLERANCE = 1e-3


@kept_with
def medial_radius(atlas: Atlas) -> NDArray[np.float32]:
    """Radius of the largest ball that touches the surface at a texel and holds no other part of it [m], [C, n, n].

    The lesser one of the balls inside and outside. A point that is moved along its normal by less than that is still
    closer to where it came from than to any other place, so that no two of them meet. Found by shrinking balls (Ma, Bae
    and Choi 2012, "3D medial axis point approximation using nearest neighbors and the normal field"), at
    `LEAST` to 0.55 of the surface's longest extent.
    """
    size = float(np.ptp(atlas.mesh.V, axis=0).max())
    stride = int(np.ceil(np.sqrt(atlas.areas.size / _POINTS)))
    points, normals = (field[:, ::stride, ::stride].reshape(-1, 3) for field in (atlas.positions, atlas.normals))
    tree = cKDTree(points)
    inside, outside = (_shrunk(tree, points, side * normals, size) for side in (-1.0, 1.0))
    _, nearest = tree.query(atlas.positions.reshape(-1, 3))
    curvature = 1 / np.minimum(inside, outside)[nearest].reshape(atlas.areas.shape)
    return (1 / smoothed(atlas.texels.topology, curvature)).astype(np.float32)


def _shrunk(
    tree: cKDTree, points: NDArray[np.float64], normals: NDArray[np.float64], size: float
) -> NDArray[np.float64]:
    """Radii of the balls on the side of the normals, [k]: each shrinks until no point lies in it."""
    radius = np.full(len(points), _MOST * size)
    active = np.arange(len(points))
    for _ in range(_ROUNDS):
        center = points[active] + normals[active] * radius[active, None]
        distance, nearest = tree.query(center)
        away = points[nearest] - points[active]
        squared, depth = (away**2).sum(axis=1), (away * normals[active]).sum(axis=1)
        within = (distance < (1 - _TOLERANCE) * radius[active]) & (squared > (_DETAIL * size) ** 2) & (depth > 0)
        active = active[within]
        if not len(active):
            break
        # the ball that touches the surface at the texel and passes through the point
        radius[active] = np.minimum(radius[active], squared[within] / (2 * depth[within]))
    return radius
