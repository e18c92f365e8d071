"""The naive compiled loop: the nine-point stencil over charts with halo, as a competent user of numba writes it first.

It has the solver's own weights, and no tuning: no alignment, no slices, nothing fused but the update itself. This is
the rival that counts, since anyone has it in a quarter of an hour.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from ripple_sim.solver.kernel import Floats32, Ints, kernel
from ripple_sim.solver.operator.wave_operator import WaveOperator


class NaiveLoop:
    """Leapfrog in a plain loop, in one thread or, with `parallel`, in numba's threads (`prange` over all rows)."""

    def __init__(self, operator: WaveOperator, parallel: bool = False) -> None:
        n = operator.mass.shape[1]
        self._weights = operator.stencil.weights.astype(np.float32)
        self._gain = (1 / operator.mass).astype(np.float32)
        addresses = operator.topology.addresses
        self._halo, self._source = addresses.ghosts, addresses.sources
        self._h = np.zeros((6, n + 2, n + 2), np.float32)
        self._h_next, self._v = np.zeros_like(self._h), np.zeros((6, n, n), np.float32)
        self._update = _update_parallel if parallel else _update

    def set_height(self, height: Floats32) -> None:
        """Replace the height [m], [C, n, n]."""
        self._h[:, 1:-1, 1:-1] = height

    def state(self) -> tuple[Floats32, Floats32]:
        """Height [m] and velocity [m/s], [C, n, n]."""
        return self._h[:, 1:-1, 1:-1].copy(), self._v.copy()

    def advance(self, substeps: int, dt: float) -> None:
        """Take substeps: kick, drift."""
        for _ in range(substeps):
            _fill_halo(self._h.reshape(-1), self._halo, self._source)
            fields = Fields(self._weights, self._h, self._h_next, self._v, self._gain)
            self._update(fields, np.float32(dt))
            self._h, self._h_next = self._h_next, self._h


@kernel
def _fill_halo(h: Floats32, halo: Ints, source: Ints) -> None:
    for i in range(len(halo)):
        h[halo[i]] = h[source[i]]


class Fields(NamedTuple):
    """Weights [C, 4, n + 1, n + 1], heights with halo [C, n + 2, n + 2], velocity and gain [C, n, n]."""

    w: Floats32
    h: Floats32
    h_next: Floats32
    v: Floats32
    gain: Floats32


@kernel
def _update_row(fields: Fields, dt: np.float32, i: int) -> None:
    w, h, h_next, v, gain = fields
    n = v.shape[1]
    f, r = i // n, i % n + 1
    for c in range(1, n + 1):
        x = h[f, r, c]
        force = w[f, 0, r, c] * (h[f, r, c + 1] - x) + w[f, 0, r, c - 1] * (h[f, r, c - 1] - x)
        force += w[f, 1, r, c] * (h[f, r + 1, c] - x) + w[f, 1, r - 1, c] * (h[f, r - 1, c] - x)
        force += w[f, 2, r, c] * (h[f, r + 1, c + 1] - x) + w[f, 2, r - 1, c - 1] * (h[f, r - 1, c - 1] - x)
        force += w[f, 3, r, c - 1] * (h[f, r + 1, c - 1] - x) + w[f, 3, r - 1, c] * (h[f, r - 1, c + 1] - x)
        v[f, r - 1, c - 1] += dt * gain[f, r - 1, c - 1] * force
        h_next[f, r, c] = x + dt * v[f, r - 1, c - 1]


@kernel
def _update(fields: Fields, dt: np.float32) -> None:
    for i in range(6 * fields.v.shape[1]):
        _update_row(fields, dt, i)


@kernel(parallel=True)
def _update_parallel(fields: Fields, dt: np.float32) -> None:
    for i in numba.prange(6 * fields.v.shape[1]):
        _update_row(fields, dt, i)
