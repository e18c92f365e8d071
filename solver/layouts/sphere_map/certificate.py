"""Proof that a sphere map is a bijection, and measures of how evenly it spreads area."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Columns: TypeAlias = tuple[NDArray[np.float64], ...]

EPSILON = float(np.finfo(np.float64).eps)
QUANTILES = (0.001, 0.01, 0.5, 0.99, 0.999)


@dataclass(frozen=True)
class Certificate:
    """What `certify` found.

    A map whose triangles all keep their orientation and together cover the sphere's 4 pi once is a bijection: a point
    covered twice would make the sum of solid angles larger.
    """

    flipped: int  # triangles whose triple product is not positive
    solid_angle: float  # sum over all triangles, signed [sr]
    valid: bool


def certify(F: NDArray[np.integer], S: NDArray[np.float64]) -> Certificate:
    """Check a sphere map S (unit vectors, shape [n, 3]) of the triangles F, shape [m, 3]."""
    a, b, c = (tuple(S[F[:, j]].T) for j in range(3))
    ab, ac = _difference(a, b), _difference(a, c)
    triple = _product(a, _cross(ab, ac))
    flipped = np.count_nonzero(~(triple > 4.0 * EPSILON * np.sqrt(_product(ab, ab) * _product(ac, ac))))
    solid_angle = np.sum(2.0 * np.arctan2(triple, 1.0 + _product(a, b) + _product(b, c) + _product(c, a)))
    on_sphere = bool(np.all(np.abs(_dot(S, S) - 1) < 1e-9))
    valid = flipped == 0 and on_sphere and abs(solid_angle - 4 * np.pi) < 1e-6
    return Certificate(int(flipped), float(solid_angle), bool(valid))


# column by column: the same sums in the same order on every machine
def _product(a: Columns, b: Columns) -> NDArray[np.float64]:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Columns, b: Columns) -> Columns:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _difference(a: Columns, b: Columns) -> Columns:
    return b[0] - a[0], b[1] - a[1], b[2] - a[2]


def solid_angles(F: NDArray[np.integer], S: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed solid angle of each spherical triangle [sr], shape [m] (van Oosterom and Strackee 1983)."""
    a, b, c = (S[F[:, j]] for j in range(3))
    return 2 * np.arctan2(_dot(a, np.cross(b - a, c - a)), 1 + _dot(a, b) + _dot(b, c) + _dot(c, a))


def stretch(V: NDArray[np.float64], F: NDArray[np.integer], S: NDArray[np.float64]) -> NDArray[np.float64]:
    """Per triangle sqrt(real area / sphere area), real area scaled to 4 pi, shape [m].

    How many times wider than in an ideal even grid the texels are there.
    """
    real = _areas(V, F)
    return np.sqrt(4 * np.pi / np.sum(real) * real / np.maximum(solid_angles(F, S), np.finfo(np.float64).tiny))


def stretch_quantiles(
    V: NDArray[np.float64], F: NDArray[np.integer], S: NDArray[np.float64], quantiles: ArrayLike = QUANTILES
) -> NDArray[np.float64]:
    """Area-weighted quantiles of the stretch: the value that a given share of the real area stays under."""
    values, weights = stretch(V, F, S), _areas(V, F)
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weights[order]) / np.sum(weights)
    return values[order][np.minimum(np.searchsorted(share, quantiles), len(order) - 1)]


def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.einsum("ij,ij->i", a, b)


def _areas(P: NDArray[np.float64], F: NDArray[np.integer]) -> NDArray[np.float64]:
    normal = np.cross(P[F[:, 1]] - P[F[:, 0]], P[F[:, 2]] - P[F[:, 0]])
    return 0.5 * np.sqrt(_dot(normal, normal))
