"""The few cells of a texel mesh that are no plain quads: strips at rims, triangles and polygons in corners.

Where they lie and what they add to is worked out once; for a surface that moves, one compiled loop then does all of a
kind together.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Ints
from .fill_cells import Added, fill_areas, fill_polygons, fill_quads, fill_strips, fill_triangles
from .links import CrossingLinks
from .topology import TRIANGLE, TexelTopology

_CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))
# the links of a cell at (r, c), in the order of `quad`: link, and the place where it is stored
_LINKS = ((0, 0, 0), (0, 1, 0), (1, 0, 0), (1, 0, 1), (2, 0, 0), (3, 0, 0))
# two corners of a strip on the surface, the two beyond the rim opposite to them, and the link of the first two
_STRIPS = ((0, 1, 2, 3, 0), (2, 3, 0, 1, 1), (0, 2, 1, 3, 2), (1, 3, 0, 2, 3))


@dataclasses.dataclass(frozen=True, eq=False)
class SpecialCells:
    """Cells of one kind.

    Attributes
    ----------
    corners : int64 [k, j]
        Flat places of their corners in a field with halo.
    fill : kernel
        Fills in what they add, from coordinates [3, p] of all places [m] and the corners.
    counts : (int, int)
        How many links, and shares, a cell has.
    links : (int64 [m], int64 [m])
        Of their weights [k, l], flat, those that are added, and the flat places among a stencil's weights.
    shares : (int64 [s], int64 [s])
        Likewise of the shares, and flat texels.
    irregular : (int64 [i], int64 [i, 2])
        Likewise weights of links beyond the nine points, and the texels at both ends.
    on_all_copies : bool
        Whether what they add to a link that crosses a glued side is listed for each of its copies.
    """

    corners: Ints
    fill: Callable[[Floats, Ints, Added], None]
    counts: tuple[int, int]
    links: tuple[Ints, Ints]
    shares: tuple[Ints, Ints]
    irregular: tuple[Ints, Ints] = (np.zeros(0, np.int64), np.zeros((0, 2), np.int64))
    on_all_copies: bool = False

    def weigh(self, places: Floats) -> Added:
        """What they add where the places of a field with halo lie at coordinates [3, p] [m]."""
        count, (links, shares) = len(self.corners), self.counts
        added = Added(np.empty((count, links)), np.empty((count, shares)), np.empty(count))
        self.fill(places, self.corners, added)
        return added


def special_cells(topology: TexelTopology, halo_positions: Floats) -> list[SpecialCells]:
    """All cells of a texel mesh but the quads between four texels."""
    return [
        each
        for kind in (_rim_cells(topology, halo_positions), _triangles(topology), _polygons(topology))
        for each in kind
        if len(each.corners)
    ]


def whole_quads(topology: TexelTopology) -> NDArray[np.bool_]:
    """The quads between four texels, none of them beyond a rim, [C, n + 1, n + 1]."""
    there = (topology.halo >= 0) & ~topology.rim
    return there[:, :-1, :-1] & there[:, :-1, 1:] & there[:, 1:, :-1] & there[:, 1:, 1:]


def _rim_cells(topology: TexelTopology, halo_positions: Floats) -> Iterator[SpecialCells]:
    """Strips of half a texel between the last texels and a rim; see `cell_sums`."""
    halo, rim, width = topology.halo, topology.rim, topology.halo.shape[1]
    places = np.arange(halo.size).reshape(halo.shape)
    corners = np.stack([places[:, r : width - 1 + r, c : width - 1 + c] for r, c in _CORNERS], axis=-1)
    exists = (halo.reshape(-1)[corners] >= 0).all(-1) & rim.reshape(-1)[corners].any(-1)
    exists &= np.isfinite(halo_positions.reshape(-1, 3)[corners]).all((-1, -2))
    cell = np.argwhere(exists)
    corners = corners[exists]
    at_rim, shown = rim.reshape(-1)[corners], halo.reshape(-1)[corners]
    belongs = np.broadcast_to(np.arange(4), corners.shape).copy()
    for i in range(4):
        for j in range(4):
            belongs[at_rim[:, i] & ~at_rim[:, j] & (shown[:, i] == shown[:, j]), i] = j
    texels = _own_texels(topology, np.take_along_axis(corners, belongs, axis=1))
    shares = np.flatnonzero(texels.ravel() >= 0), texels.ravel()[texels.ravel() >= 0]
    if topology.fixed_rim:
        yield SpecialCells(corners, fill_quads, (6, 4), _link_places(topology, cell, _LINKS), shares)
        return
    nothing = np.zeros(0, np.int64), np.zeros(0, np.int64)
    yield SpecialCells(corners, fill_areas, (0, 4), nothing, shares)
    for i, j, p, q, link in _STRIPS:
        here = ~at_rim[:, i] & ~at_rim[:, j] & at_rim[:, p] & at_rim[:, q]
        strips = corners[here][:, [i, j, p, q]]
        yield SpecialCells(strips, fill_strips, (1, 0), _link_places(topology, cell[here], (_LINKS[link],)), nothing)


def _triangles(topology: TexelTopology) -> Iterator[SpecialCells]:
    """The cells in corners of three charts; each chart adds what its own texel there has of it."""
    n = topology.shape[1]
    places = np.arange(topology.halo.size).reshape(topology.halo.shape)
    for corner, (r, c) in enumerate(((0, 0), (0, n), (n, n), (n, 0))):
        chart = np.flatnonzero(topology.valence[:, corner] == TRIANGLE)
        r0, r1 = (1, 0) if r == 0 else (r, r + 1)
        c0, c1 = (1, 0) if c == 0 else (c, c + 1)
        corners = np.stack([places[chart, r0, c0], places[chart, r0, c1], places[chart, r1, c0]], axis=1)
        cell = np.stack([chart, np.full_like(chart, r), np.full_like(chart, c)], axis=1)
        links = _LINKS[2 + (c == 0)], _LINKS[r == 0]  # along the column and along the row
        own = np.arange(len(chart)), topology.halo.reshape(-1)[corners[:, 0]]
        yield SpecialCells(corners, fill_triangles, (2, 1), _link_places(topology, cell, links), own)


def _polygons(topology: TexelTopology) -> Iterator[SpecialCells]:
    """Polygons by their number of corners: their sides belong to the nine points, their diagonals do not."""
    crossing = CrossingLinks.of(topology)
    order = np.argsort(crossing.keys, kind="stable")
    keys, n = crossing.keys[order], topology.shape[1]
    places = np.ravel_multi_index(crossing.places, (topology.shape[0], 4, n + 1, n + 1))[order]
    for count in sorted({len(each) for each in topology.polygons}):
        texels = np.stack([each for each in topology.polygons if len(each) == count])
        pairs = np.stack([texels[:, each] for each in np.triu_indices(count, 1)], axis=-1).reshape(-1, 2)
        wanted = pairs.min(axis=1) * crossing.size + pairs.max(axis=1)
        first, last = np.searchsorted(keys, wanted), np.searchsorted(keys, wanted, side="right")
        copies = last - first
        source = np.repeat(np.arange(len(pairs)), copies)
        nth = np.arange(len(source)) - np.repeat(np.cumsum(copies) - copies, copies)
        beside = np.flatnonzero(copies == 0)
        yield SpecialCells(
            topology.addresses.texels[texels],
            fill_polygons,
            (count * (count - 1) // 2, count),
            (source, places[first[source] + nth]),
            (np.arange(texels.size), texels.ravel()),
            (beside, pairs[beside]),
            on_all_copies=True,
        )


def _own_texels(topology: TexelTopology, places: Ints) -> Ints:
    """Flat texels at places that are a chart's own, -1 elsewhere."""
    return np.where(topology.own.reshape(-1)[places], topology.halo.reshape(-1)[places], -1)


def _link_places(topology: TexelTopology, cell: Ints, links: tuple[tuple[int, int, int], ...]) -> tuple[Ints, Ints]:
    """Of links of cells [k, 3] (chart, row, column), flat, those that are stored, and where in a stencil's weights."""
    charts, n, _ = topology.shape
    chart, r, c = cell.T
    at = [(r + down, c + right) for _, down, right in links]
    stored = np.stack([(row <= n) & (column <= n) for row, column in at], axis=1)
    shape = charts, 4, n + 1, n + 1
    flat = [
        np.ravel_multi_index((chart, np.full_like(chart, link), row, column), shape, mode="clip")
        for (link, _, _), (row, column) in zip(links, at, strict=True)
    ]
    return np.flatnonzero(stored.ravel()), np.stack(flat, axis=1)[stored]
