"""The steps that clean a triangle soup; each triangle's corners carry their data along.

No step changes what a viewer sees. Equal vertices are merged and hairline cracks closed. Triangles
that collapse or repeat are dropped. Triangles without area (their corners lie on a line) are taken
out without opening the surface. At last all triangles are wound alike.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .topology import SPLITS, distinct, edges_of, labels, sides_of, turned

# Plurals in messages that do not end in "s".
_PLURALS = {"vertex": "vertices"}

# Widest crack that is closed, in units of the mesh's size: above the round-off of a file in
# float32, far below any gap that somebody modelled.
_MAX_CRACK_WIDTH = 1e-6

# Longest triangle that may vanish when a crack is closed, in widths of the crack. A longer one is a
# needle of the mesh.
_MAX_COLLAPSED_LENGTH = 10

# Height of a triangle over its longest side, up to which its corners lie on a line: a little above
# the round-off of float64.
_MAX_SLIVER_HEIGHT = 1e-12

# Passes that take out slivers; slivers that are left after them are dropped.
_MAX_SLIVER_PASSES = 64

# A part that encloses less, in units of its area to the power 3/2, has no inside.
_MIN_ENCLOSED_VOLUME = 1e-12


@dataclasses.dataclass(frozen=True)
class Corners:
    """The corners of triangles and their data.

    Side k of a triangle runs from corner k to corner k + 1.

    Attributes
    ----------
    F : int64 [triangle_count, 3]
        Vertices after merging: equal positions are one vertex.
    user_vertex : int64 [triangle_count, 3]
        Vertices in the user's arrays; -1 at vertices that cleaning added. Where surfaces touch,
        they show which triangles were joined.
    data : float64 [triangle_count, 3, k]
        Other values at the corners, linear in each triangle, such as texture coordinates.
    source : int64 [triangle_count]
        The user's triangle that each triangle was, or was cut from.
    """

    F: NDArray[np.int64]
    user_vertex: NDArray[np.int64]
    data: NDArray[np.float64]
    source: NDArray[np.int64]

    def subset(self, chosen: NDArray) -> Corners:
        """Some of the triangles, chosen by a mask or by number."""
        return Corners(
            F=self.F[chosen],
            user_vertex=self.user_vertex[chosen],
            data=self.data[chosen],
            source=self.source[chosen],
        )

    def reversed(self, chosen: NDArray[np.bool_]) -> Corners:
        """All triangles, the chosen ones wound the other way."""
        F = np.where(chosen[:, None], self.F[:, ::-1], self.F)
        user_vertex = np.where(chosen[:, None], self.user_vertex[:, ::-1], self.user_vertex)
        data = np.where(chosen[:, None, None], self.data[:, ::-1], self.data)
        return Corners(F, user_vertex, data, self.source)

    def split(
        self, point: NDArray[np.int64], user_vertex: NDArray[np.int64], share: NDArray[np.float64]
    ) -> Corners:
        """Insert vertices into sides, and cut the triangles there.

        The pieces keep the order, area and winding of the triangles.

        Parameters
        ----------
        point, user_vertex : [triangle_count, 3]
            Vertex to insert into each side, and its number in the user's arrays; -1 for no vertex.
        share : [triangle_count, 3]
            Place of the vertex, from 0 at the side's first corner to 1 at the second.
        """
        cut_sides = (point >= 0) @ [1, 2, 4]
        parents = []
        patterns = []
        for sides, pattern in {0: [[0, 1, 2]], **SPLITS}.items():
            chosen = np.flatnonzero(cut_sides == sides)
            parents.append(np.repeat(chosen, len(pattern)))
            patterns.append(np.tile(pattern, (len(chosen), 1)))
        # for each piece the triangle that it was cut from, and its corners, numbered as in `SPLITS`
        order = np.argsort(np.concatenate(parents), kind="stable")
        parent = np.concatenate(parents)[order]
        corner = np.concatenate(patterns)[order]
        F = np.hstack([self.F, point])
        user_vertices = np.hstack([self.user_vertex, user_vertex])
        change_along_side = np.roll(self.data, -1, axis=1) - self.data
        data_on_sides = self.data + share[..., None] * change_along_side
        data = np.concatenate([self.data, data_on_sides], axis=1)
        return Corners(
            F[parent[:, None], corner],
            user_vertices[parent[:, None], corner],
            data[parent[:, None], corner],
            self.source[parent],
        )


def counted(number: int, thing: str) -> str:
    """A number and its noun: 1 edge, 2 edges, 1,000 vertices."""
    *words, noun = thing.split()
    if number != 1:
        noun = _PLURALS.get(noun, noun + "s")
    return " ".join([f"{number:,}", *words, noun])


def place(point: NDArray[np.float64]) -> str:
    """A point in brackets, to four digits."""
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"


def merged_vertices(V: NDArray[np.float64], F: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Merge vertices at equal positions, and close cracks.

    A crack lies between boundary vertices that are within round-off of each other. Vertices inside
    of a surface are never joined to others nearby.

    Returns
    -------
    F : [m, 3]
        Each vertex is the first one at its position.
    joined : int
        Number of vertices that went when cracks were closed.
    """
    used = distinct(F)
    first = np.arange(len(V))
    # + 0.0 turns -0.0 into 0.0, which is the same place
    first[used] = used[_first_equal(V[used] + 0.0)]
    F = first[F]
    edges = edges_of(F)
    boundary = edges.ends[edges.rim]
    rim = np.unique(boundary[boundary[:, 0] != boundary[:, 1]])
    if len(rim) == 0:
        return F, 0
    joined = _crack_targets(V, F, rim)[F]
    return joined, len(distinct(F)) - len(distinct(joined))


def _crack_targets(
    V: NDArray[np.float64], F: NDArray[np.int64], rim: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The vertex with which each vertex [n] is to be joined so that cracks close, or itself.

    `rim` has the boundary vertices. Joining them must not make a needle of the mesh vanish, which
    is as thin as a crack, but long.
    """
    width = _MAX_CRACK_WIDTH * np.ptp(V[F.ravel()], axis=0).max()  # [m]
    label = labels(cKDTree(V[rim]).query_pairs(width, output_type="ndarray"), len(rim))
    first_of_label = rim[np.unique(label, return_index=True)[1]]
    target = np.arange(len(V))
    target[rim] = first_of_label[label]
    vanishing = F[collapsed(target[F]) & ~collapsed(F)]
    side = V[vanishing] - V[np.roll(vanishing, 1, axis=1)]
    length = np.linalg.norm(side, axis=-1).max(axis=1)
    needles = vanishing[length > _MAX_COLLAPSED_LENGTH * width]
    at_needle = np.isin(target, target[needles])
    return np.where(at_needle, np.arange(len(V)), target)


def distinct_triangles(F: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mask of the triangles with three different vertices; of repeated triangles only the first."""
    return ~collapsed(F) & (_first_equal(np.sort(F, axis=1)) == np.arange(len(F)))


def collapsed(F: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mask of the triangles that have a vertex twice."""
    return (F[:, 0] == F[:, 1]) | (F[:, 1] == F[:, 2]) | (F[:, 2] == F[:, 0])


def _first_equal(rows: NDArray) -> NDArray[np.int64]:
    """Index of the first row that equals each row."""
    order = np.lexsort(rows.T)
    starts = np.ones(len(rows), dtype=bool)
    starts[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    first = np.empty(len(rows), dtype=np.int64)
    first[order] = order[starts][np.cumsum(starts) - 1]
    return first


def without_slivers(V: NDArray[np.float64], corners: Corners) -> tuple[Corners, int]:
    """Drop slivers, triangles whose corners lie on a line, and return how many there were.

    The triangle beyond the longest side of a sliver gets the sliver's middle corner, so that the
    surface stays closed. Corners without slivers come back unchanged.
    """
    sliver, length = _slivers(V, corners.F)
    count = int(sliver.sum())
    for _ in range(_MAX_SLIVER_PASSES):
        if not sliver.any():
            return corners, count
        corners = _without_longest_slivers(V, corners, sliver, length)
        sliver, length = _slivers(V, corners.F)
    return corners.subset(~sliver), count


def _slivers(
    V: NDArray[np.float64], F: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Mask of the triangles without area [m], and the lengths of all sides [m, 3]."""
    sides = V[np.roll(F, -1, axis=1)] - V[F]
    length = np.linalg.norm(sides, axis=-1)
    twice_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return twice_area <= _MAX_SLIVER_HEIGHT * length.max(axis=1) ** 2, length


def _without_longest_slivers(
    V: NDArray[np.float64], corners: Corners, sliver: NDArray[np.bool_], length: NDArray[np.float64]
) -> Corners:
    """Take out the slivers that are longer than all slivers beside them.

    So no two of them are neighbours. `sliver` and `length` are those of `_slivers`.
    """
    F = corners.F
    longest_side = length.argmax(axis=1)
    # the longest sliver has the highest rank; other triangles have -1
    rank = np.full(len(F), -1)
    rank[np.lexsort((length.max(axis=1), sliver))] = np.arange(len(F))
    rank[~sliver] = -1
    edge = edges_of(F).of_side
    highest = np.full(edge.max() + 1, -1)
    np.maximum.at(highest, edge, np.repeat(rank[:, None], 3, axis=1))
    removed = sliver & (highest[edge] == rank[:, None]).all(axis=1)
    # the removed sliver, if any, whose longest side lies on each side of the other triangles
    numbers = np.flatnonzero(removed)
    sliver_at_edge = np.full(len(highest), -1)
    sliver_at_edge[edge[numbers, longest_side[numbers]]] = numbers
    beyond = np.where(removed[:, None], -1, sliver_at_edge[edge])
    # the sliver's middle corner, opposite to its longest side, goes into that side
    middle = (longest_side[beyond] + 2) % 3
    point = np.where(beyond >= 0, F[beyond, middle], -1)
    user_vertex = np.where(beyond >= 0, corners.user_vertex[beyond, middle], -1)
    share = np.linalg.norm(V[point] - V[F], axis=-1) / np.maximum(length, np.finfo(float).tiny)
    stays = ~removed
    split = corners.subset(stays).split(point[stays], user_vertex[stays], share[stays])
    return split.subset(distinct_triangles(split.F))


def oriented(V: NDArray[np.float64], corners: Corners) -> tuple[Corners, list[str]]:
    """Wind the triangles of each part of a manifold, orientable surface alike.

    Returns notes of the parts and triangles that were turned, too. A closed part faces outwards
    afterwards, wherever it lies. An open part, and a closed one without volume, faces as most of
    its triangles did.
    """
    F = corners.F
    pairs, rim = sides_of(F)
    part = labels(pairs // 3, len(F))
    count = int(part.max()) + 1
    start = F.ravel()
    # joined sides run against each other where two triangles are wound alike
    against = start[pairs[:, 0]] == start[pairs[:, 1]]
    flip = turned(pairs // 3, against, len(F))
    volume, area = part_volumes(V, np.where(flip[:, None], F[:, ::-1], F), part)
    closed = np.bincount(part[rim // 3], minlength=count) == 0
    sizes = np.bincount(part)
    turns = np.bincount(part, weights=flip)
    has_inside = closed & (np.abs(volume) > _MIN_ENCLOSED_VOLUME * area**1.5)
    turn_part = np.where(has_inside, volume < 0, 2 * turns > sizes)
    flip ^= turn_part[part]
    all_turned = np.bincount(part, weights=flip, minlength=count) == sizes
    single_turns = int((flip & ~all_turned[part]).sum())
    notes = []
    if all_turned.any():
        which = "" if count == 1 else f"{int(all_turned.sum()):,} of {counted(count, 'part')} "
        notes.append(f"{which}turned inside out (the triangles faced inwards)")
    if single_turns:
        notes.append(f"{counted(single_turns, 'triangle')} reversed (inconsistent winding)")
    return (corners.reversed(flip) if flip.any() else corners), notes


def part_volumes(
    V: NDArray[np.float64], F: NDArray[np.int64], part: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Signed volume of every part [m^3], exact if the part is closed, and its area [m^2].

    `part` [triangle_count] is the part of every triangle, numbered from 0.
    """
    count = int(part.max()) + 1
    size = np.bincount(part)
    corners = V[F]
    coordinates = corners.mean(axis=1).T
    middle = np.stack([np.bincount(part, weights=x) / size for x in coordinates], axis=1)
    # seen from the middle of its part, a far part loses no digits
    a, b, c = np.moveaxis(corners - middle[part][:, None], 1, 0)
    six_volumes = np.einsum("ij,ij->i", a, np.cross(b, c))
    two_areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    volume = np.bincount(part, weights=six_volumes, minlength=count) / 6
    area = np.bincount(part, weights=two_areas, minlength=count) / 2
    return volume, area
