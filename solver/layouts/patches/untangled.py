"""Texels moved a little where the texel mesh is folded, though the map is not.

Samples of a fold-free map may still lie in the wrong order on the surface: astride of a knife edge, whose two sides
they see from above and from below, or round the tip of a cone. There each texel tries the other places of its square,
on a fine lattice, and takes the one where the corners between its neighbours face outwards.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import Floats, Ints, kernel
from ...texels.topology import TexelTopology
from .faults import Texels, faults, folded
from .samples import Sampler, Samples

_LATTICE = 7  # places along a texel's side; odd, so that one is the centre
_PULL = 0.02  # to the centre of its square, for each texel's width squared
_FLATTEST = 0.2  # least corner of the moved lattice on its chart, in units of a square's
_SWEEPS, _ROUNDS = 6, 6
_AROUND = 2  # texels round a folded one that may move


def untangled(
    sampler: Sampler, topology: TexelTopology, samples: Samples, beyond: NDArray[np.float64] | None
) -> tuple[Samples, NDArray[np.float64]]:
    """Move texels at the centres of their squares to where fewer are folded.

    Parameters
    ----------
    sampler : Sampler
    topology : TexelTopology
    samples : Samples
        At the centres.
    beyond : float64 [C, n + 2, n + 2, 3] or None
        Points of rims [m]; see `TexelMesh`.

    Returns
    -------
    Samples
    offsets : float64 [C, n, n, 2]
        Column and row by which each texel has moved, in texels; below 0.5.
    """
    charts, n, _ = topology.shape
    outside = np.full((charts, n + 2, n + 2, 3), np.nan)
    if beyond is not None:
        outside[topology.rim] = beyond[topology.rim]
    offsets = np.zeros((charts, n + 2, n + 2, 2), np.int64)
    small, weights = samples.small.copy(), samples.weights.copy()
    positions, normals = samples.positions.reshape(-1, 3).copy(), samples.normals.reshape(-1, 3).copy()
    texels = Texels(topology.halo, topology.rim, outside, positions, normals, offsets)
    for _ in range(_ROUNDS):
        active = _around(topology, folded(texels))
        if not len(active):
            break
        chosen, index = np.unique(active // (n * n), return_inverse=True)
        places = sampler.in_charts(n * _LATTICE, chosen)
        known = (places.small >= 0)[..., None]
        number = np.full(charts, -1)
        number[chosen] = np.arange(len(chosen))
        candidates = Candidates(number, np.where(known, places.positions, np.nan), places.normals)
        for i in range(_SWEEPS):
            if not _improve(texels, candidates, active[:: 1 if i % 2 == 0 else -1].copy()):
                break
        chart, row, column = np.unravel_index(active, topology.shape)
        moved = offsets[chart, row + 1, column + 1]
        at = index, row * _LATTICE + _LATTICE // 2 + moved[:, 1], column * _LATTICE + _LATTICE // 2 + moved[:, 0]
        changed = moved.any(axis=1)
        small[chart[changed], row[changed], column[changed]] = places.small[at][changed]
        weights[chart[changed], row[changed], column[changed]] = places.weights[at][changed]
    return sampler.samples(small, weights), offsets[:, 1:-1, 1:-1] / _LATTICE


def _around(topology: TexelTopology, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Flat indices of chosen texels [T] and of those round them."""
    n = topology.shape[1]
    for _ in range(_AROUND):
        halo = topology.with_halo(chosen.reshape(topology.shape))
        chosen = np.any([halo[:, i : i + n, j : j + n] for i in range(3) for j in range(3)], axis=0)
    return np.flatnonzero(chosen)


class Candidates(NamedTuple):
    """Places that texels of some charts may take."""

    number: Ints  # [C], of a chart among these; -1
    positions: Floats  # [k, n m, n m, 3] [m]; NaN where unknown
    normals: Floats  # [k, n m, n m, 3]


@kernel
def _fits(offsets: Floats, row: int, column: int) -> bool:
    """Whether the four squares of the lattice round a texel have wide corners after its move, on its chart."""
    n, least = offsets.shape[0] - 2, _FLATTEST * _LATTICE * _LATTICE
    x, y = np.empty(4), np.empty(4)
    for i in range(row - 1, row + 1):
        for j in range(column - 1, column + 1):
            for k in range(4):
                r, c = i + (1 if k >= 2 else 0), j + (1 if k == 1 or k == 2 else 0)
                # the border of the chart lies half a texel beyond the last ones, and does not move
                x[k] = _LATTICE * min(max(float(c), 0.5), n + 0.5) + offsets[r, c, 0]
                y[k] = _LATTICE * min(max(float(r), 0.5), n + 0.5) + offsets[r, c, 1]
            share = 0.5 if i == 0 or i == n else 1.0
            share *= 0.5 if j == 0 or j == n else 1.0
            for k in range(4):
                a, b = (k + 1) % 4, (k + 3) % 4
                if (x[a] - x[k]) * (y[b] - y[k]) - (y[a] - y[k]) * (x[b] - x[k]) < least * share:
                    return False
    return True


@kernel
def _improve(texels: Texels, candidates: Candidates, active: Ints) -> int:
    """Move each of these texels to its best place, one after the other; return how many moved."""
    n, half = texels.halo.shape[1] - 2, _LATTICE // 2
    moved = 0
    for flat in active:
        chart, row, column = flat // (n * n), flat // n % n + 1, flat % n + 1
        index, offset = candidates.number[chart], texels.offsets[chart, row, column]
        ox, oy = offset[0], offset[1]
        point, normal = texels.positions[flat].copy(), texels.normals[flat].copy()
        least = faults(texels, flat) + _PULL * (ox * ox + oy * oy) / (_LATTICE * _LATTICE)
        if least < 1e-12:
            continue
        best_x, best_y = ox, oy
        for i in range(-half, half + 1):
            for j in range(-half, half + 1):
                pull = _PULL * (i * i + j * j) / (_LATTICE * _LATTICE)
                offset[0], offset[1] = j, i
                r, c = (row - 1) * _LATTICE + half + i, (column - 1) * _LATTICE + half + j
                if pull >= least or not _fits(texels.offsets[chart], row, column):
                    continue
                texels.positions[flat] = candidates.positions[index, r, c]
                texels.normals[flat] = candidates.normals[index, r, c]
                if not texels.positions[flat, 0] < np.inf:
                    continue
                fault = faults(texels, flat) + pull
                if fault < least - 1e-9:
                    least, best_x, best_y = fault, j, i
        offset[0], offset[1] = best_x, best_y
        if best_x == ox and best_y == oy:
            texels.positions[flat], texels.normals[flat] = point, normal
        else:
            r, c = (row - 1) * _LATTICE + half + best_y, (column - 1) * _LATTICE + half + best_x
            texels.positions[flat] = candidates.positions[index, r, c]
            texels.normals[flat] = candidates.normals[index, r, c]
            moved += 1
    return moved
