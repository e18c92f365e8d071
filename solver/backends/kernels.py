"""Compiled loops over charts with halo, [C, n + 2, n + 2 or more] of float32; coefficients are numbers or [C, n, n]."""

from __future__ import annotations

import numpy as np

from ripple_sim.solver.kernel import Floats32, kernel

from .arguments import (
    Balance,
    Coefficient,
    Drift,
    Features,
    Halo,
    Kick,
    Loads,
    Plasticity,
    State,
    Weights,
)
from .coefficients import row_of, spread, value_in
from .kicks import kick_drift, kick_irregular, kick_texels
from .stencil_loops import apply


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
