"""Triangles on their way through cleaning, with what belongs to each of their corners; and the steps of that.

Nothing is done that could be seen: equal vertices are merged, hairline cracks closed, and triangles
dropped that collapse or repeat. Triangles without area, whose corners lie on a line, are taken out
without opening the surface. Then all are wound alike.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .topology import SPLITS, distinct, edges_of, labels, sides_of, turned

_PLURALS = {"vertex": "vertices"}

# Relative to the size of the mesh: above the round-off of a file in float32, far below any gap that
# is meant.
_CRACK = 1e-6

# In widths of a crack: a triangle that is longer does not vanish with it.
_NEEDLE = 10

# Height over longest side below which three corners lie on a line: a little above the round-off of
# float64.
_FLAT = 1e-12
_ROUNDS = 64

# A part that encloses less, relative to its area, has no inside.
_NO_INSIDE = 1e-12


@dataclasses.dataclass(frozen=True)
class Corners:
    """What belongs to the corners of triangles; side k of a triangle runs from corner k to corner k + 1.

    Attributes
    ----------
    F : int64 [triangle_count, 3]
        Vertex, equal positions being one vertex.
    given : int64 [triangle_count, 3]
        Vertex as it was given: at places where surfaces touch, it tells which triangles were
        joined.
    uv : float64 [triangle_count, 3, 2] or None
        Texture coordinates.
    """

    F: NDArray[np.int64]
    given: NDArray[np.int64]
    uv: NDArray[np.float64] | None

    def kept(self, keep: NDArray) -> Corners:
        """Some of the triangles, chosen by a mask or by number."""
        return Corners(self.F[keep], self.given[keep], None if self.uv is None else self.uv[keep])

    def reversed(self, which: NDArray[np.bool_]) -> Corners:
        """The same triangles, those chosen wound the other way."""
        F, given = (np.where(which[:, None], x[:, ::-1], x) for x in (self.F, self.given))
        return Corners(
            F,
            given,
            None if self.uv is None else np.where(which[:, None, None], self.uv[:, ::-1], self.uv),
        )

    def split(
        self, point: NDArray[np.int64], given: NDArray[np.int64], share: NDArray[np.float64]
    ) -> Corners:
        """Insert vertices into sides, and cut the triangles there.

        They keep their order, area and winding.

        Parameters
        ----------
        point, given : [triangle_count, 3]
            Vertex to be inserted into each side, and its number as given; -1 where there is none.
        share : [triangle_count, 3]
            Where it lies, from 0 at the side's first corner to 1 at the other.
        """
        sets = (point >= 0) @ [1, 2, 4]
        parents = []
        patterns = []
        for number, pattern in {0: [[0, 1, 2]], **SPLITS}.items():
            chosen = np.flatnonzero(sets == number)
            parents.append(np.repeat(chosen, len(pattern)))
            patterns.append(np.tile(pattern, (len(chosen), 1)))
        # of each piece, the triangle of which it is a part, and its corners, as `SPLITS` numbers
        # them
        order = np.argsort(np.concatenate(parents), kind="stable")
        parent = np.concatenate(parents)[order]
        corner = np.concatenate(patterns)[order]
        F = np.hstack([self.F, point])
        numbers = np.hstack([self.given, given])
        uv = None
        if self.uv is not None:
            along = self.uv + share[..., None] * (np.roll(self.uv, -1, axis=1) - self.uv)
            uv = np.concatenate([self.uv, along], axis=1)[parent[:, None], corner]
        return Corners(F[parent[:, None], corner], numbers[parent[:, None], corner], uv)


def counted(number: int, thing: str) -> str:
    """A number and its noun: 1 edge, 2 edges, 1,000 vertices."""
    *words, noun = thing.split()
    return " ".join(
        [f"{number:,}", *words, noun if number == 1 else _PLURALS.get(noun, noun + "s")]
    )


def place(point: NDArray[np.float64]) -> str:
    """A point in brackets, to four digits."""
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"


def merged_vertices(V: NDArray[np.float64], F: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Triangles [m, 3] in which equal positions are one vertex, the first of them; and how many cracks' ends joined.

    Those are boundary vertices that lie within round-off of each other. Inside of a surface none is
    joined.
    """
    used = distinct(F)
    first = np.arange(len(V))
    # + 0.0 turns -0.0 into 0.0, which are the same place
    first[used] = used[_first_equal(V[used] + 0.0)]
    F = first[F]
    edges = edges_of(F)
    alone = edges.ends[edges.rim]
    rim = np.unique(alone[alone[:, 0] != alone[:, 1]])
    if len(rim) == 0:
        return F, 0
    width = _CRACK * np.ptp(V[F.ravel()], axis=0).max()
    label = labels(cKDTree(V[rim]).query_pairs(width, output_type="ndarray"), len(rim))
    target = np.arange(len(V))
    target[rim] = rim[np.unique(label, return_index=True)[1]][label]
    # a needle is as thin as a crack, but no crack
    lost = collapsed(target[F]) & ~collapsed(F)
    length = np.linalg.norm(V[F[lost]] - V[np.roll(F[lost], 1, axis=1)], axis=-1).max(axis=1)
    needles = np.isin(target, target[F[lost][length > _NEEDLE * width]])
    joined = np.where(needles, np.arange(len(V)), target)[F]
    return joined, len(distinct(F)) - len(distinct(joined))


def distinct_triangles(F: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mask of the triangles with three different vertices that are the first with these three."""
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
    """Drop triangles whose corners lie on a line, and say how many; unchanged where there are none.

    What bordered on the longest side of one gets the middle corner.
    """
    flat, length = _flat(V, corners.F)
    before = int(flat.sum())
    for _ in range(_ROUNDS):
        if not flat.any():
            return corners, before
        corners = _without_longest(V, corners, flat, length)
        flat, length = _flat(V, corners.F)
    return corners.kept(~flat), before


def _flat(
    V: NDArray[np.float64], F: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Mask of the triangles without area, and the lengths of all sides [m, 3]."""
    sides = V[np.roll(F, -1, axis=1)] - V[F]
    length = np.linalg.norm(sides, axis=-1)
    twice_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return twice_area <= _FLAT * length.max(axis=1) ** 2, length


def _without_longest(
    V: NDArray[np.float64], corners: Corners, flat: NDArray[np.bool_], length: NDArray[np.float64]
) -> Corners:
    """Take out slivers of which no two are neighbours, the longest first; of the two arrays see `_flat`."""
    F = corners.F
    longest = length.argmax(axis=1)
    rank = np.full(len(F), -1)
    rank[np.lexsort((length.max(axis=1), flat))] = np.arange(len(F))
    rank[~flat] = -1
    edge = edges_of(F).of
    highest = np.full(edge.max() + 1, -1)
    np.maximum.at(highest, edge, np.repeat(rank[:, None], 3, axis=1))
    out = flat & (highest[edge] == rank[:, None]).all(axis=1)
    removed = np.flatnonzero(out)
    source = np.full(len(highest), -1)
    source[edge[removed, longest[removed]]] = removed
    source = np.where(out[:, None], -1, source[edge])
    corner = (longest[source] + 2) % 3
    point, given = (np.where(source >= 0, x[source, corner], -1) for x in (F, corners.given))
    share = np.linalg.norm(V[point] - V[F], axis=-1) / np.maximum(length, np.finfo(float).tiny)
    split = corners.kept(~out).split(point[~out], given[~out], share[~out])
    return split.kept(distinct_triangles(split.F))


def oriented(V: NDArray[np.float64], corners: Corners) -> tuple[Corners, list[str]]:
    """Wind the triangles of a manifold, orientable surface alike, part by part, and say what was turned.

    A closed part faces outwards, wherever it lies; an open one, and one without volume, as most of
    its triangles did.
    """
    F = corners.F
    pairs, rim = sides_of(F)
    part = labels(pairs // 3, len(F))
    count = int(part.max()) + 1
    start = F.ravel()
    flip = turned(pairs // 3, start[pairs[:, 0]] == start[pairs[:, 1]], len(F))
    volume, area = part_volumes(V, np.where(flip[:, None], F[:, ::-1], F), part)
    closed = np.bincount(part[rim // 3], minlength=count) == 0
    sizes = np.bincount(part)
    turns = np.bincount(part, weights=flip)
    solid = closed & (np.abs(volume) > _NO_INSIDE * area**1.5)
    over = np.where(solid, volume < 0, 2 * turns > sizes)
    flip ^= over[part]
    whole = np.bincount(part, weights=flip, minlength=count) == sizes
    some = int((flip & ~whole[part]).sum())
    notes = []
    if whole.any():
        which = "" if count == 1 else f"{int(whole.sum()):,} of {counted(count, 'part')} "
        notes.append(f"{which}turned inside out (the triangles faced inwards)")
    if some:
        notes.append(f"{counted(some, 'triangle')} reversed (inconsistent winding)")
    return (corners.reversed(flip) if flip.any() else corners), notes


def part_volumes(
    V: NDArray[np.float64], F: NDArray[np.int64], part: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Signed volume of every part [m^3], exact where it is closed, and its area [m^2].

    `part` [triangle_count] is the part of every triangle, numbered from 0.
    """
    count = int(part.max()) + 1
    size = np.bincount(part)
    corners = V[F]
    middle = np.stack([np.bincount(part, weights=x) / size for x in corners.mean(axis=1).T], axis=1)
    a, b, c = np.moveaxis(corners - middle[part][:, None], 1, 0)
    volume = (
        np.bincount(part, weights=np.einsum("ij,ij->i", a, np.cross(b, c)), minlength=count) / 6
    )
    area = (
        np.bincount(part, weights=np.linalg.norm(np.cross(b - a, c - a), axis=1), minlength=count)
        / 2
    )
    return volume, area
