"""Compiled loops over charts with halo, [C, n + 2, n + 2 or more] of float32; coefficients are numbers or [C, n, n]."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from ripple_sim.solver.kernel import Floats32, kernel

from .arguments import (
    Balance,
    Bending,
    Coefficient,
    Halo,
    Kick,
    Links,
    Loads,
    Plasticity,
    Pressure,
    State,
    Weights,
)
from .coefficients import row_of, spread, value_at, value_in


@kernel
def fill(h: Floats32, halo: Halo) -> None:
    """Copy the texels beyond the charts' borders into the halo."""
    flat = h.reshape(-1)
    for i in range(len(halo.ghosts)):
        flat[halo.ghosts[i]] = flat[halo.sources[i]]


@kernel
def kick_texels(h: Floats32, v: Floats32, loads: Loads, dt: np.float32) -> None:
    """Kick some texels, and drift them by that."""
    heights, velocities = h.reshape(-1), v.reshape(-1)
    for i in range(len(loads.addresses)):
        velocities[loads.addresses[i]] += loads.kicks[i]
        heights[loads.addresses[i]] += dt * loads.kicks[i]


@kernel
def drift(h: Floats32, v: Floats32, response: Coefficient, shift: Pressure, dt: np.float32) -> None:
    """Add the shift to v, as far as texels respond to it, then dt v to h."""
    n = h.shape[1] - 2
    for i in range(len(h) * n):
        chart, r = i // n, i % n + 1
        for c in range(1, n + 1):
            v[chart, r, c] += value_in(row_of(shift, chart, r - 1), c - 1) * value_in(
                row_of(response, chart, r - 1), c - 1
            )
            h[chart, r, c] += dt * v[chart, r, c]


@kernel
def flow(h: Floats32, plasticity: Plasticity) -> None:
    """Hand the part of the elastic height that is beyond the yield height over to the permanent one."""
    n = h.shape[1] - 2
    dent = plasticity.dent
    for i in range(len(h) * n):
        chart, r = i // n, i % n + 1
        for c in range(1, n + 1):
            most = value_in(row_of(plasticity.limit, chart, r - 1), c - 1)
            kept = min(max(h[chart, r, c], -most), most)
            dent[chart, r, c] += h[chart, r, c] - kept
            h[chart, r, c] = kept


# Rows are cut out of the fields before the loop over columns: the compiler then makes better vector code of that loop.
# A product and a sum may be contracted to one rounding.
_FAST = {"contract"}

Rows: TypeAlias = tuple[Floats32, ...]


@kernel(inline="always")
def _force(rows: Rows, links: Rows, c: int) -> np.float32:
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
def _links(w: Floats32, chart: int, r: int) -> Rows:
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
def _irregular_force(links: Links, i: int, flat: Floats32) -> np.float32:
    """Sum of weight (h_j - h_i) over the irregular links of texel i of the list."""
    here, force = flat[links.addresses[i]], np.float32(0)
    for k in range(links.begins[i], links.begins[i + 1]):
        force += links.weights[k] * (flat[links.others[k]] - here)
    return force


@kernel(fastmath=_FAST)
def apply(stencil: Weights, h: Floats32, factor: Coefficient, add: bool, out: Floats32) -> None:
    """The stencil on a field times a factor, written into `out` or added to it."""
    n = h.shape[1] - 2
    for i in range(len(h) * n):
        chart, r = i // n, i % n + 1
        rows, links = (h[chart, r - 1], h[chart, r], h[chart, r + 1]), _links(stencil.rows, chart, r)
        result = out[chart, r]
        for c in range(1, n + 1):
            force = value_in(row_of(factor, chart, r - 1), c - 1) * _force(rows, links, c)
            result[c] = result[c] + force if add else force
    irregular, flat, sums = stencil.irregular, h.reshape(-1), out.reshape(-1)
    for i in range(len(irregular.texels)):
        sums[irregular.addresses[i]] += value_at(factor, irregular.texels[i]) * _irregular_force(irregular, i, flat)


@kernel(fastmath=_FAST)
def kick_drift(state: State, kick: Kick, dt: np.float32, first: int, last: int) -> None:
    """One substep of some charts: v = decay v + gain force - spring h + span acceleration, then h_next = h + dt v."""
    h, v, h_next = state
    n = h.shape[1] - 2
    for chart in range(first, last):
        for r in range(1, n + 1):
            row = h[chart, r]
            rows, links = (h[chart, r - 1], row, h[chart, r + 1]), _links(kick.stencil.rows, chart, r)
            velocity, gains, result = v[chart, r], kick.gain[chart, r - 1], h_next[chart, r]
            more, decays, springs, spans, accelerations = (
                row_of(kick.extra, chart, r),
                row_of(kick.decay, chart, r - 1),
                row_of(kick.spring, chart, r - 1),
                row_of(kick.span, chart, r - 1),
                row_of(kick.acceleration, chart, r - 1),
            )
            for c in range(1, n + 1):
                force = _force(rows, links, c)
                kicked = (
                    value_in(decays, c - 1) * velocity[c]
                    + gains[c - 1] * (force + value_in(more, c))
                    - value_in(springs, c - 1) * row[c]
                    + value_in(spans, c - 1) * value_in(accelerations, c - 1)
                )
                velocity[c] = kicked
                result[c] = row[c] + dt * kicked


@kernel
def kick_irregular(state: State, kick: Kick, dt: np.float32) -> None:
    """The irregular links' part of a substep: the same kick, and the drift by it."""
    links, gain = kick.stencil.irregular, kick.gain.reshape(-1)
    heights, velocities, drifted = state.h.reshape(-1), state.v.reshape(-1), state.h_next.reshape(-1)
    for i in range(len(links.texels)):
        kicked = gain[links.texels[i]] * _irregular_force(links, i, heights)
        velocities[links.addresses[i]] += kicked
        drifted[links.addresses[i]] += dt * kicked


@kernel
def advance(
    substeps: int,
    dt: np.float32,
    state: State,
    halo: Halo,
    kick: Kick,
    loads: Loads,
    viscous: Weights | None,
    features: tuple[Bending | None, Plasticity | None, Balance | None],
) -> None:
    """Substeps of dt, from the first half drift to the last; the height ends in `h_next` where their number is odd.

    Features that a material lacks are None, and compiled away.
    """
    bending, plasticity, balance = features
    half = dt / np.float32(2)
    h, v, h_next = state
    for step in range(substeps):
        fill(h, halo)
        _gather_extra(h, v, halo, kick, viscous, bending)
        _balance(h, v, balance, kick.acceleration)
        drifted = dt if step < substeps - 1 else half
        kick_drift(State(h, v, h_next), kick, drifted, 0, len(h))
        kick_irregular(State(h, v, h_next), kick, drifted)
        h, h_next = h_next, h
        kick_texels(h, v, loads, drifted)
        _flow(h, plasticity)


@kernel
def _gather_extra(
    h: Floats32, v: Floats32, halo: Halo, kick: Kick, viscous: Weights | None, bending: Bending | None
) -> None:
    """Forces beside tension and stiffness, into `kick.extra`: viscous, and of bending."""
    if viscous is not None:
        fill(v, halo)
        apply(viscous, v, np.float32(1), False, kick.extra)
    if bending is not None:
        apply(bending.laplace, h, bending.rigidity, False, bending.moment)
        fill(bending.moment, halo)
        apply(bending.laplace, bending.moment, np.float32(-1), viscous is not None, kick.extra)


@kernel(fastmath=_FAST | {"reassoc"})
def _weighed(factors: Floats32, field: Floats32) -> float:
    """Sum of factor times field over texels side by side."""
    total = 0.0
    for i in range(len(factors)):
        total += np.float64(factors[i] * field[i])
    return total


@kernel
def _balance(h: Floats32, v: Floats32, balance: Balance | None, acceleration: Pressure) -> None:
    """The pressure that keeps the volume of each part, where the density varies."""
    if balance is not None:
        heights, velocities = h.reshape(-1), v.reshape(-1)
        for part in range(len(balance.loaded)):
            total = 0.0
            for run in range(balance.begins[part], balance.begins[part + 1]):
                first, last, address = balance.runs[run], balance.runs[run + 1], balance.addresses[run]
                total += _weighed(balance.heights[first:last], heights[address:])
                if len(balance.velocities):
                    total += _weighed(balance.velocities[first:last], velocities[address:])
            balance.total[part] = balance.loaded[part] + np.float32(total)
        spread(balance.total, balance.chart_parts, acceleration)


@kernel
def _flow(h: Floats32, plasticity: Plasticity | None) -> None:
    """`flow` where the material yields."""
    if plasticity is not None:
        flow(h, plasticity)
