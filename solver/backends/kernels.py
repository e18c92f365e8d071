"""Compiled loops over charts with halo, [C, n + 2, n + 2 or more] of float32; coefficients are numbers or [C, n, n].

Compiled loops that kick texels and drift them by that: rows, the columns at a chart's sides, lists.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..kernel import Floats32, kernel
from .stencil_loops import (
    Balance,
    Coefficient,
    Drift,
    Features,
    Halo,
    Kick,
    Loads,
    Plasticity,
    Rows,
    State,
    Weights,
    apply,
    cut,
    force_at,
    irregular_force,
    links_of,
    row_of,
    spread,
    value_in,
)


@kernel(inline="always")
def kicked(rows: Rows, links: Rows, velocity: Floats32, factors: tuple[Any, ...], c: int) -> np.float32:
    """Velocity at column c after a kick.

    `factors` are rows, or numbers: gain, extra, decay, spring, span, acceleration. The small terms are added up first:
    one rounding at the size of the velocity, which else would gather over many substeps.
    """
    gain, extra, decay, spring, span, acceleration = factors
    held = value_in(span, c - 1) * value_in(acceleration, c - 1) - value_in(spring, c - 1) * rows[1][c]
    return value_in(decay, c - 1) * velocity[c] + (gain[c - 1] * (force_at(rows, links, c) + value_in(extra, c)) + held)


@kernel(inline="always")
def kick_drift_row(state: State, kick: Kick, dt: np.float32, chart: int, r: int, first: int, last: int) -> None:
    """`kick_drift` of columns first to last of one row, both counted from 1.

    Rows are cut to these columns and one more on either side, so that the compiler sees that no index is negative.
    """
    h, v, h_next = state
    wide, narrow, w = slice(first - 1, last + 2), slice(first - 1, last), kick.stencil.rows[chart]
    row = h[chart, r, wide]
    rows = h[chart, r - 1, wide], row, h[chart, r + 1, wide]
    links = (
        w[0, r, wide],
        w[1, r, wide],
        w[1, r - 1, wide],
        w[2, r, wide],
        w[2, r - 1, wide],
        w[3, r, wide],
        w[3, r - 1, wide],
    )
    velocity, result = v[chart, r, wide], h_next[chart, r, wide]
    factors = (
        kick.gain[chart, r - 1, narrow],
        cut(row_of(kick.extra, chart, r), wide),
        cut(row_of(kick.decay, chart, r - 1), narrow),
        cut(row_of(kick.spring, chart, r - 1), narrow),
        cut(row_of(kick.span, chart, r - 1), narrow),
        cut(row_of(kick.acceleration, chart, r - 1), narrow),
    )
    for c in range(1, last - first + 2):
        new = kicked(rows, links, velocity, factors, c)
        velocity[c] = new
        result[c] = row[c] + dt * new


@kernel
def kick_drift_sides(state: State, kick: Kick, dt: np.float32, chart: int, width: int) -> None:
    """`kick_drift` of the first and the last columns of a chart, so many each, but for as many rows at either end."""
    h, v, h_next = state
    n = h.shape[1] - 2
    for r in range(width + 1, n - width + 1):
        row = h[chart, r]
        rows, links = (h[chart, r - 1], row, h[chart, r + 1]), links_of(kick.stencil.rows, chart, r)
        velocity, result = v[chart, r], h_next[chart, r]
        factors = (
            kick.gain[chart, r - 1],
            row_of(kick.extra, chart, r),
            row_of(kick.decay, chart, r - 1),
            row_of(kick.spring, chart, r - 1),
            row_of(kick.span, chart, r - 1),
            row_of(kick.acceleration, chart, r - 1),
        )
        for i in range(2 * width):
            c = i + 1 if i < width else n - 2 * width + i + 1
            new = kicked(rows, links, velocity, factors, c)
            velocity[c] = new
            result[c] = row[c] + dt * new


@kernel
def kick_drift(state: State, kick: Kick, dt: np.float32, first: int, last: int) -> None:
    """One substep of some charts: v = decay v + gain force - spring h + span acceleration, then h_next = h + dt v."""
    for chart in range(first, last):
        for r in range(1, state.h.shape[1] - 1):
            kick_drift_row(state, kick, dt, chart, r, 1, kick.stencil.columns)


@kernel
def kick_irregular(state: State, kick: Kick, dt: np.float32) -> None:
    """The irregular links' part of a substep: the same kick, and the drift by it."""
    links, gain = kick.stencil.irregular, kick.gain.flat
    heights, velocities, drifted = state.h.flat, state.v.flat, state.h_next.flat
    for i in range(len(links.texels)):
        kicked = gain[links.texels[i]] * irregular_force(links, i, heights)
        velocities[links.addresses[i]] += kicked
        drifted[links.addresses[i]] += dt * kicked


@kernel
def kick_texels(h: Floats32, v: Floats32, loads: Loads, dt: np.float32) -> None:
    """Kick some texels, and drift them by that."""
    heights, velocities = h.flat, v.flat
    for i in range(len(loads.addresses)):
        velocities[loads.addresses[i]] += loads.kicks[i]
        heights[loads.addresses[i]] += dt * loads.kicks[i]


@kernel
def fill(h: Floats32, halo: Halo) -> None:
    """Copy the texels beyond the charts' borders into the halo."""
    flat = h.flat
    for i in range(len(halo.ghosts)):
        flat[halo.ghosts[i]] = flat[halo.sources[i]]


@kernel(inline="always")
def drift_row(h: Floats32, v: Floats32, drift: Drift, chart: int, r: int) -> None:
    """Add the shift to v, as far as texels respond to it, then dt v to h, in one row."""
    heights, velocities = h[chart, r], v[chart, r]
    shift, response = row_of(drift.shift, chart, r - 1), row_of(drift.response, chart, r - 1)
    for c in range(1, drift.columns + 1):
        velocities[c] += value_in(shift, c - 1) * value_in(response, c - 1)
        heights[c] += drift.dt * velocities[c]


@kernel
def drift(h: Floats32, v: Floats32, drift: Drift) -> None:
    """`drift_row` of all rows."""
    n = h.shape[1] - 2
    for i in range(len(h) * n):
        drift_row(h, v, drift, i // n, i % n + 1)


@kernel
def raise_crests(h: Floats32, crests: Floats32) -> None:
    """Raise the crests to the size of the height, of any shape, halo and all; to what is no number as well."""
    heights, tops = h.reshape(-1), crests.reshape(-1)
    for i in range(len(tops)):
        size = abs(heights[i])
        tops[i] = tops[i] if size <= tops[i] else size


@kernel
def flow(h: Floats32, plasticity: Plasticity) -> None:
    """Hand the part of the elastic height that is beyond the yield height over to the permanent one."""
    n = h.shape[1] - 2
    dent = plasticity.dent
    for i in range(len(h) * n):
        chart, r = i // n, i % n + 1
        for c in range(1, plasticity.columns + 1):
            most = value_in(row_of(plasticity.limit, chart, r - 1), c - 1)
            kept = min(max(h[chart, r, c], -most), most)
            dent[chart, r, c] += h[chart, r, c] - kept
            h[chart, r, c] = kept


@kernel
def advance(
    substeps: int,
    dt: np.float32,
    state: State,
    halo: Halo,
    kick: Kick,
    loads: Loads,
    viscous: Weights | None,
    features: Features | None,
) -> None:
    """Substeps of dt, from the first half drift to the last; the height ends in `h_next` where their number is odd.

    What is None is compiled away: `features` where a material has no more than viscosity, which then is `viscous`.
    """
    half = dt / np.float32(2)
    h, v, h_next = state
    for step in range(substeps):
        fill(h, halo)
        _drag(v, halo, viscous, kick.extra)
        _act(h, v, halo, kick, features)
        drifted = dt if step < substeps - 1 else half
        kick_drift(State(h, v, h_next), kick, drifted, 0, len(h))
        kick_irregular(State(h, v, h_next), kick, drifted)
        h, h_next = h_next, h
        kick_texels(h, v, loads, drifted)
        _flow(h, features)


@kernel
def _drag(v: Floats32, halo: Halo, viscous: Weights | None, out: Coefficient) -> None:
    """Viscous forces."""
    if viscous is not None:
        fill(v, halo)
        apply(viscous, v, np.float32(1), False, out)


@kernel
def _act(h: Floats32, v: Floats32, halo: Halo, kick: Kick, features: Features | None) -> None:
    """What a material's features add to a substep: forces in `kick.extra`, the pressure in `kick.acceleration`."""
    if features is not None:
        bending, drags = features.bending, len(features.viscous.rows) > 0
        if drags:
            _drag(v, halo, features.viscous, kick.extra)
        if len(bending.moment):
            apply(bending.laplace, h, bending.rigidity, False, bending.moment)
            fill(bending.moment, halo)
            apply(bending.laplace, bending.moment, np.float32(-1), drags, kick.extra)
        if len(features.balance.loaded):
            _balance(h, v, features.balance, kick.acceleration)


@kernel(fastmath={"contract", "reassoc"})
def _weighed(factors: Floats32, field: Floats32) -> float:
    """Sum of factor times field over texels side by side."""
    total = 0.0
    for i in range(len(factors)):
        total += np.float64(factors[i] * field[i])
    return total


@kernel
def _balance(h: Floats32, v: Floats32, balance: Balance, acceleration: Coefficient) -> None:
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
    spread(balance.total, balance.spread, acceleration)


@kernel
def _flow(h: Floats32, features: Features | None) -> None:
    """`flow` where the material yields."""
    if features is not None and len(features.plasticity.dent):
        flow(h, features.plasticity)
