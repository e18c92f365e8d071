"""Finite elements on the texel grid: stiffness weights and lumped areas of the closed quad mesh of texel centres.

Vertices are the texel centres. Cells are the quads between four texels, also across the 12 cube edges, and one triangle
at each of the 8 cube corners. Together they give a symmetric 9-point stencil. Only real-space coordinates enter.

A quad takes its gradient from its two diagonals (one-point integration), and a little stiffness against the one pattern
that this does not see, the hourglass + - + - (Flanagan and Belytschko 1981). That pattern is a second derivative: its
stiffness is free. It decides whether short waves lag behind or run ahead, and follows from the quad's shape. Linear
triangles give it far too much in a sheared quad: there waves ran ahead, by 3 % in the median over the elephant at
N = 96.

Layout. Fields are padded faces [6, N + 2, N + 2] (`cubemap.padded_indices`). A stencil is [6, 4, N + 1, N + 1]: the
weights of the links of padded cell (r, c) to the east (r, c)-(r, c + 1), north (r, c)-(r + 1, c), north-east
(r, c)-(r + 1, c + 1), and its other diagonal (r, c + 1)-(r + 1, c). A link that crosses a cube edge stands on both
faces, with the same value to the last bit.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.texels.cube_map.convention import padded_indices

EAST, NORTH, NORTHEAST, NORTHWEST = range(4)

# Stiffness of a square against the hourglass. At 1 waves lag along its sides as much as they lead along its diagonals,
# 1/2 makes the 5-point stencil, 1/3 an isotropic one, 1/4 allows the longest time step.
_HOURGLASS = 0.4

# Elongated quads take up to this share of the hourglass stiffness that would begin to shorten their own time step.
_SHARE = 0.75

# A cell folded to a line would ask for an infinitely short time step: least area, in units of a square's as large.
_LEAST_AREA = 0.02


def pad(field: NDArray) -> NDArray:
    """Surround each face of [6, N, N, ...] by its neighbours' texels; the corners of the ring become 0."""
    n = field.shape[1]
    index = padded_indices(n)
    padded = field.reshape(6 * n * n, *field.shape[3:])[index]
    padded[index < 0] = 0
    return padded


def lumped_areas(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Area of the texel mesh that belongs to each texel [m^2], [6, N, N]."""
    n = positions.shape[1]
    even, areas = np.ones((6, n + 2, n + 2)), np.zeros((6, n, n))
    _assemble(pad(positions), even, even, np.zeros((6, 4, n + 1, n + 1)), areas)
    return areas


def stiffness_stencil(
    positions: NDArray[np.float64], coefficient: NDArray[np.float64], softening: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Stiffness weights of -div(coefficient grad).

    Parameters
    ----------
    positions : [6, N, N, 3]
        Texel positions [m].
    coefficient : [6, N, N]
        Averaged harmonically over the corners of every cell, as media in series: the operator stays symmetric, and a
        region where it is 0 is cut off at its edge.
    softening : [6, N, N], optional
        Factors up to 1: the stiffness of every cell is multiplied by the least of those at its corners.

    Returns
    -------
    float64 [6, 4, N + 1, N + 1]
        Link weights; sum over links of weight (h_j - h_i) is the area integral of div(coefficient grad h).
    """
    n = positions.shape[1]
    weights = np.zeros((6, 4, n + 1, n + 1))
    soft = np.ones((6, n, n)) if softening is None else softening
    _assemble(pad(positions), pad(coefficient), pad(soft), weights, np.zeros((6, n, n)))
    return agree_across_edges(weights)


def link_lengths(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Real-space length of every link [m], in stencil layout; infinite where no link exists."""
    index = padded_indices(positions.shape[1])
    padded = pad(positions)
    lengths = np.full((6, 4, len(index[0]) - 1, len(index[0]) - 1), np.inf)
    for link, (a, b) in enumerate(_link_ends()):
        exists = _link_exists(index, a, b)
        lengths[:, link][exists] = np.linalg.norm(padded[a] - padded[b], axis=-1)[exists]
    return agree_across_edges(lengths)


def _link_ends() -> tuple[tuple[tuple[slice, ...], tuple[slice, ...]], ...]:
    """For every link direction, the slices of a padded field that hold the links' two ends."""
    every, low, high = slice(None), slice(None, -1), slice(1, None)
    return (
        ((every, low, low), (every, low, high)),
        ((every, low, low), (every, high, low)),
        ((every, low, low), (every, high, high)),
        ((every, low, high), (every, high, low)),
    )


def _own_cells(n: int) -> NDArray[np.bool_]:
    own = np.zeros((6, n + 2, n + 2), dtype=bool)
    own[:, 1:-1, 1:-1] = True
    return own


def _link_exists(index: NDArray, a: tuple[slice, ...], b: tuple[slice, ...]) -> NDArray[np.bool_]:
    own = _own_cells(index.shape[1] - 2)
    return (index[a] >= 0) & (index[b] >= 0) & (own[a] | own[b])


def agree_across_edges(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give both copies of every link that crosses a cube edge their mean; clear entries that are no links."""
    n = weights.shape[2] - 1
    index, own = padded_indices(n), _own_cells(n)
    keys, places = [], []
    for link, (a, b) in enumerate(_link_ends()):
        exists = _link_exists(index, a, b)
        weights[:, link][~exists & np.isfinite(weights[:, link])] = 0
        crossing = exists & (own[a] != own[b])
        low, high = np.minimum(index[a], index[b])[crossing], np.maximum(index[a], index[b])[crossing]
        keys.append(low * (6 * n * n) + high)
        face, row, column = np.nonzero(crossing)
        places.append(np.stack([face, np.full_like(face, link), row, column]))
    place = tuple(np.concatenate(places, axis=1))
    _, pair = np.unique(np.concatenate(keys), return_inverse=True)
    weights[place] = (np.bincount(pair, weights[place]) / np.bincount(pair))[pair]
    return weights


@numba.njit(inline="always")
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@numba.njit(inline="always")
def _cross_length(a, b):
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return np.sqrt(x * x + y * y + z * z)


@numba.njit(inline="always")
def _between(a, b):
    return (b[0] - a[0], b[1] - a[1], b[2] - a[2])


@numba.njit(cache=True)
def _quad_area(sw, se, nw, ne):
    """Area of a quad that need not be flat: that of its smaller triangulation.

    The flat area p x q / 2 misses what a fold holds, the other triangulation spans it twice.
    """
    south, west, north, east = _between(sw, se), _between(sw, nw), _between(ne, nw), _between(ne, se)
    rising = _cross_length(south, east) + _cross_length(north, west)
    falling = _cross_length(south, west) + _cross_length(north, east)
    return min(rising, falling) / 2


@numba.njit(cache=True)
def _hourglass(pp, qq, pq, area):
    """Hourglass stiffness of a quad of given area whose diagonals p and q have the products pp, qq and pq.

    In a parallelogram with the squared sides a >= b, the product d of its sides and the area J, a wave of wave number k
    has omega^2 = k^2 - k^4 (a + b) / 16 + k^4 H (J^2 + 3 d^2) / 8 J in the mean over its directions, to leading order:
    waves are in time on average at H = (a + b) J / 2 (J^2 + 3 d^2). Its time step begins to shorten at
    H = (a^2 - d^2) / 4 a J.
    """
    both_sides = (pp + qq) / 2
    a, d = (both_sides + abs(pq)) / 2, (pp - qq) / 4
    in_time = both_sides * area / (2 * (area * area + 3 * d * d))
    free = (a * a - d * d) / (4 * a * area)
    return min(in_time, max(_SHARE * free, _HOURGLASS * 2 * area / both_sides))


@numba.njit(cache=True)
def _quad(sw, se, nw, ne):
    """Weights of a quad's links: south and north side, west and east side, diagonal sw-ne, diagonal se-nw; its area.

    With diagonals p, q and u_p, u_q the differences along them, area |gradient|^2 is
    (|q|^2 u_p^2 - 2 p.q u_p u_q + |p|^2 u_q^2) / 2 |p x q|, and 2 u_p u_q is the sum of squared differences along west
    and east, less that along south and north.
    """
    p, q = _between(sw, ne), _between(se, nw)
    pp, qq, pq, cross = _dot(p, p), _dot(q, q), _dot(p, q), _cross_length(p, q)
    if pp + qq == 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    twice = 2 * max(cross, _LEAST_AREA / 2 * (pp + qq))
    hourglass = _hourglass(pp, qq, pq, twice / 4)
    return (
        pq / twice + hourglass,
        hourglass - pq / twice,
        qq / twice - hourglass,
        pp / twice - hourglass,
        _quad_area(sw, se, nw, ne),
    )


@numba.njit(cache=True)
def _triangle(a, b, c):
    """Cotangent weights of the links bc, ca, ab, and the area of a triangle (Pinkall and Polthier 1993)."""
    ab, ac, bc = _between(a, b), _between(a, c), _between(b, c)
    double_area = _cross_length(ab, ac)
    longest = max(_dot(ab, ab), _dot(ac, ac), _dot(bc, bc))
    if longest == 0:
        return 0.0, 0.0, 0.0, 0.0
    twice = 2 * max(double_area, _LEAST_AREA * longest)
    return _dot(ab, ac) / twice, -_dot(ab, bc) / twice, _dot(ac, bc) / twice, double_area / 2


@numba.njit(cache=True)
def _assemble(x, k, s, weights, areas):
    """Add up the cells of the padded positions x with padded coefficients k, softened by the padded factors s."""
    n = x.shape[1] - 2
    # one cell wider than the stencil: links inside the ring are collected too and left behind
    link = np.zeros((4, n + 2, n + 2))
    area = np.zeros((n + 2, n + 2))
    for f in range(6):
        link[:] = 0
        area[:] = 0
        for r in range(n + 1):
            for c in range(n + 1):
                if (r == 0 or r == n) and (c == 0 or c == n):
                    # cube corner: the padded corner does not exist; one triangle of the other three
                    r0, r1 = (1, 0) if r == 0 else (n, n + 1)
                    c0, c1 = (1, 0) if c == 0 else (n, n + 1)
                    _, vertical, horizontal, whole = _triangle(x[f, r0, c0], x[f, r0, c1], x[f, r1, c0])
                    a, b, d = k[f, r0, c0], k[f, r0, c1], k[f, r1, c0]
                    conductance = 3 / (1 / a + 1 / b + 1 / d) if a * b * d > 0 else 0.0
                    conductance *= min(s[f, r0, c0], s[f, r0, c1], s[f, r1, c0])
                    area[r0, c0] += whole / 3
                    link[1, r, c0] += conductance * vertical
                    link[0, r0, c] += conductance * horizontal
                    continue
                south_north, west_east, rising, falling, whole = _quad(
                    x[f, r, c], x[f, r, c + 1], x[f, r + 1, c], x[f, r + 1, c + 1]
                )
                a, b, d, e = k[f, r, c], k[f, r, c + 1], k[f, r + 1, c], k[f, r + 1, c + 1]
                conductance = 4 / (1 / a + 1 / b + 1 / d + 1 / e) if a * b * d * e > 0 else 0.0
                conductance *= min(s[f, r, c], s[f, r, c + 1], s[f, r + 1, c], s[f, r + 1, c + 1])
                link[0, r, c] += conductance * south_north
                link[0, r + 1, c] += conductance * south_north
                link[1, r, c] += conductance * west_east
                link[1, r, c + 1] += conductance * west_east
                link[2, r, c] += conductance * rising
                link[3, r, c] += conductance * falling
                for i in range(2):
                    for j in range(2):
                        area[r + i, c + j] += whole / 4
        weights[f] = link[:, : n + 1, : n + 1]
        areas[f] = area[1 : n + 1, 1 : n + 1]
