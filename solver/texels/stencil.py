"""The symmetric nine-point stencil of a texel mesh, and the irregular links beyond it.

Irregular links lie round irregular vertices, where other than four charts meet.

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

# Row and column of the two ends of every link, counted from the place where the link is stored.
_ENDS = (((0, 0), (0, 1)), ((0, 0), (1, 0)), ((0, 0), (1, 1)), ((0, 1), (1, 0)))

# Slices of rows or columns with halo, at all places where a link is stored: the end of a link
# there, and the end one further on.
_ALL = slice(None)
_HERE = slice(None, -1)
_NEXT = slice(1, None)

# Both ends of each of the four links, as indices of a field [C, n + 2, n + 2].
LINK_ENDS = [
    [(_ALL, _HERE, _HERE), (_ALL, _HERE, _NEXT)],
    [(_ALL, _HERE, _HERE), (_ALL, _NEXT, _HERE)],
    [(_ALL, _HERE, _HERE), (_ALL, _NEXT, _NEXT)],
    [(_ALL, _HERE, _NEXT), (_ALL, _NEXT, _HERE)],
]

# Largest eigenvalue of the stencil of an even grid, times the spacing squared: the chessboard
# pattern has it.
EVEN_RATE = 6.4

# Texels along a chart's side, at least, for which Lanczos iteration is better than Gershgorin's
# bound.
_MIN_LANCZOS_TEXELS = 6

# Residual of the largest eigenvalue at which the iteration ends, as a share of the eigenvalue.
_MAX_RESIDUAL = 2e-3

# Factor by which the estimate is raised, so that it is an upper bound.
_UPPER_BOUND_FACTOR = 1.005

# Lanczos steps between two looks at the eigenvalue.
_STEPS_BETWEEN_LOOKS = 5

# Lanczos steps, at most; then Gershgorin's bound stands.
_MAX_LANCZOS_STEPS = 1000


class IrregularLinks(NamedTuple):
    """Links by the texels where they end; every link is stored for both ends.

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

    @property
    def starts(self) -> Ints:
        """The texel from which each link starts, [m]."""
        return np.repeat(self.texels, np.diff(self.begins))

    @classmethod
    def of(cls, ends: Ints, weights: Floats) -> IrregularLinks:
        """Sort links [k, 2] with weights [k]."""
        both_ways = np.concatenate([ends, ends[:, ::-1]])
        order = np.lexsort((both_ways[:, 1], both_ways[:, 0]))
        texels, begins = np.unique(both_ways[order, 0], return_index=True)
        return cls(
            texels=texels,
            begins=np.append(begins, len(both_ways)),
            others=both_ways[order, 1],
            weights=np.tile(weights, 2)[order],
        )

    @classmethod
    def joined(cls, first: IrregularLinks, second: IrregularLinks) -> IrregularLinks:
        """The links of both."""
        if not len(second.texels):
            return first
        ends = np.concatenate([first.starts, second.starts])
        order = np.argsort(ends, kind="stable")
        texels, begins = np.unique(ends[order], return_index=True)
        others = np.concatenate([first.others, second.others])[order]
        weights = np.concatenate([first.weights, second.weights])[order]
        return cls(texels, np.append(begins, len(ends)), others, weights)


NO_LINKS = IrregularLinks(
    np.zeros(0, np.int64), np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros(0)
)


def link_lengths(topology: TexelTopology, halo_positions: Floats) -> Floats:
    """Real-space length of every link [m], [C, 4, n + 1, n + 1]; infinite where no link exists."""
    ways = [halo_positions[a] - halo_positions[b] for a, b in LINK_ENDS]
    lengths = np.stack([np.linalg.norm(way, axis=-1) for way in ways], axis=1)
    lengths.reshape(-1)[missing_links(topology)] = np.inf
    crossing_links(topology).level(lengths)
    return lengths


def link_exists(topology: TexelTopology, link: int) -> Bools:
    """Links between two texels that include a texel of the chart, [C, n + 1, n + 1]."""
    a, b = LINK_ENDS[link]
    has_texel = (topology.halo >= 0) & ~topology.rim
    return has_texel[a] & has_texel[b] & (topology.own[a] | topology.own[b])


@functools.lru_cache(maxsize=4)  # asked for in every step, where a surface moves
def rim_ties(topology: TexelTopology) -> tuple[Ints, Ints]:
    """Texels that links tie to a fixed rim, and the places of these links among the weights.

    Both are flat, [k].
    """
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
        Key of each link, ascending: the lesser one of its two texels times the number of texels,
        plus the other one.
    copies : int64 [m]
        Flat places of the copies among a stencil's weights, link by link.
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
        """Copies of the links between pairs of texels [m, 2]: the pair, and the flat place of each.

        A pair without a link across a side has no copies.
        """
        keys = pairs.min(axis=1) * self.size + pairs.max(axis=1)
        link = np.searchsorted(self.keys, keys)
        pair = np.flatnonzero(np.append(self.keys, -1)[link] == keys)
        first = self.begins[link[pair]]
        count = np.diff(self.begins)[link[pair]]
        nth = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        return np.repeat(pair, count), self.copies[np.repeat(first, count) + nth]

    def level(self, weights: Floats) -> None:
        """Give all copies of each link their mean, in a stencil's weights."""
        counts = np.diff(self.begins)
        flat = weights.reshape(-1)
        link = np.repeat(np.arange(len(counts)), counts)
        means = np.bincount(link, flat[self.copies], len(counts)) / counts
        flat[self.copies] = means[link]


@functools.lru_cache(maxsize=4)
def crossing_links(topology: TexelTopology) -> CrossingLinks:
    """The links across glued sides of a topology."""
    own = topology.own
    size = topology.texel_count
    crosses = [own[a] != own[b] for a, b in LINK_ENDS]
    crossing = np.stack([link_exists(topology, k) & crosses[k] for k in range(4)], axis=1)
    chart, link, row, column = np.nonzero(crossing)
    down, right = np.array(_ENDS)[link].T
    first, second = topology.halo[chart, row + down, column + right]
    key = np.minimum(first, second) * size + np.maximum(first, second)
    order = np.argsort(key, kind="stable")
    unique, begins = np.unique(key[order], return_index=True)
    return CrossingLinks(unique, np.flatnonzero(crossing)[order], np.append(begins, len(key)), size)


@functools.lru_cache(maxsize=4)
def missing_links(topology: TexelTopology) -> Ints:
    """Flat places, among a stencil's weights, that hold no link."""
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
    """Upper bound, within about 0.5 %, of the largest eigenvalue of -M^-1 force.

    Plain Lanczos iteration finds it, without keeping the basis orthogonal: lost orthogonality
    repeats eigenvalues and makes no new ones (Paige 1972). Sums are NumPy's own: the threads of
    BLAS wait for each other where other processes use the cores.

    Parameters
    ----------
    force : callable
        Linear, from a field [C, n, n] to a field.
    mass : float64 [C, n, n]
    free : bool [C, n, n]
        Texels that move.
    bound : float
        A safe upper bound, such as Gershgorin's. It caps the estimate, and stands where the
        iteration finds none.
    loose : bool
        Whether the bound is far too high even on small charts, as it is for a sum of squares.
    """
    if not free.any():
        return 0.0
    if bound == 0 or (mass.shape[1] < _MIN_LANCZOS_TEXELS and not loose):
        return bound
    weight = free / np.sqrt(mass)
    start = np.random.default_rng(0).standard_normal(mass.size)
    previous = np.zeros_like(start)
    vector = start / np.sqrt((start * start).sum())
    # the tridiagonal matrix of the force in the basis of the vectors
    diagonal: list[float] = []
    off_diagonal: list[float] = []
    for step in range(1, _MAX_LANCZOS_STEPS + 1):
        image = -(force(vector.reshape(weight.shape) * weight) * weight).ravel()
        new = image - (off_diagonal[-1] if off_diagonal else 0.0) * previous
        diagonal.append(float((vector * new).sum()))
        new -= diagonal[-1] * vector
        length = float(np.sqrt((new * new).sum()))
        if step % _STEPS_BETWEEN_LOOKS == 0 or length == 0.0:
            top, vectors = eigh_tridiagonal(
                diagonal, off_diagonal, select="i", select_range=(step - 1, step - 1)
            )
            residual = length * abs(vectors[-1, 0])
            if residual <= _MAX_RESIDUAL * abs(top[0]):
                return float(np.clip(_UPPER_BOUND_FACTOR * top[0], 0, bound))
        off_diagonal.append(length)
        previous = vector
        vector = new / length
    return float(bound)


@dataclasses.dataclass(eq=False)
class Stencil:
    """Link weights w of a symmetric operator.

    The value of the operator at texel i is the sum of w (h_j - h_i) over the links of the texel.

    Attributes
    ----------
    topology : TexelTopology
    weights : float64 [C, 4, n + 1, n + 1]
        Weights of the nine-point stencil, see the module.
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
        """Sum of |w| over the links that meet in each texel, [C, n, n].

        Links to a fixed rim count half. Twice the sum is Gershgorin's bound: the other end of a
        link to a rim does not move.
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
        """The eight links of every texel: number, places where they are stored, and other ends.

        The number is the link's among the four of a place; the places are among those of the
        weights, the other ends among those of a field with halo.
        """
        n = self.topology.shape[1]
        for link, ends in enumerate(_ENDS):
            for (r, c), (row, column) in (ends, ends[::-1]):
                first_row = 1 - r
                first_column = 1 - c
                stored = (
                    _ALL,
                    slice(first_row, n + first_row),
                    slice(first_column, n + first_column),
                )
                end_row = first_row + row
                end_column = first_column + column
                end = (_ALL, slice(end_row, n + end_row), slice(end_column, n + end_column))
                yield link, stored, end


def stiffness_matrix(stencil: Stencil) -> csr_array:
    """A stencil as a matrix [T, T] whose product with a field is minus the stencil's value."""
    topology = stencil.topology
    rows = []
    columns = []
    weights = []
    for link, (a, b) in enumerate(LINK_ENDS):
        for end, other in ((a, b), (b, a)):
            own = link_exists(topology, link) & topology.own[end]
            rows.append(topology.halo[end][own])
            columns.append(topology.halo[other][own])
            weights.append(stencil.weights[:, link][own])
    row = np.concatenate([*rows, stencil.irregular.starts])
    column = np.concatenate([*columns, stencil.irregular.others])
    weight = np.concatenate([*weights, stencil.irregular.weights])
    size = topology.texel_count
    diagonal = np.bincount(row, weight, size)
    if topology.fixed_rim:
        tied, ties = rim_ties(topology)
        diagonal += np.bincount(tied, stencil.weights.reshape(-1)[ties], size)
    texels = np.arange(size)
    places = np.concatenate([row, texels]), np.concatenate([column, texels])
    return csr_array((np.concatenate([-weight, diagonal]), places), shape=(size, size))
