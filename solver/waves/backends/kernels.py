"""Compiled loops over padded faces [6, N + 2, N + 2 or more] of float32; coefficients are one number or [6, N, N]."""

from __future__ import annotations

import numba
import numpy as np
from numba.extending import overload


def _row(x, f, r):
    """x[f, r] of an array, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(_row, inline="always")
def _row_overload(x, f, r):
    if isinstance(x, numba.types.Array):
        return lambda x, f, r: x[f, r]
    return lambda x, f, r: x


def _in(x, c):
    """x[c] of an array, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(_in, inline="always")
def _in_overload(x, c):
    if isinstance(x, numba.types.Array):
        return lambda x, c: x[c]
    return lambda x, c: x


@numba.njit(cache=True, nogil=True)
def fill(h, ring, source):
    """Copy the neighbours' border texels into the ring."""
    flat = h.reshape(-1)
    for i in range(len(ring)):
        flat[ring[i]] = flat[source[i]]


@numba.njit(cache=True, nogil=True)
def kick(h, v, texels, kicks, dt):
    """Kick some texels, and drift them by that."""
    heights, velocities = h.reshape(-1), v.reshape(-1)
    for i in range(len(texels)):
        velocities[texels[i]] += kicks[i]
        heights[texels[i]] += dt * kicks[i]


@numba.njit(cache=True, nogil=True)
def drift(h, v, movable, shift, dt):
    """Add the shift to v where waves are carried, then dt v to h."""
    n = h.shape[1] - 2
    for i in range(6 * n):
        f, r = i // n, i % n + 1
        for c in range(1, n + 1):
            v[f, r, c] += shift * _in(_row(movable, f, r - 1), c - 1)
            h[f, r, c] += dt * v[f, r, c]


@numba.njit(cache=True, nogil=True)
def flow(h, dent, limit):
    """Hand the part of the elastic height that is beyond the yield height over to the permanent one."""
    n = h.shape[1] - 2
    for i in range(6 * n):
        f, r = i // n, i % n + 1
        for c in range(1, n + 1):
            most = _in(_row(limit, f, r - 1), c - 1)
            kept = min(max(h[f, r, c], -most), most)
            dent[f, r, c] += h[f, r, c] - kept
            h[f, r, c] = kept


# Rows are cut out of the fields before the loop over columns: the compiler then makes better vector code of that loop.
# A product and a sum may be contracted to one rounding.
_FAST = {"contract"}


@numba.njit(inline="always")
def _force(below, row, above, east, north, south, rising, risen, falling, fallen, c):
    """Sum over the eight links of weight (h_j - h_i) at column c; the links of this row's cells, and of those below."""
    x = row[c]
    return (
        (east[c] * (row[c + 1] - x) + east[c - 1] * (row[c - 1] - x))
        + (north[c] * (above[c] - x) + south[c] * (below[c] - x))
        + (rising[c] * (above[c + 1] - x) + risen[c - 1] * (below[c - 1] - x))
        + (falling[c - 1] * (above[c - 1] - x) + fallen[c] * (below[c + 1] - x))
    )


@numba.njit(cache=True, nogil=True, fastmath=_FAST)
def apply(w, h, factor, add, out):
    """The stencil on a field times a factor, written into `out` or added to it."""
    n = h.shape[1] - 2
    for i in range(6 * n):
        f, r = i // n, i % n + 1
        below, row, above = h[f, r - 1], h[f, r], h[f, r + 1]
        east, north, south = w[f, 0, r], w[f, 1, r], w[f, 1, r - 1]
        rising, risen, falling, fallen = w[f, 2, r], w[f, 2, r - 1], w[f, 3, r], w[f, 3, r - 1]
        result = out[f, r]
        for c in range(1, n + 1):
            force = _in(_row(factor, f, r - 1), c - 1) * _force(
                below, row, above, east, north, south, rising, risen, falling, fallen, c
            )
            result[c] = result[c] + force if add else force


@numba.njit(cache=True, nogil=True, fastmath=_FAST)
def kick_drift(w, h, v, h_next, extra, gain, decay, spring, span, acceleration, dt, first, last):
    """One substep of some faces: v = decay v + gain force - spring h + span acceleration, then h_next = h + dt v."""
    n = h.shape[1] - 2
    for f in range(first, last):
        for r in range(1, n + 1):
            below, row, above = h[f, r - 1], h[f, r], h[f, r + 1]
            east, north, south = w[f, 0, r], w[f, 1, r], w[f, 1, r - 1]
            rising, risen, falling, fallen = w[f, 2, r], w[f, 2, r - 1], w[f, 3, r], w[f, 3, r - 1]
            velocity, gains, result = v[f, r], gain[f, r - 1], h_next[f, r]
            more, decays, springs, spans = (
                _row(extra, f, r),
                _row(decay, f, r - 1),
                _row(spring, f, r - 1),
                _row(span, f, r - 1),
            )
            for c in range(1, n + 1):
                force = _force(below, row, above, east, north, south, rising, risen, falling, fallen, c)
                kicked = (
                    _in(decays, c - 1) * velocity[c]
                    + gains[c - 1] * (force + _in(more, c))
                    - _in(springs, c - 1) * row[c]
                    + _in(spans, c - 1) * acceleration
                )
                velocity[c] = kicked
                result[c] = row[c] + dt * kicked


@numba.njit(cache=True, nogil=True)
def advance(
    substeps,
    dt,
    ring,
    source,
    w,
    h,
    v,
    h_next,
    gain,
    decay,
    spring,
    span,
    acceleration,
    texels,
    kicks,
    viscous,
    laplace,
    rigidity,
    moment,
    extra,
    limit,
    dent,
):
    """Substeps of dt, from the first half drift to the last; the height ends in `h_next` where their number is odd.

    What a material lacks is None, and compiled away. The interpreter's lock is free all the while.
    """
    half = dt / np.float32(2)
    for step in range(substeps):
        fill(h, ring, source)
        if viscous is not None:
            fill(v, ring, source)
            apply(viscous, v, np.float32(1), False, extra)
        if laplace is not None:
            apply(laplace, h, rigidity, False, moment)
            fill(moment, ring, source)
            apply(laplace, moment, np.float32(-1), viscous is not None, extra)
        drifted = dt if step < substeps - 1 else half
        kick_drift(w, h, v, h_next, extra, gain, decay, spring, span, acceleration, drifted, 0, 6)
        h, h_next = h_next, h
        kick(h, v, texels, kicks, drifted)
        if limit is not None:
            flow(h, dent, limit)
