"""Coefficients in compiled loops: a number, or a field [C, n, n]; a number costs no read."""

from __future__ import annotations

import numba
from numba.extending import overload


def row_of(x, chart, r):
    """x[chart, r] of an array, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(row_of, inline="always")
def _row_overload(x, chart, r):
    if isinstance(x, numba.types.Array):
        return lambda x, chart, r: x[chart, r]
    return lambda x, chart, r: x


def value_in(x, c):
    """x[c] of an array, or the number x itself."""
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
        return lambda x, i: x.reshape(-1)[i]
    return lambda x, i: x
