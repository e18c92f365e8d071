"""Compiled loops of a wave step on the CPU: the nine-point stencil's force on a texel, and the step that it drives.

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


class Kick(NamedTuple):
    """v = decay v + gain (force + extra) - spring h + span acceleration; see `StepCoefficients`."""

    rows: Floats32  # of the stencil
    gain: Floats32
    decay: Coefficient
    spring: Coefficient
    span: Coefficient
    extra: Coefficient
    acceleration: Coefficient


class Balance(NamedTuple):
    """What keeps the volume, see `VolumeRate`: factors of texels that lie side by side in runs.

    Where the runs of each part begin, [p + 1], the address of each run, [r], and where its factors begin, [r + 1]; what
    the load asks for and the sum, each [p]; the pressure, a coefficient, and the `part_runs` of its texels.
    """

    begins: Ints
    addresses: Ints
    runs: Ints
    heights: Floats32
    velocities: Floats32
    loaded: Floats32
    total: Floats32
    pressure: Floats32
    part_begins: Ints
    parts: Ints


class Features(NamedTuple):
    """What few materials have, each empty where this one lacks it.

    Stencil of the viscosity; stencil of the Laplacian, rigidity, and a field for the moments of bending; yield height,
    and the field of what stays; what keeps the volume. Lengths tell which are empty, not types: with one of them for
    every set of features, dozens would be compiled.
    """

    viscous: Weights
    laplace: Weights
    rigidity: Floats32
    moment: Floats32
    limit: Floats32
    dent: Floats32
    balance: Balance


_NO_INTS, _NO_FLOATS, _NO_FIELD = np.zeros(0, np.int64), np.zeros(0, np.float32), np.zeros((0, 0, 0), np.float32)
NO_WEIGHTS = Weights(np.zeros((0, 4, 0, 0), np.float32), 0, Links(_NO_INTS, _NO_INTS, _NO_INTS, _NO_INTS, _NO_FLOATS))
NO_BALANCE = Balance(
    *(_NO_INTS, _NO_INTS, _NO_INTS),
    *(_NO_FLOATS, _NO_FLOATS, _NO_FLOATS, _NO_FLOATS),
    _NO_FIELD,
    *(_NO_INTS, _NO_INTS),
)
NO_FEATURES = Features(NO_WEIGHTS, NO_WEIGHTS, _NO_FIELD, _NO_FIELD, _NO_FIELD, _NO_FIELD, NO_BALANCE)


@kernel
def kick_drift(h: Floats32, v: Floats32, h_next: Floats32, kick: Kick, dt: np.float32) -> None:
    """One substep: v = decay v + gain force - spring h + span acceleration, then h_next = h + dt v.

    The small terms are added up first: one rounding at the size of the velocity, which else would gather over many
    substeps. Rows are cut to the texels' columns and one more on either side, so that the compiler sees that no index
    is negative.
    """
    n, columns = h.shape[1] - 2, kick.gain.shape[2]
    for i in range(len(h) * n):
        chart, r = i // n, i % n + 1
        row, velocity, result = h[chart, r, : columns + 2], v[chart, r, : columns + 2], h_next[chart, r, : columns + 2]
        rows = h[chart, r - 1, : columns + 2], row, h[chart, r + 1, : columns + 2]
        links, gain, decay = links_of(kick.rows, chart, r), kick.gain[chart, r - 1], row_of(kick.decay, chart, r - 1)
        spring, span = row_of(kick.spring, chart, r - 1), row_of(kick.span, chart, r - 1)
        extra, acceleration = row_of(kick.extra, chart, r), row_of(kick.acceleration, chart, r - 1)
        for c in range(1, columns + 1):
            held = value_in(span, c - 1) * value_in(acceleration, c - 1) - value_in(spring, c - 1) * row[c]
            pushed = gain[c - 1] * (force_at(rows, links, c) + value_in(extra, c)) + held
            new = value_in(decay, c - 1) * velocity[c] + pushed
            velocity[c] = new
            result[c] = row[c] + dt * new


@kernel
def kick_irregular(h: Floats32, v: Floats32, h_next: Floats32, links: Links, gains: Floats32, dt: np.float32) -> None:
    """The irregular links' part of a substep: the same kick, and the drift by it."""
    gain, heights, velocities, drifted = gains.flat, h.flat, v.flat, h_next.flat
    for i in range(len(links.texels)):
        kicked = gain[links.texels[i]] * irregular_force(links, i, heights)
        velocities[links.addresses[i]] += kicked
        drifted[links.addresses[i]] += dt * kicked


@kernel
def kick_texels(h: Floats32, v: Floats32, addresses: Ints, kicks: Floats32, dt: np.float32) -> None:
    """Kick some texels [k] by velocities [k] [m/s], and drift them by that."""
    heights, velocities = h.flat, v.flat
    for i in range(len(addresses)):
        velocities[addresses[i]] += kicks[i]
        heights[addresses[i]] += dt * kicks[i]


@kernel
def fill(h: Floats32, halo: Ints) -> None:
    """Copy the texels beyond the charts' borders into the halo: addresses of its places and of the texels, [2, k]."""
    flat = h.flat
    for i in range(halo.shape[1]):
        flat[halo[0, i]] = flat[halo[1, i]]


@kernel
def drift(h: Floats32, v: Floats32, response: Coefficient, shift: Coefficient, columns: int, dt: np.float32) -> None:
    """Add the shift to v, as far as texels respond to it, then dt v to h."""
    n = h.shape[1] - 2
    for i in range(len(h) * n):
        chart, r = i // n, i % n + 1
        heights, velocities = h[chart, r], v[chart, r]
        shifts, responses = row_of(shift, chart, r - 1), row_of(response, chart, r - 1)
        for c in range(1, columns + 1):
            velocities[c] += value_in(shifts, c - 1) * value_in(responses, c - 1)
            heights[c] += dt * velocities[c]


@kernel
def flow(h: Floats32, limit: Floats32, dent: Floats32) -> None:
    """Hand the part of the elastic height that is beyond the yield height over to the permanent one."""
    n = h.shape[1] - 2
    for i in range(len(h) * n):
        chart, r = i // n, i % n + 1
        for c in range(1, limit.shape[2] + 1):
            most = limit[chart, r - 1, c - 1]
            kept = min(max(h[chart, r, c], -most), most)
            dent[chart, r, c] += h[chart, r, c] - kept
            h[chart, r, c] = kept


@kernel
def advance(
    substeps: int,
    dt: np.float32,
    h: Floats32,
    v: Floats32,
    h_next: Floats32,
    halo: Ints,
    kick: Kick,
    links: Links,
    addresses: Ints,
    kicks: Floats32,
    viscous: Weights | None,
    features: Features | None,
) -> None:
    """Substeps of dt, from the first half drift to the last; the height ends in `h_next` where their number is odd.

    What is None is compiled away: `features` where a material has no more than viscosity, which then is `viscous`.
    """
    half = dt / np.float32(2)
    for step in range(substeps):
        fill(h, halo)
        if viscous is not None:
            fill(v, halo)
            apply(viscous, v, np.float32(1), False, kick.extra)
        if features is not None:
            _act(h, v, halo, features, kick.extra)
        drifted = dt if step < substeps - 1 else half
        kick_drift(h, v, h_next, kick, drifted)
        kick_irregular(h, v, h_next, links, kick.gain, drifted)
        h, h_next = h_next, h
        kick_texels(h, v, addresses, kicks, drifted)
        if features is not None and len(features.dent):
            flow(h, features.limit, features.dent)


@kernel
def _act(h: Floats32, v: Floats32, halo: Ints, features: Features, extra: Floats32) -> None:
    """What a material's features add to a substep: forces in `extra`, and the pressure that keeps the volume."""
    drags = len(features.viscous.rows) > 0
    if drags:
        fill(v, halo)
        apply(features.viscous, v, np.float32(1), False, extra)
    if len(features.moment):
        apply(features.laplace, h, features.rigidity, False, features.moment)
        fill(features.moment, halo)
        apply(features.laplace, features.moment, np.float32(-1), drags, extra)
    if len(features.balance.loaded):
        _balance(h, v, features.balance)


@kernel(fastmath={"contract", "reassoc"})
def _weighed(factors: Floats32, field: Floats32) -> float:
    """Sum of factor times field over texels side by side."""
    total = 0.0
    for i in range(len(factors)):
        total += np.float64(factors[i] * field[i])
    return total


@kernel
def _balance(h: Floats32, v: Floats32, balance: Balance) -> None:
    """The pressure that keeps the volume of each part, where the density varies."""
    heights, velocities = h.reshape(-1), v.reshape(-1)
    for part in range(len(balance.loaded)):
        total = 0.0
        for run in range(balance.begins[part], balance.begins[part + 1]):
            first, last, address = balance.runs[run], balance.runs[run + 1], balance.addresses[run]
            total += _weighed(balance.heights[first:last], heights[address:])
            if len(balance.velocities):
                total += _weighed(balance.velocities[first:last], velocities[address:])
        balance.total[part] = balance.loaded[part] + np.float32(total)
    texels = balance.pressure.reshape(-1)
    for i in range(len(balance.parts)):
        texels[balance.part_begins[i] : balance.part_begins[i + 1]] = balance.total[balance.parts[i]]
