"""The symmetric nine-point stencil of a texel mesh, and the links beyond it round irregular vertices.

A stencil's weights are [C, 4, n + 1, n + 1]: those of the links of place (r, c) of a chart with
halo to the east (r, c)-(r, c + 1), north (r, c)-(r + 1, c), north-east (r, c)-(r + 1, c + 1), and
its other diagonal (r, c + 1)-(r + 1, c). A link that crosses a glued side is stored on both charts,
with the same value to the last bit. Links to places beyond a fixed rim, where heights are 0, tie
the last texels down; a free rim has none.

A stencil has a largest eigenvalue, which sets the time step, and can be had as a sparse matrix.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh_tridiagonal
from scipy.sparse import csr_array

from ..kernel import Bools, Floats, Ints
from .topology import TexelTopology

# Row and column of the two ends of every link from the place where it is stored, and the slices of
# a field with halo that hold them.
_ENDS = (((0, 0), (0, 1)), ((0, 0), (1, 0)), ((0, 0), (1, 1)), ((0, 1), (1, 0)))
_EVERY = slice(None)
_PARTS = (slice(None, -1), slice(1, None))
LINK_ENDS = [[(_EVERY, _PARTS[row], _PARTS[column]) for row, column in ends] for ends in _ENDS]

# Largest eigenvalue of an even grid's stencil times its spacing squared: that of the chessboard
# pattern.
EVEN_RATE = 6.4

# On smaller charts Gershgorin's bound is as good.
_LANCZOS_FROM = 6

# Residual of the eigenvalue, as a share of it; Lanczos steps from one look at it to the next, and
# at most.
_RESIDUAL = 2e-3
_LOOK = 5
_MOST = 1000


class IrregularLinks(NamedTuple):
    """Links by the texels in which they end; every link is stored for both of its ends.

    Attributes
    ----------
    texels : int64 [k]
        Flat indices, ascending, each once.
    begins : int64 [k + 1]
        The links of texel i are those from begins[i] to begins[i + 1].
    others : int64 [m]
        The texel at the other end.
    weights : float64 [m]
    """

    texels: Ints
    begins: Ints
    others: Ints
    weights: Floats

    @classmethod
    def of(cls, ends: Ints, weights: Floats) -> IrregularLinks:
        """Sort links [k, 2] with weights [k]."""
        both = np.concatenate([ends, ends[:, ::-1]])
        twice = np.tile(weights, 2)
        order = np.lexsort((both[:, 1], both[:, 0]))
        texels, begins = np.unique(both[order, 0], return_index=True)
        return cls(texels, np.append(begins, len(both)), both[order, 1], twice[order])

    @classmethod
    def joined(cls, first: IrregularLinks, second: IrregularLinks) -> IrregularLinks:
        """Those of both."""
        if not len(second.texels):
            return first
        ends = np.concatenate(
            [np.repeat(each.texels, np.diff(each.begins)) for each in (first, second)]
        )
        order = np.argsort(ends, kind="stable")
        texels, begins = np.unique(ends[order], return_index=True)
        others, weights = (
            np.concatenate(each)[order] for each in zip(first[2:], second[2:], strict=True)
        )
        return cls(texels, np.append(begins, len(ends)), others, weights)


NO_LINKS = IrregularLinks(
    np.zeros(0, np.int64), np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros(0)
)


def link_lengths(topology: TexelTopology, halo_positions: Floats) -> Floats:
    """Real-space length of every link [m], [C, 4, n + 1, n + 1]; infinite where no link exists."""
    lengths = np.stack(
        [np.linalg.norm(halo_positions[a] - halo_positions[b], axis=-1) for a, b in LINK_ENDS],
        axis=1,
    )
    lengths.reshape(-1)[missing_links(topology)] = np.inf
    crossing_links(topology).level(lengths)
    return lengths


def link_exists(topology: TexelTopology, link: int) -> Bools:
    """Where a link joins two texels of which one is the chart's own, [C, n + 1, n + 1]."""
    a, b = LINK_ENDS[link]
    there = (topology.halo >= 0) & ~topology.rim
    return there[a] & there[b] & (topology.own[a] | topology.own[b])


@functools.lru_cache(maxsize=4)  # asked for in every step, where a surface moves
def rim_ties(topology: TexelTopology) -> tuple[Ints, Ints]:
    """Flat texels [k] that links tie to a fixed rim, and the flat places [k] of these among a stencil's weights."""
    own = topology.own
    rim = topology.rim & topology.fixed_rim
    tied = np.stack([(own[a] & rim[b]) | (rim[a] & own[b]) for a, b in LINK_ENDS], axis=1)
    texels = np.stack(
        [np.where(own[a], topology.halo[a], topology.halo[b]) for a, b in LINK_ENDS], axis=1
    )
    return texels[tied], np.flatnonzero(tied)


class CrossingLinks(NamedTuple):
    """The links across glued sides; each is stored on two charts.

    Attributes
    ----------
    keys : int64 [k]
        Of the two texels that each joins, ascending: the lesser one times the number of texels,
        plus the other.
    copies : int64 [m]
        Flat places of the copies among a stencil's weights, those of each link together.
    begins : int64 [k + 1]
        Where the copies of each link begin.
    size : int
        Number of texels.
    """

    keys: Ints
    copies: Ints
    begins: Ints
    size: int

    def between(self, pairs: Ints) -> tuple[Ints, Ints]:
        """Copies of the links between pairs of texels [m, 2]: the pair, and the flat place; some pairs have none."""
        wanted = pairs.min(axis=1) * self.size + pairs.max(axis=1)
        link = np.searchsorted(self.keys, wanted)
        pair = np.flatnonzero(np.append(self.keys, -1)[link] == wanted)
        first = self.begins[link[pair]]
        count = np.diff(self.begins)[link[pair]]
        nth = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        return np.repeat(pair, count), self.copies[np.repeat(first, count) + nth]

    def level(self, weights: Floats) -> None:
        """Give all copies of each link their mean, in a stencil's weights."""
        counts = np.diff(self.begins)
        flat = weights.reshape(-1)
        link = np.repeat(np.arange(len(counts)), counts)
        flat[self.copies] = (np.bincount(link, flat[self.copies], len(counts)) / counts)[link]


@functools.lru_cache(maxsize=4)
def crossing_links(topology: TexelTopology) -> CrossingLinks:
    """The links across glued sides of a topology."""
    own = topology.own
    size = topology.texel_count
    each = [
        link_exists(topology, link) & (own[a] != own[b]) for link, (a, b) in enumerate(LINK_ENDS)
    ]
    crossing = np.stack(each, axis=1)
    chart, link, row, column = np.nonzero(crossing)
    down, right = np.array(_ENDS)[link].T
    first, second = topology.halo[chart, row + down, column + right]
    key = np.minimum(first, second) * size + np.maximum(first, second)
    order = np.argsort(key, kind="stable")
    unique, begins = np.unique(key[order], return_index=True)
    return CrossingLinks(unique, np.flatnonzero(crossing)[order], np.append(begins, len(key)), size)


@functools.lru_cache(maxsize=4)
def missing_links(topology: TexelTopology) -> Ints:
    """Flat places, among a stencil's weights, of what is no link."""
    missing = ~np.stack([link_exists(topology, link) for link in range(4)], axis=1)
    missing.reshape(-1)[rim_ties(topology)[1]] = False
    return np.flatnonzero(missing)


def largest_eigenvalue(
    force: Callable[[Floats], Floats],
    mass: Floats,
    free: Bools,
    bound: float,
    *,
    loose: bool = False,
) -> float:
    """Upper bound, within about 0.5 %, of the largest eigenvalue of -M^-1 force, by Lanczos iteration.

    Plain Lanczos, without a basis that is kept orthogonal: lost orthogonality repeats eigenvalues
    and makes no new ones (Paige 1972), and the sums are numpy's own, since BLAS' threads wait for
    each other where others use the cores.

    Parameters
    ----------
    force : callable
        Linear, from a field [C, n, n] to one.
    mass : float64 [C, n, n]
    free : bool [C, n, n]
        The other texels do not move.
    bound : float
        One that is always safe, such as Gershgorin's, caps the estimate, and stands where none is
        found.
    loose : bool
        Whether the bound is far too high even on small charts, as that of a sum of squares.
    """
    if not free.any():
        return 0.0
    if bound == 0 or (mass.shape[1] < _LANCZOS_FROM and not loose):
        return bound
    weight = free / np.sqrt(mass)
    start = np.random.default_rng(0).standard_normal(mass.size)
    before = np.zeros_like(start)
    vector = start / np.sqrt((start * start).sum())
    diagonal: list[float] = []
    side: list[float] = []
    for step in range(1, _MOST + 1):
        pull = -(force(vector.reshape(weight.shape) * weight) * weight).ravel()
        rest = pull - (side[-1] if side else 0.0) * before
        diagonal.append(float((vector * rest).sum()))
        rest -= diagonal[-1] * vector
        length = float(np.sqrt((rest * rest).sum()))
        if step % _LOOK == 0 or length == 0.0:
            top, vectors = eigh_tridiagonal(
                diagonal, side, select="i", select_range=(step - 1, step - 1)
            )
            if length * abs(vectors[-1, 0]) <= _RESIDUAL * abs(top[0]):
                return float(np.clip(1.005 * top[0], 0, bound))
        side.append(length)
        before = vector
        vector = rest / length
    return float(bound)


@dataclasses.dataclass(eq=False)
class Stencil:
    """Link weights w of a symmetric operator: the sum over links of w (h_j - h_i) is its value at texel i.

    Attributes
    ----------
    topology : TexelTopology
    weights : float64 [C, 4, n + 1, n + 1]
        Of the nine-point stencil, see the module.
    irregular : IrregularLinks
        The links beyond the nine points.
    """

    topology: TexelTopology
    weights: Floats
    irregular: IrregularLinks = NO_LINKS

    def __call__(self, field: Floats) -> Floats:
        """Sum over the links of w (h_j - h_i) at every texel of a field, float64 [C, n, n]."""
        around = self.topology.with_halo(field)
        result = np.zeros(self.topology.shape)
        if self.topology.fixed_rim:
            around[self.topology.rim] = 0
        for link, start, end in self._links():
            result += self.weights[:, link][start] * (around[end] - field)
        links = self.irregular
        h = field.reshape(-1)
        row = np.repeat(np.arange(len(links.texels)), np.diff(links.begins))
        forces = links.weights * (h[links.others] - h[links.texels[row]])
        result.reshape(-1)[links.texels] += np.bincount(row, forces)
        return result

    def absolute_sums(self) -> Floats:
        """Sum of |w| over the links that meet in each texel, half of |w| for those to a fixed rim, [C, n, n].

        Twice that is Gershgorin's bound: the other end of a link to a rim does not move.
        """
        sums = np.zeros(self.topology.shape)
        for link, start, _ in self._links():
            sums += np.abs(self.weights[:, link][start])
        if self.topology.fixed_rim:
            texels, ties = rim_ties(self.topology)
            np.subtract.at(sums.reshape(-1), texels, np.abs(self.weights.reshape(-1)[ties]) / 2)
        links = self.irregular
        sums.reshape(-1)[links.texels] += np.add.reduceat(np.abs(links.weights), links.begins[:-1])
        return sums

    def fastest(self, mass: Floats) -> float:
        """Gershgorin's bound of the largest eigenvalue over a lumped mass [C, n, n]."""
        return float((self.absolute_sums() * 2 / mass).max())

    def _links(self) -> Iterator[tuple[int, tuple[slice, ...], tuple[slice, ...]]]:
        """Of the eight links of every texel, the direction, the places where it starts, and its other ends."""
        n = self.topology.shape[1]
        for link, ends in enumerate(_ENDS):
            for (r, c), (row, column) in (ends, ends[::-1]):
                places = ((1 - r, 1 - c), (1 - r + row, 1 - c + column))
                start, end = ((_EVERY, slice(i, n + i), slice(j, n + j)) for i, j in places)
                yield link, start, end


def stiffness_matrix(stencil: Stencil) -> csr_array:
    """A stencil as a matrix [T, T] whose product with a field is minus the stencil's value."""
    topology = stencil.topology
    found = []
    for link, (a, b) in enumerate(LINK_ENDS):
        for end, other in ((a, b), (b, a)):
            own = link_exists(topology, link) & topology.own[end]
            found.append(
                (topology.halo[end][own], topology.halo[other][own], stencil.weights[:, link][own])
            )
    links = stencil.irregular
    found.append((np.repeat(links.texels, np.diff(links.begins)), links.others, links.weights))
    row, column, weight = (np.concatenate(each) for each in zip(*found, strict=True))
    size = topology.texel_count
    diagonal = np.bincount(row, weight, size)
    if topology.fixed_rim:
        tied, ties = rim_ties(topology)
        diagonal += np.bincount(tied, stencil.weights.reshape(-1)[ties], size)
    texels = np.arange(size)
    places = np.concatenate([row, texels]), np.concatenate([column, texels])
    return csr_array((np.concatenate([-weight, diagonal]), places), shape=(size, size))
