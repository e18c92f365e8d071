"""How good an atlas is: folds, stretch, starved area, texel edges, coverage."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .stencil import EAST, NORTH, link_lengths

if TYPE_CHECKING:
    from .atlas import Atlas

QUANTILES = {"q001": 0.001, "q01": 0.01, "q50": 0.5, "q99": 0.99, "q999": 0.999}
STARVED = 4.0


def triple_products(sphere: NDArray[np.float64], F: NDArray[np.int64]) -> NDArray[np.float64]:
    """det(a, b, c) of each triangle's three unit vectors, shape [face_count]: positive where it is not folded."""
    a, b, c = (sphere[F[:, k]] for k in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c))


def solid_angles(sphere: NDArray[np.float64], F: NDArray[np.int64]) -> NDArray[np.float64]:
    """Signed solid angle of each spherical triangle [sr], shape [face_count] (Van Oosterom and Strackee 1983)."""
    a, b, c = (sphere[F[:, k]] for k in range(3))

    def dot(x: NDArray, y: NDArray) -> NDArray:
        return np.einsum("ij,ij->i", x, y)

    return 2 * np.arctan2(triple_products(sphere, F), 1 + dot(a, b) + dot(b, c) + dot(c, a))


def weighted_quantiles(values: NDArray, weights: NDArray, shares: list[float]) -> list[float]:
    """Values below which the given shares of the total weight lie."""
    order = np.argsort(values, kind="stable")
    cumulative = np.cumsum(weights[order])
    at = np.searchsorted(cumulative, np.array(shares) * cumulative[-1])
    return [float(v) for v in values[order][np.minimum(at, len(values) - 1)]]


def atlas_quality(atlas: Atlas) -> dict[str, float]:
    """See `Atlas.quality`."""
    mesh = atlas.mesh
    angles = solid_angles(atlas.sphere, mesh.F)
    scaled_area = mesh.face_areas * (4 * np.pi / mesh.area)
    stretch = np.sqrt(scaled_area / np.maximum(angles, 1e-300))
    quantiles = weighted_quantiles(stretch, mesh.face_areas, list(QUANTILES.values()))
    edges = link_lengths(atlas.positions)[:, [EAST, NORTH]]
    edges = edges[np.isfinite(edges) & (edges > 0)]
    return {
        "flipped": int((triple_products(atlas.sphere, mesh.F) <= 0).sum()),
        "solid_angle": float(angles.sum()),
        **dict(zip(QUANTILES, quantiles, strict=True)),
        "starved": float(mesh.face_areas[stretch > STARVED].sum() / mesh.area),
        "edge_min": float(edges.min()),
        "edge_max": float(edges.max()),
        "coverage": float(atlas.areas.sum() / mesh.area),
    }
