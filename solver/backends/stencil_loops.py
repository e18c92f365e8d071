"""The nine-point stencil in compiled loops: the force on a texel, and a field that the stencil makes of another.

Nothing is contracted or reordered: every loop over texels, whatever its shape, gives the same numbers, and the two ends
of a link see the same force, so that momentum is kept. Rows are cut out of the fields before the loop over columns: the
compiler then makes better vector code of that loop.

Arguments of the compiled loops: arrays that belong together, as one argument each.

Coefficients in compiled loops: a number or a field; a number costs no read.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numba
import numpy as np
from numba.extending import overload

from ..kernel import Floats, Floats32, Ints, kernel

Coefficient: TypeAlias = Floats32 | np.float32

# Of the operator's `response`: a number, or one for each of its parts.
Amplitude: TypeAlias = float | Floats


class State(NamedTuple):
    """Height [m], velocity [m/s], and where the next height goes, each with halo."""

    h: Floats32
    v: Floats32
    h_next: Floats32


class Halo(NamedTuple):
    """Addresses of the halo's places, [k], and of the texels that they show."""

    ghosts: Ints
    sources: Ints


class Links(NamedTuple):
    """The irregular links of a stencil; see `IrregularLinks`. Often none.

    Flat indices of the texels in coefficients, their addresses in a field with halo, where the links of each begin, the
    addresses of their other ends, their weights.
    """

    texels: Ints
    addresses: Ints
    begins: Ints
    others: Ints
    weights: Floats32


class Weights(NamedTuple):
    """A stencil: its rows, [C, 4, n + 1, as wide as a field], the columns of texels, and its irregular links."""

    rows: Floats32
    columns: int
    irregular: Links


class Kick(NamedTuple):
    """v = decay v + gain (force + extra) - spring h + span acceleration; see `StepCoefficients`."""

    stencil: Weights
    gain: Floats32
    decay: Coefficient
    spring: Coefficient
    span: Coefficient
    extra: Coefficient
    acceleration: Coefficient


class Drift(NamedTuple):
    """v += shift as far as texels respond, then h += dt v, in so many columns."""

    columns: int

    response: Coefficient
    shift: Coefficient
    dt: np.float32


class PartRuns(NamedTuple):
    """Texels side by side in coefficients that belong to one part of the surface; see `floating_parts`.

    Where each run begins, [k + 1], and its part, [k].
    """

    begins: Ints
    parts: Ints


class Balance(NamedTuple):
    """What keeps the volume, see `VolumeRate`: factors of texels that lie side by side in runs.

    Where the runs of each part begin, [p + 1], the address of each run, [r], and where its factors begin, [r + 1]; what
    the load asks for and the sum, each [p]; where the sums count.
    """

    begins: Ints
    addresses: Ints
    runs: Ints
    heights: Floats32
    velocities: Floats32
    loaded: Floats32
    total: Floats32
    spread: PartRuns


class Loads(NamedTuple):
    """Addresses of the texels that are kicked in each substep, [k], and by how much [m/s]."""

    addresses: Ints
    kicks: Floats32


class Bending(NamedTuple):
    """Stencil of the Laplacian, rigidity, and a field with halo for the moments."""

    laplace: Weights
    rigidity: Floats32
    moment: Floats32


class Plasticity(NamedTuple):
    """Yield height, and the field with halo of what stays, in so many columns."""

    columns: int

    limit: Coefficient
    dent: Floats32


class Features(NamedTuple):
    """What few materials have, each empty where this one lacks it: viscous stencil, bending, yielding, volume kept.

    Lengths tell which are empty, not types: with one of them for every set of features, dozens would be compiled.
    """

    viscous: Weights
    bending: Bending
    plasticity: Plasticity
    balance: Balance


_NO_INTS, _NO_FLOATS, _NO_FIELD = np.zeros(0, np.int64), np.zeros(0, np.float32), np.zeros((0, 0, 0), np.float32)
_NO_WEIGHTS = Weights(np.zeros((0, 4, 0, 0), np.float32), 0, Links(_NO_INTS, _NO_INTS, _NO_INTS, _NO_INTS, _NO_FLOATS))
NO_FEATURES = Features(
    _NO_WEIGHTS,
    Bending(_NO_WEIGHTS, _NO_FIELD, _NO_FIELD),
    Plasticity(0, _NO_FIELD, _NO_FIELD),
    Balance(
        _NO_INTS,
        _NO_INTS,
        _NO_INTS,
        _NO_FLOATS,
        _NO_FLOATS,
        _NO_FLOATS,
        _NO_FLOATS,
        PartRuns(_NO_INTS, _NO_INTS),
    ),
)


def row_of(x, chart, r):
    """x[chart, r] of a field, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(row_of, inline="always")
def _row_overload(x, chart, r):
    if isinstance(x, numba.types.Array):
        return lambda x, chart, r: x[chart, r]
    return lambda x, chart, r: x


def cut(row, columns):
    """Some columns of a row, a slice, or the number itself."""
    raise NotImplementedError("for compiled code only")


@overload(cut, inline="always")
def _cut_overload(row, columns):
    if isinstance(row, numba.types.Array):
        return lambda row, columns: row[columns]
    return lambda row, columns: row


def value_in(x, c):
    """x[c] of a row, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(value_in, inline="always")
def _in_overload(x, c):
    if isinstance(x, numba.types.Array):
        return lambda x, c: x[c]
    return lambda x, c: x


def value_at(x, i):
    """Value at the texel of flat index i of an array, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(value_at, inline="always")
def _texel_overload(x, i):
    if isinstance(x, numba.types.Array):
        return lambda x, i: x.flat[i]
    return lambda x, i: x


def spread(amplitudes, runs, x):
    """Write the amplitude of each part, [p], to its texels in a field; a number is left alone."""
    raise NotImplementedError("for compiled code only")


@overload(spread)
def _spread_overload(amplitudes, runs, x):
    def to_texels(amplitudes, runs, x):
        flat = x.reshape(-1)
        for i in range(len(runs.parts)):
            flat[runs.begins[i] : runs.begins[i + 1]] = amplitudes[runs.parts[i]]

    return to_texels if isinstance(x, numba.types.Array) else lambda amplitudes, runs, x: None


Rows: TypeAlias = tuple[Floats32, ...]


@kernel(inline="always")
def force_at(rows: Rows, links: Rows, c: int) -> np.float32:
    """Sum over the eight links of weight (h_j - h_i) at column c.

    `rows` are those of the field below, at and above the texel; `links` those of this row's places, and of those below.
    """
    below, row, above = rows
    east, north, south, rising, risen, falling, fallen = links
    x = row[c]
    return (
        (east[c] * (row[c + 1] - x) + east[c - 1] * (row[c - 1] - x))
        + (north[c] * (above[c] - x) + south[c] * (below[c] - x))
        + (rising[c] * (above[c + 1] - x) + risen[c - 1] * (below[c - 1] - x))
        + (falling[c - 1] * (above[c - 1] - x) + fallen[c] * (below[c + 1] - x))
    )


@kernel(inline="always")
def links_of(w: Floats32, chart: int, r: int) -> Rows:
    """Rows of a stencil's links that meet in row r."""
    return (
        w[chart, 0, r],
        w[chart, 1, r],
        w[chart, 1, r - 1],
        w[chart, 2, r],
        w[chart, 2, r - 1],
        w[chart, 3, r],
        w[chart, 3, r - 1],
    )


@kernel
def irregular_force(links: Links, i: int, flat: np.flatiter) -> np.float32:
    """Sum of weight (h_j - h_i) over the irregular links of texel i of the list."""
    here, force = flat[links.addresses[i]], np.float32(0)
    for k in range(links.begins[i], links.begins[i + 1]):
        force += links.weights[k] * (flat[links.others[k]] - here)
    return force


@kernel
def apply(stencil: Weights, h: Floats32, factor: Coefficient, add: bool, out: Floats32) -> None:
    """The stencil on a field times a factor, written into `out` or added to it."""
    n = h.shape[1] - 2
    for i in range(len(h) * n):
        chart, r = i // n, i % n + 1
        rows, links = (h[chart, r - 1], h[chart, r], h[chart, r + 1]), links_of(stencil.rows, chart, r)
        result = out[chart, r]
        for c in range(1, stencil.columns + 1):
            force = value_in(row_of(factor, chart, r - 1), c - 1) * force_at(rows, links, c)
            result[c] = result[c] + force if add else force
    irregular, flat, sums = stencil.irregular, h.flat, out.flat
    for i in range(len(irregular.texels)):
        sums[irregular.addresses[i]] += value_at(factor, irregular.texels[i]) * irregular_force(irregular, i, flat)
