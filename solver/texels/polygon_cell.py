"""Finite element of a polygon in space with any number of corners."""

from __future__ import annotations

import numpy as np

from ..kernel import Floats, kernel
from .cells import triangle
from .vectors import Points, between, dot

# A polygon flatter than this, in units of its size, counts as flat: many combinations of its corners then make the node
# in its middle. Its square is well above round-off.
_FLAT = 1e-5


@kernel
def polygon(corners: Floats) -> tuple[Floats, Floats]:
    """Link weights [k, k] (0 on the diagonal) and the corners' shares of the area [k] of a polygon in space [k, 3].

    A virtual node in the middle cuts it into triangles; it is an affine combination of the corners, so that linear
    functions stay exact, and is eliminated (Bunge, Herholz, Kazhdan and Botsch 2020).
    """
    count = len(corners)
    shares = _virtual_node(corners)
    middle = _middle(corners, shares)
    links, spokes, areas, inner = np.zeros((count, count)), np.zeros(count), np.zeros(count), 0.0
    for i in range(count):
        j = (i + 1) % count
        to_j, to_i, side, area = triangle(corners[i], corners[j], middle)
        spokes[j] += to_j
        spokes[i] += to_i
        links[i, j] += side
        links[j, i] += side
        areas[i] += area / 3
        areas[j] += area / 3
        inner += area / 3
    total = spokes.sum()
    for i in range(count):
        areas[i] += shares[i] * inner
        for j in range(count):
            if i != j:
                links[i, j] += shares[j] * spokes[i] + shares[i] * spokes[j] - shares[i] * shares[j] * total
    return links, areas


@kernel
def _virtual_node(corners: Floats) -> Floats:
    """Weights [k], of sum 1, of the point whose triangles with a polygon's sides have the least squared areas.

    Of all weights that make it the most even ones.
    """
    count = len(corners)
    mean = _middle(corners, np.full(count, 1 / count))
    # |x - c| x side, squared: x' A x - 2 b' x, with A = sum of |s|^2 1 - s s'
    squares, right, spread = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
    for i in range(count):
        here, side = between(mean, corners[i]), between(corners[i], corners[(i + 1) % count])
        squared, along = dot(side, side), dot(side, here)
        for a in range(3):
            squares[a, a] += squared
            right[a] += squared * here[a] - side[a] * along
            for b in range(3):
                squares[a, b] -= side[a] * side[b]
                spread[a, b] += here[a] * here[b]
    slope = _solved(spread, _solved(squares, right))
    weights = np.empty(count)
    for i in range(count):
        weights[i] = 1 / count + dot(slope, between(mean, corners[i]))
    return weights / weights.sum()


@kernel
def _middle(corners: Floats, weights: Floats) -> tuple[float, float, float]:
    """The point with such weights at the corners."""
    x, y, z = 0.0, 0.0, 0.0
    for i in range(len(corners)):
        x, y, z = x + weights[i] * corners[i, 0], y + weights[i] * corners[i, 1], z + weights[i] * corners[i, 2]
    return x, y, z


@kernel
def _solved(matrix: Floats, right: Points) -> tuple[float, float, float]:
    """Solution of a symmetric positive semidefinite system [3, 3]; next to 0 where this leaves it open."""
    ridge = _FLAT**2 * (matrix[0, 0] + matrix[1, 1] + matrix[2, 2]) + 1e-300
    first = matrix[0, 0] + ridge
    a, b = matrix[0, 1] / first, matrix[0, 2] / first
    second, coupling = matrix[1, 1] + ridge - a * matrix[0, 1], matrix[1, 2] - a * matrix[0, 2]
    c = coupling / second
    third = matrix[2, 2] + ridge - b * matrix[0, 2] - c * coupling
    p = right[1] - a * right[0]
    z = (right[2] - b * right[0] - c * p) / third
    y = p / second - c * z
    return right[0] / first - a * y - b * z, y, z
