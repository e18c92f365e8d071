"""Coefficients in compiled loops: a number, one for each chart or part, or a field; a number costs no read."""

from __future__ import annotations

import numba
from numba.extending import overload


def row_of(x, chart, r):
    """x[chart, r] of a field, x[chart] of one number a chart, the row of a `ByPart`, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(row_of, inline="always")
def _row_overload(x, chart, r):
    if isinstance(x, numba.types.Array):
        return (lambda x, chart, r: x[chart]) if x.ndim == 1 else (lambda x, chart, r: x[chart, r])
    if isinstance(x, numba.types.BaseTuple):
        return lambda x, chart, r: (x.parts[chart, r], x.values)
    return lambda x, chart, r: x


def cut(row, columns):
    """Some columns of a row, a slice, or the number itself."""
    raise NotImplementedError("for compiled code only")


@overload(cut, inline="always")
def _cut_overload(row, columns):
    if isinstance(row, numba.types.Array):
        return lambda row, columns: row[columns]
    if isinstance(row, numba.types.BaseTuple):
        return lambda row, columns: (row[0][columns], row[1])
    return lambda row, columns: row


def value_in(x, c):
    """x[c] of a row, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(value_in, inline="always")
def _in_overload(x, c):
    if isinstance(x, numba.types.Array):
        return lambda x, c: x[c]
    if isinstance(x, numba.types.BaseTuple):
        return lambda x, c: x[1][x[0][c]]
    return lambda x, c: x


def value_at(x, i):
    """Value at the texel of flat index i of an array, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(value_at, inline="always")
def _texel_overload(x, i):
    if isinstance(x, numba.types.Array):
        return lambda x, i: x.flat[i]
    return lambda x, i: x


def spread(amplitudes, chart_parts, x):
    """Write the amplitude of each part, [p], to one number a chart [C], or to a `ByPart`."""
    raise NotImplementedError("for compiled code only")


@overload(spread)
def _spread_overload(amplitudes, chart_parts, x):
    def to_charts(amplitudes, chart_parts, x):
        for chart in range(len(x)):
            x[chart] = amplitudes[chart_parts[chart]]

    def to_parts(amplitudes, chart_parts, x):
        x.values[:] = amplitudes

    return to_parts if isinstance(x, numba.types.BaseTuple) else to_charts
