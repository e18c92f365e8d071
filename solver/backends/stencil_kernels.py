"""Compiled loops that apply a nine-point stencil to a field, and fill the halo of a field.

Rows are cut out of the fields before the loop over columns: the compiler then makes better vector
code of that loop. Each of several threads applies a stencil to its own rows, see `Share`.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numba
import numpy as np
from numba.extending import overload

from ..kernel import Floats32, Ints, kernel
from .meeting import Crew, share

Coefficient: TypeAlias = Floats32 | np.float32

NO_INTS = np.zeros(0, np.int64)
NO_FLOATS = np.zeros(0, np.float32)


class Links(NamedTuple):
    """The irregular links of a stencil; see `IrregularLinks`. Often there are none."""

    texels: Ints  # flat index of each texel in a coefficient, [k]
    addresses: Ints  # address of each texel in a field with halo, [k]
    begins: Ints  # where the links of each texel begin, [k + 1]
    others: Ints  # address of each link's other end, [links]
    weights: Floats32  # weight of each link, [links]
    ends: Floats32  # room for the field at the other end of each link, [links]


class Weights(NamedTuple):
    """The weights of a stencil."""

    rows: Floats32  # [C, 4, n + 1, pitch]: as wide as a field
    columns: int  # columns of texels
    irregular: Links


def row_of(x, first, count):
    """Values from `first` on of a flat field, or the number x itself."""
    return x[first : first + count] if np.ndim(x) else x


@overload(row_of)
def _compiled_row_of(x, first, count):
    if isinstance(x, numba.types.Array):
        return lambda x, first, count: x[first : first + count]
    return lambda x, first, count: x


def value_in(row, c):
    """Value in column c of a row, or the number itself."""
    return row[c] if np.ndim(row) else row


@overload(value_in)
def _compiled_value_in(row, c):
    if isinstance(row, numba.types.Array):
        return lambda row, c: row[c]
    return lambda row, c: row


@kernel(no_cpython_wrapper=True)
def force_at(
    below: Floats32,
    row: Floats32,
    above: Floats32,
    east: Floats32,
    north: Floats32,
    south: Floats32,
    rising: Floats32,
    risen: Floats32,
    falling: Floats32,
    fallen: Floats32,
    c: int,
) -> np.float32:
    """Sum over the eight links of weight (h_j - h_i) at column c.

    `below`, `row` and `above` are rows of the field. `east`, `north`, `rising` and `falling` are
    weights of the links that start in the texel's row; `south`, `risen` and `fallen` are weights of
    the links that start in the row below. They are separate arguments, since tuples take longer to
    compile.
    """
    x = row[c]
    return (
        (east[c] * (row[c + 1] - x) + east[c - 1] * (row[c - 1] - x))
        + (north[c] * (above[c] - x) + south[c] * (below[c] - x))
        + (rising[c] * (above[c + 1] - x) + risen[c - 1] * (below[c - 1] - x))
        + (falling[c - 1] * (above[c - 1] - x) + fallen[c] * (below[c + 1] - x))
    )


class Share(NamedTuple):
    """One thread's share of a step."""

    first_row: int  # of all charts' rows
    last_row: int  # the row after the last
    first_address: int  # in a field with halo
    last_address: int  # the address after the last


@kernel(no_cpython_wrapper=True)
def look_along(links: Links, h: Floats32, own: Share) -> None:
    """Copy the field at the other ends of the links of the thread's own texels."""
    for i in range(len(links.texels)):
        if own.first_address <= links.addresses[i] < own.last_address:
            for k in range(links.begins[i], links.begins[i + 1]):
                links.ends[k] = h[links.others[k]]


@kernel(fastmath={"contract", "reassoc"}, no_cpython_wrapper=True)
def irregular_force(links: Links, i: int, here: np.float32) -> np.float32:
    """Sum of weight (h_j - h_i) over the irregular links of texel i of the list.

    `look_along` comes before. The order of the sum is the compiler's, as a plate has dozens of
    links to a texel.
    """
    first = links.begins[i]
    last = links.begins[i + 1]
    ends = links.ends[first:last]
    weights = links.weights[first:last]
    force = np.float32(0)
    for k in range(len(ends)):
        force += weights[k] * (ends[k] - here)
    return force


@kernel(no_cpython_wrapper=True)
def share_of(stencil: Weights, size: int, crew: Crew) -> Share:
    """The rows of a thread, and its addresses in fields of `size` numbers.

    The thread's addresses end where the first row of the next thread begins.
    """
    n = stencil.rows.shape[2] - 1
    pitch = stencil.rows.shape[3]
    row_count = len(stencil.rows) * n
    first_row, last_row = share(row_count, crew)
    first_address = 0
    last_address = size
    if first_row > 0:
        first_address = (first_row // n * (n + 2) + first_row % n + 1) * pitch
    if last_row < row_count:
        last_address = (last_row // n * (n + 2) + last_row % n + 1) * pitch
    return Share(first_row, last_row, first_address, last_address)


@kernel(no_cpython_wrapper=True)
def apply(
    stencil: Weights, h: Floats32, factor: Coefficient, add: bool, out: Floats32, own: Share
) -> None:
    """Apply the stencil to a field, times a factor; write the result into `out`, or add it.

    Only at the thread's own texels.
    """
    w = stencil.rows
    columns = stencil.columns
    n = w.shape[2] - 1
    pitch = w.shape[3]
    for i in range(own.first_row, own.last_row):
        chart = i // n
        r = i % n + 1
        at = (chart * (n + 2) + r) * pitch
        below = h[at - pitch : at]
        row = h[at : at + pitch]
        above = h[at + pitch : at + 2 * pitch]
        east = w[chart, 0, r]
        north = w[chart, 1, r]
        south = w[chart, 1, r - 1]
        rising = w[chart, 2, r]
        risen = w[chart, 2, r - 1]
        falling = w[chart, 3, r]
        fallen = w[chart, 3, r - 1]
        factors = row_of(factor, i * columns, columns)
        result = out[at : at + pitch]
        for c in range(1, columns + 1):
            force = force_at(
                below, row, above, east, north, south, rising, risen, falling, fallen, c
            )
            force *= value_in(factors, c - 1)
            result[c] = result[c] + force if add else force
    irregular = stencil.irregular
    look_along(irregular, h, own)
    for i in range(len(irregular.texels)):
        address = irregular.addresses[i]
        if own.first_address <= address < own.last_address:
            force = irregular_force(irregular, i, h[address])
            out[address] += value_in(factor, irregular.texels[i]) * force


_NO_LINKS = Links(
    texels=NO_INTS,
    addresses=NO_INTS,
    begins=NO_INTS,
    others=NO_INTS,
    weights=NO_FLOATS,
    ends=NO_FLOATS,
)
NO_WEIGHTS = Weights(rows=np.zeros((0, 4, 0, 0), np.float32), columns=0, irregular=_NO_LINKS)


@kernel(no_cpython_wrapper=True)
def fill(h: Floats32, halo: Ints, crew: Crew) -> None:
    """Copy the texels beyond the charts' borders into the halo: this thread's share of it.

    `halo` [2, k] has the addresses of the halo's places, and of the texels that they show.
    """
    first, last = share(halo.shape[1], crew)
    for i in range(first, last):
        h[halo[0, i]] = h[halo[1, i]]
