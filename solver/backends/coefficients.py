"""Coefficients in compiled loops: a number or a field; a number costs no read."""

from __future__ import annotations

import numba
from numba.extending import overload


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
