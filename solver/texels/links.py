"""The links of the nine-point stencil: their ends, their lengths, and the copies of those that cross a glued side."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from .topology import TexelTopology

EAST, NORTH, NORTHEAST, NORTHWEST = range(4)

_EVERY, _LOW, _HIGH = slice(None), slice(None, -1), slice(1, None)
# For every link, the slices of a field with halo that hold its two ends.
LINK_ENDS = (
    ((_EVERY, _LOW, _LOW), (_EVERY, _LOW, _HIGH)),
    ((_EVERY, _LOW, _LOW), (_EVERY, _HIGH, _LOW)),
    ((_EVERY, _LOW, _LOW), (_EVERY, _HIGH, _HIGH)),
    ((_EVERY, _LOW, _HIGH), (_EVERY, _HIGH, _LOW)),
)


def link_lengths(topology: TexelTopology, halo_positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Real-space length of every link [m], [C, 4, n + 1, n + 1]; infinite where no link exists."""
    charts, n, _ = topology.shape
    lengths = np.full((charts, 4, n + 1, n + 1), np.inf)
    for link, (a, b) in enumerate(LINK_ENDS):
        exists = link_exists(topology, link) | ties_to_rim(topology, link)
        lengths[:, link][exists] = np.linalg.norm(halo_positions[a] - halo_positions[b], axis=-1)[exists]
    return mean_of_copies(topology, lengths)


def link_exists(topology: TexelTopology, link: int) -> NDArray[np.bool_]:
    """Where a link joins two texels of which one is the chart's own, [C, n + 1, n + 1]."""
    a, b = LINK_ENDS[link]
    there = (topology.halo >= 0) & ~topology.rim
    return there[a] & there[b] & (topology.own[a] | topology.own[b])


def ties_to_rim(topology: TexelTopology, link: int) -> NDArray[np.bool_]:
    """Where a link joins one of the chart's own texels to a fixed rim, [C, n + 1, n + 1]."""
    a, b = LINK_ENDS[link]
    own, rim = topology.own, topology.rim & topology.fixed_rim
    return (own[a] & rim[b]) | (rim[a] & own[b])


@functools.lru_cache(maxsize=4)  # asked for in every step, where a surface moves
def rim_ties(topology: TexelTopology) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Flat texels [k] that links tie to a fixed rim, and the flat places [k] of these among a stencil's weights."""
    charts, n, _ = topology.shape
    place = np.arange(4 * charts * (n + 1) ** 2).reshape(charts, 4, n + 1, n + 1)
    texels, places = [], []
    for link, (a, b) in enumerate(LINK_ENDS):
        tied = ties_to_rim(topology, link)
        own = np.where(topology.own[a], topology.halo[a], topology.halo[b])
        texels.append(own[tied])
        places.append(place[:, link][tied])
    return np.concatenate(texels), np.concatenate(places)


@dataclasses.dataclass(frozen=True, eq=False)
class CrossingLinks:
    """The links across glued sides; each is stored on two charts.

    Attributes
    ----------
    keys : int64 [k]
        Of the two texels that a copy joins, see `key`.
    places : tuple of int64 [k]
        Index of the copy in a stencil's weights.
    size : int
        Number of texels.
    """

    keys: NDArray[np.int64]
    places: tuple[NDArray[np.int64], ...]
    size: int

    @classmethod
    def of(cls, topology: TexelTopology) -> CrossingLinks:
        """The crossing links of a topology."""
        keys, places = [], []
        for link, (a, b) in enumerate(LINK_ENDS):
            crossing = link_exists(topology, link) & (topology.own[a] != topology.own[b])
            keys.append(_key(topology.halo[a][crossing], topology.halo[b][crossing], topology.texel_count))
            chart, row, column = np.nonzero(crossing)
            places.append(np.stack([chart, np.full_like(chart, link), row, column]))
        return cls(np.concatenate(keys), tuple(np.concatenate(places, axis=1)), topology.texel_count)

    def add(
        self, weights: NDArray[np.float64], pairs: NDArray[np.int64], values: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Add values [m] to both copies of the links between pairs of texels [m, 2]; return which pairs have none."""
        keys = _key(pairs[:, 0], pairs[:, 1], self.size)
        for key, value in zip(keys, values, strict=True):
            weights[tuple(index[self.keys == key] for index in self.places)] += value
        return ~np.isin(keys, self.keys)


def mean_of_copies(topology: TexelTopology, weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give both copies of every link that crosses a glued side their mean; clear entries that are not links."""
    for link in range(4):
        exists = link_exists(topology, link) | ties_to_rim(topology, link)
        weights[:, link][~exists & np.isfinite(weights[:, link])] = 0
    crossing = CrossingLinks.of(topology)
    if not len(crossing.keys):
        return weights
    _, pair = np.unique(crossing.keys, return_inverse=True)
    copies = weights[crossing.places]
    weights[crossing.places] = (np.bincount(pair, copies) / np.bincount(pair))[pair]
    return weights


def _key(a: NDArray[np.int64], b: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    return np.minimum(a, b) * size + np.maximum(a, b)
