"""The special cells of a texel mesh: where they lie, and to which links and texels they add.

The few special cells, which are no plain quads, are strips at rims, and triangles and polygons in
corners. Their places, and the links and texels to which they add, are worked out once; their
weights then follow from wherever their corners are. Between the last texels and a rim lies a strip
of half a texel. Where the rim is free, heights in the strip change along the rim only, and its area
goes to the texels. There is no strip where the rim has no positions.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Ints
from ..mesh.vectors import dot
from .cells import MIN_AREA, TINY_AREA, ZERO, polygons, quad, quad_area, triangle
from .stencil import crossing_links
from .topology import TRIANGLE, TexelTopology

# Row and column of the four corners of a cell at (r, c), from there.
CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))

# Links of a cell at (r, c), in the order of `quad`: number of the link, and row and column of the
# place where it is stored, from (r, c).
LINKS = ((0, 0, 0), (0, 1, 0), (1, 0, 0), (1, 0, 1), (2, 0, 0), (3, 0, 0))

# Corners of the four kinds of strips: two on the surface, which the first four links join kind by
# kind, and opposite the two beyond the rim.
_STRIPS = ((0, 1, 2, 3), (2, 3, 0, 1), (0, 2, 1, 3), (1, 3, 0, 2))

# No places.
_NOTHING = np.zeros(0, np.int64)


def at_corners(field: NDArray) -> list[NDArray]:
    """A field [..., r + 1, c + 1] at the four corners of each of r x c cells."""
    rows = field.shape[-2] - 1
    columns = field.shape[-1] - 1
    return [field[..., r : rows + r, c : columns + c] for r, c in CORNERS]


@dataclasses.dataclass(frozen=True, eq=False)
class SpecialCells:
    """Cells of one kind, k of them.

    Attributes
    ----------
    corners : int64 [j, k]
        Flat places of their corners in a field with halo.
    law : callable
        From corners [3, j, k] to geometric weights of the links [l, k], shares of the areas [s, k],
        and the areas [k].
    links : (int64 [m], int64 [m])
        Flat indices, among the weights [l, k], of weights that are added, and the flat places among
        a stencil's weights to which they are added.
    shares : (int64 [m], int64 [m])
        Flat indices, among the shares [s, k], of shares that are added, and the flat texels to
        which they are added.
    irregular : (int64 [m], int64 [m, 2])
        Flat indices, among the weights, of links beyond the nine points, and the texels at both
        ends.
    on_all_copies : bool
        Whether `links` lists every copy of a link that crosses a glued side.
    """

    corners: Ints
    law: Callable[[Floats], tuple[Floats, Floats, Floats]]
    links: tuple[Ints, Ints]
    shares: tuple[Ints, Ints]
    irregular: tuple[Ints, Ints] = (_NOTHING, np.zeros((0, 2), np.int64))
    on_all_copies: bool = False

    def weigh(self, places: Floats, scale: float) -> tuple[Floats, Floats, Floats]:
        """Weights of the links [l, k], shares of the areas [s, k] and the areas [k], both [m^2].

        `places` [3, p] are the positions of a field with halo [m], and `scale` is one over about
        the length of a cell [1/m].
        """
        links, shares, areas = self.law(scale * places[:, self.corners])
        return links, shares / scale**2, areas / scale**2


def special_cells(topology: TexelTopology, halo_positions: Floats) -> list[SpecialCells]:
    """All cells of a texel mesh but the quads between four texels."""
    kinds = (*_rim_cells(topology, halo_positions), _triangles(topology), *_polygons(topology))
    return [cells for cells in kinds if cells.corners.size]


def _rim_cells(topology: TexelTopology, halo_positions: Floats) -> Iterator[SpecialCells]:
    """Strips between the last texels and a rim; at a fixed rim they are whole quads."""
    n = topology.shape[1]
    rim = topology.rim
    exists = np.logical_and.reduce(at_corners(topology.halo >= 0))
    touches = np.logical_or.reduce(at_corners(rim))
    chart, r, c = cells = np.stack(np.nonzero(exists & touches))
    corners = np.stack(
        [(chart * (n + 2) + r + down) * (n + 2) + c + right for down, right in CORNERS]
    )
    finite = np.isfinite(halo_positions.reshape(-1, 3)[corners]).all(axis=(0, 2))
    cells = cells[:, finite]
    corners = corners[:, finite]
    at_rim = rim.reshape(-1)[corners]
    shown = topology.halo.reshape(-1)[corners]
    # the share of a corner beyond the rim goes to the texel beside it
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
    for (i, j, p, q), link in zip(_STRIPS, LINKS[:4], strict=True):
        is_strip = ~at_rim[i] & ~at_rim[j] & at_rim[p] & at_rim[q]
        strip_corners = corners[[i, j, p, q]][:, is_strip]
        places = _link_places(topology, cells[:, is_strip], (link,))
        yield SpecialCells(strip_corners, _strips, places, (_NOTHING, _NOTHING))


def _triangles(topology: TexelTopology) -> SpecialCells:
    """The triangles in corners of three charts.

    Each of the charts adds the share of its own texel there, the first corner.
    """
    n = topology.shape[1]
    width = topology.halo.shape[1]
    corner, chart = np.nonzero(topology.valence.T == TRIANGLE)
    r, c = np.array([[0, 0, n, n], [0, n, n, 0]])[:, corner]
    # in a chart with halo: row and column of the chart's own texel, and those beyond it
    row, next_row = np.where(r == 0, [[1], [0]], [r, r + 1])
    column, next_column = np.where(c == 0, [[1], [0]], [c, c + 1])
    corners = (chart * width + np.stack([row, row, next_row])) * width + np.stack(
        [column, next_column, column]
    )
    # the east or west side, and the north or south one
    links = _link_places(topology, np.stack([chart, r, c]), ((1, 0, c == 0), (0, r == 0, 0)))
    shares = np.arange(len(chart)), topology.halo.reshape(-1)[corners[0]]
    return SpecialCells(corners, _triangle, links, shares)


def _polygons(topology: TexelTopology) -> Iterator[SpecialCells]:
    """Polygons by their number of corners.

    Their sides are links of the nine points, their diagonals are not.
    """
    for count in sorted({len(polygon) for polygon in topology.polygons}):
        of_this_size = [polygon for polygon in topology.polygons if len(polygon) == count]
        texels = np.stack(of_this_size, axis=1)
        first, second = np.triu_indices(count, 1)
        pairs = np.stack([texels[first], texels[second]], axis=-1).reshape(-1, 2)
        link, places = crossing_links(topology).between(pairs)
        beside = np.setdiff1d(np.arange(len(pairs)), link)
        corners = topology.addresses[0][texels]
        shares = np.arange(texels.size), texels.ravel()
        yield SpecialCells(
            corners, _polygon, (link, places), shares, (beside, pairs[beside]), on_all_copies=True
        )


def _link_places(topology: TexelTopology, cells: Ints, links: Sequence[tuple]) -> tuple[Ints, Ints]:
    """Links [l, k] of cells [3, k] that are stored, and their places in a stencil's weights.

    Both are flat.
    """
    n = topology.shape[1]
    chart, r, c = cells
    stored = []
    places = []
    for link, down, right in links:
        row = r + down
        column = c + right
        stored.append((row <= n) & (column <= n))
        places.append(((4 * chart + link) * (n + 1) + row) * (n + 1) + column)
    is_stored = np.stack(stored)
    return np.flatnonzero(is_stored), np.stack(places)[is_stored]


def _whole_quads(x: Floats) -> tuple[Floats, Floats, Floats]:
    """Six links, and a quarter of the area to each corner."""
    *links, area = quad(*_from_first(x), (ZERO,) * 6)
    return np.stack(links), np.tile(area / 4, (4, 1)), area


def _areas(x: Floats) -> tuple[Floats, Floats, Floats]:
    """Quads without links."""
    area = quad_area(*_from_first(x))
    return np.zeros((0, len(area))), np.tile(area / 4, (4, 1)), area


def _strips(x: Floats) -> tuple[Floats, Floats, Floats]:
    """The link of the first two corners, which are texels at a free rim.

    The other two corners are the points of the rim beside them. Heights have no slope across a free
    rim (the natural condition). Their gradient in the strip is the difference of the two texels
    over their distance along the rim, at whatever angle the grid lines meet the rim.
    """
    link = x[:, 1] - x[:, 0]
    rim = x[:, 3] - x[:, 2]
    area = quad_area(*_from_first(x))
    rim_squared = dot(rim, rim)
    along_squared = dot(rim, link) ** 2 / np.maximum(rim_squared, TINY_AREA)
    min_along_squared = MIN_AREA * np.maximum(rim_squared, dot(link, link))
    divisor = np.maximum(np.maximum(along_squared, min_along_squared), TINY_AREA)
    weight = np.where(rim_squared > 0, area / divisor, 0.0)
    return weight[None], np.zeros((0, len(weight))), area


def _triangle(x: Floats) -> tuple[Floats, Floats, Floats]:
    """The links of the first corner with the third and the second, and its share."""
    _, to_third, to_second, area = triangle(x[:, 0], x[:, 1], x[:, 2])
    return np.stack([to_third, to_second]), area[None] / 3, area


def _polygon(x: Floats) -> tuple[Floats, Floats, Floats]:
    """The links between all pairs of corners."""
    links, shares = polygons(np.ascontiguousarray(x))
    return links, shares, shares.sum(axis=0)


def _from_first(x: Floats) -> tuple[Floats, Floats, Floats]:
    """Ways from the first of four corners to the others."""
    return x[:, 1] - x[:, 0], x[:, 2] - x[:, 0], x[:, 3] - x[:, 0]
