"""Compiled loops that kick texels and drift them by that: rows, the columns at a chart's sides, lists."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..kernel import Floats32, kernel
from .arguments import Kick, Loads, State
from .coefficients import cut, row_of, value_in
from .stencil_loops import Rows, force_at, irregular_force, links_of


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
