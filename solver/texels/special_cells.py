"""The few cells of a texel mesh that are no plain quads: strips at rims, triangles and polygons in corners.

Where they lie and what they add to is worked out once; their weights then follow from wherever their corners are.
Between the last texels and a rim lies a strip of half a texel: where the rim is free, heights in it change along the
rim only, and its area goes to the texels. Nothing is known of a strip where the rim has no positions.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import TypeAlias

import numpy as np

from ..kernel import Floats, Ints
from .cells import polygons, quad, quad_area, strip, triangle
from .stencil import crossing_links
from .topology import TRIANGLE, TexelTopology

# The four corners of a cell at (r, c), and its links in the order of `quad`: link, and the place where it is stored.
CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))
LINKS = ((0, 0, 0), (0, 1, 0), (1, 0, 0), (1, 0, 1), (2, 0, 0), (3, 0, 0))
_SOUTH, _NORTH, _WEST, _EAST = LINKS[:4]

# Two corners of a strip on the surface, the two beyond the rim opposite to them, and the link of the first two.
_STRIPS = ((0, 1, 2, 3, _SOUTH), (2, 3, 0, 1, _NORTH), (0, 2, 1, 3, _WEST), (1, 3, 0, 2, _EAST))

_NOTHING = np.zeros(0, np.int64)

# Geometric weights of a cell's links [l, k], shares of its area [s, k], and the area [k], from its corners [3, j, k].
Law: TypeAlias = Callable[[Floats], tuple[Floats, Floats, Floats]]


@dataclasses.dataclass(frozen=True, eq=False)
class SpecialCells:
    """Cells of one kind, k of them.

    Attributes
    ----------
    corners : int64 [j, k]
        Flat places of their corners in a field with halo.
    law : callable
    links : (int64 [m], int64 [m])
        Of the weights [l, k], flat, those that are added, and the flat places among a stencil's weights.
    shares : (int64 [m], int64 [m])
        Of the shares [s, k], flat, those that are added, and flat texels.
    irregular : (int64 [m], int64 [m, 2])
        Of the weights, flat, those of links beyond the nine points, and the texels at both ends.
    on_all_copies : bool
        Whether what they add to a link that crosses a glued side is listed for each of its copies.
    """

    corners: Ints
    law: Law
    links: tuple[Ints, Ints]
    shares: tuple[Ints, Ints]
    irregular: tuple[Ints, Ints] = (_NOTHING, np.zeros((0, 2), np.int64))
    on_all_copies: bool = False

    def weigh(self, places: Floats, scale: float) -> tuple[Floats, Floats, Floats]:
        """Weights of their links [l, k], shares of their areas [s, k] and the areas [k], both [m^2].

        Parameters
        ----------
        places : float64 [3, p]
            Coordinates of all places of a field with halo [m].
        scale : float
            One over about a cell's length [1/m].
        """
        links, shares, areas = self.law(scale * places[:, self.corners])
        return links, shares / scale**2, areas / scale**2


def special_cells(topology: TexelTopology, halo_positions: Floats) -> list[SpecialCells]:
    """All cells of a texel mesh but the quads between four texels."""
    kinds = (*_rim_cells(topology, halo_positions), _triangles(topology), *_polygons(topology))
    return [each for each in kinds if each.corners.size]


def _rim_cells(topology: TexelTopology, halo_positions: Floats) -> Iterator[SpecialCells]:
    """Strips between the last texels and a rim: whole quads where it is fixed."""
    n = topology.shape[1]
    there, rim = topology.halo >= 0, topology.rim
    exists, touches = (
        function.reduce([field[:, r : n + 1 + r, c : n + 1 + c] for r, c in CORNERS])
        for function, field in ((np.logical_and, there), (np.logical_or, rim))
    )
    cells = np.stack(np.nonzero(exists & touches))
    corners = _corner_places(topology, cells)
    finite = np.isfinite(halo_positions.reshape(-1, 3)[corners]).all(axis=(0, 2))
    cells, corners = cells[:, finite], corners[:, finite]
    at_rim, shown = rim.reshape(-1)[corners], topology.halo.reshape(-1)[corners]
    # a corner beyond the rim has its share go to the texel beside it
    belongs = np.broadcast_to(np.arange(4)[:, None], corners.shape).copy()
    for i in range(4):
        for j in range(4):
            belongs[i, at_rim[i] & ~at_rim[j] & (shown[i] == shown[j])] = j
    texels = np.take_along_axis(corners, belongs, axis=0)
    shares = np.flatnonzero(topology.own.reshape(-1)[texels])
    to_texels = shares, topology.halo.reshape(-1)[texels.ravel()[shares]]
    if topology.fixed_rim:
        yield SpecialCells(corners, _whole_quads, _link_places(topology, cells, LINKS), to_texels)
        return
    yield SpecialCells(corners, _areas, (_NOTHING, _NOTHING), to_texels)
    for i, j, p, q, link in _STRIPS:
        here = ~at_rim[i] & ~at_rim[j] & at_rim[p] & at_rim[q]
        places = _link_places(topology, cells[:, here], (link,))
        yield SpecialCells(corners[[i, j, p, q]][:, here], _strips, places, (_NOTHING, _NOTHING))


def _triangles(topology: TexelTopology) -> SpecialCells:
    """The cells in corners of three charts; each chart adds what its own texel there, the first corner, has of it."""
    n, width = topology.shape[1], topology.halo.shape[1]
    corners: list[Ints] = []
    sources, places, count = [], [], (topology.valence == TRIANGLE).sum()
    for corner, (r, c) in enumerate(((0, 0), (0, n), (n, n), (n, 0))):
        chart = np.flatnonzero(topology.valence[:, corner] == TRIANGLE)
        r0, r1 = (1, 0) if r == 0 else (r, r + 1)
        c0, c1 = (1, 0) if c == 0 else (c, c + 1)
        row, column = np.array([[r0, r0, r1], [c0, c1, c0]])[:, :, None]
        before = sum(each.shape[1] for each in corners)
        corners.append((chart * width + row) * width + column)
        cells = np.stack([chart, np.full_like(chart, r), np.full_like(chart, c)])
        for k, link in enumerate((_EAST if c == 0 else _WEST, _NORTH if r == 0 else _SOUTH)):
            source, place = _link_places(topology, cells, (link,))
            sources.append(k * count + before + source)
            places.append(place)
    found = np.concatenate(corners, axis=1)
    own = np.arange(count), topology.halo.reshape(-1)[found[0]]
    return SpecialCells(found, _triangle, (np.concatenate(sources), np.concatenate(places)), own)


def _polygons(topology: TexelTopology) -> Iterator[SpecialCells]:
    """Polygons by their number of corners: their sides belong to the nine points, their diagonals do not."""
    crossing = crossing_links(topology)
    for count in sorted({len(each) for each in topology.polygons}):
        texels = np.stack([each for each in topology.polygons if len(each) == count], axis=1)
        first, second = np.triu_indices(count, 1)
        pairs = np.stack([texels[first], texels[second]], axis=-1).reshape(-1, 2)
        link, places = crossing.between(pairs)
        beside = np.setdiff1d(np.arange(len(pairs)), link)
        corners = topology.addresses.texels[texels]
        shares = np.arange(texels.size), texels.ravel()
        yield SpecialCells(corners, _polygon, (link, places), shares, (beside, pairs[beside]), on_all_copies=True)


def _corner_places(topology: TexelTopology, cells: Ints) -> Ints:
    """Flat places [4, k] of the corners of cells [3, k]: chart, row and column."""
    width = topology.halo.shape[1]
    chart, r, c = cells
    return np.stack([(chart * width + r + down) * width + c + right for down, right in CORNERS])


def _link_places(topology: TexelTopology, cells: Ints, links: tuple[tuple[int, int, int], ...]) -> tuple[Ints, Ints]:
    """Of links [l, k] of cells [3, k], flat, those that are stored, and where in a stencil's weights."""
    n = topology.shape[1]
    link, down, right = np.transpose(links)[:, :, None]
    chart, row, column = cells[0], cells[1] + down, cells[2] + right
    stored = (row <= n) & (column <= n)
    places = ((4 * chart + link) * (n + 1) + row) * (n + 1) + column
    return np.flatnonzero(stored), places[stored]


def _whole_quads(x: Floats) -> tuple[Floats, Floats, Floats]:
    """Six links, and a quarter of the area to each corner."""
    *links, area = quad(*_from_first(x))
    return np.stack(links), np.tile(area / 4, (4, 1)), area


def _areas(x: Floats) -> tuple[Floats, Floats, Floats]:
    """Quads without links."""
    area = quad_area(*_from_first(x))
    return np.zeros((0, len(area))), np.tile(area / 4, (4, 1)), area


def _strips(x: Floats) -> tuple[Floats, Floats, Floats]:
    """The link of the first two corners."""
    weight = strip(x[:, 0], x[:, 1], x[:, 2], x[:, 3])
    return weight[None], np.zeros((0, len(weight))), quad_area(*_from_first(x))


def _triangle(x: Floats) -> tuple[Floats, Floats, Floats]:
    """The links of the first corner with the third and the second, and its share."""
    _, to_third, to_second, area = triangle(x[:, 0], x[:, 1], x[:, 2])
    return np.stack([to_third, to_second]), area[None] / 3, area


def _polygon(x: Floats) -> tuple[Floats, Floats, Floats]:
    """The links between all pairs of corners."""
    links, shares = polygons(x)
    return links, shares, shares.sum(axis=0)


def _from_first(x: Floats) -> tuple[Floats, Floats, Floats]:
    """Ways from the first of four corners to the others."""
    return x[:, 1] - x[:, 0], x[:, 2] - x[:, 0], x[:, 3] - x[:, 0]
