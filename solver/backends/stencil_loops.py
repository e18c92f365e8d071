"""The nine-point stencil in compiled loops: the force on a texel, and a field that the stencil makes of another.

Nothing is contracted or reordered: every loop over texels gives the same numbers, and the two ends of a link see the
same force, so that momentum is kept. Rows are cut out of the fields before the loop over columns: the compiler then
makes better vector code of that loop.

Fields are float32 charts with halo, see `RowLayout`. A coefficient is a number or a field [C, n, columns]; a number
costs no read. Arrays that belong together are one argument.
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

Rows: TypeAlias = tuple[Floats32, ...]


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


def row_of(x, chart, r):
    """Row [chart, r] of a field, or the number x itself."""
    return x[chart, r] if np.ndim(x) else x


@overload(row_of, inline="always")
def _compiled_row_of(x, chart, r):
    if isinstance(x, numba.types.Array):
        return lambda x, chart, r: x[chart, r]
    return lambda x, chart, r: x


def value_in(row, c):
    """Value in column c of a row, or the number itself."""
    return row[c] if np.ndim(row) else row


@overload(value_in, inline="always")
def _compiled_value_in(row, c):
    if isinstance(row, numba.types.Array):
        return lambda row, c: row[c]
    return lambda row, c: row


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
    n, columns = h.shape[1] - 2, stencil.columns
    for i in range(len(h) * n):
        chart, r = i // n, i % n + 1
        rows, links = (h[chart, r - 1], h[chart, r], h[chart, r + 1]), links_of(stencil.rows, chart, r)
        result = out[chart, r]
        for c in range(1, columns + 1):
            force = value_in(row_of(factor, chart, r - 1), c - 1) * force_at(rows, links, c)
            result[c] = result[c] + force if add else force
    irregular, flat, sums = stencil.irregular, h.flat, out.flat
    for i in range(len(irregular.texels)):
        row, column = irregular.texels[i] // columns, irregular.texels[i] % columns
        force = value_in(row_of(factor, row // n, row % n), column) * irregular_force(irregular, i, flat)
        sums[irregular.addresses[i]] += force
