"""CPU backend: the leapfrog update as one pass over the texels, compiled by numba.

One thread: a substep takes 0.1 ms at N = 128, less than it costs to wake a second thread, and far less than it costs to
wait for one whose core is busy encoding a frame.
"""

from __future__ import annotations

import numba
import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from .operator import WaveOperator, step_coefficients
from .padding import padded_addresses


class CPUBackend:
    """Height and velocity in padded float32 faces; see `waves.Backend`."""

    name = "cpu"

    def __init__(self, operator: WaveOperator) -> None:
        n = operator.mass.shape[1]
        self._operator = operator
        self._stencil = operator.stencil.astype(np.float32)
        viscous = operator.viscous_stencil
        self._viscous_stencil = None if viscous is None else viscous.astype(np.float32)
        self._viscous_force = np.zeros((1, 1, 1), np.float32) if viscous is None else np.zeros((6, n, n), np.float32)
        self._h = np.zeros((6, n + 2, n + 2), np.float32)
        self._h_next = np.zeros_like(self._h)
        self._v = np.zeros_like(self._h)
        self._inside, self._ring, self._ring_source = padded_addresses(n)
        self._coefficients: tuple | None = None
        self._coefficients_dt = 0.0

    def height(self) -> NDArray[np.float32]:
        """Copy of the height [m], [6, N, N]."""
        return self._h[:, 1:-1, 1:-1].copy()

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], [6, N, N]."""
        return self._v[:, 1:-1, 1:-1].copy()

    def set_height(self, height: NDArray[np.float32]) -> None:
        """Replace the height."""
        self._h[:, 1:-1, 1:-1] = height

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity."""
        self._v[:, 1:-1, 1:-1] = velocity

    def kick(self, texels: NDArray[np.int64], velocities: NDArray[np.float64], everywhere: float) -> None:
        """Add velocities [m/s] to some texels (each named once), and one velocity to all."""
        if everywhere:
            self._v += np.float32(everywhere)
        self._v.reshape(-1)[self._inside[texels]] += velocities.astype(np.float32)

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        decay, gain, spring = self._step_coefficients(dt)
        _drift(self._h, self._v, np.float32(dt / 2))
        for step in range(substeps):
            _fill(self._h, self._ring, self._ring_source)
            if self._viscous_stencil is not None:
                _fill(self._v, self._ring, self._ring_source)
                _apply(self._viscous_stencil, self._v, self._viscous_force)
            drift = np.float32(dt if step < substeps - 1 else dt / 2)
            _kick_drift(self._stencil, self._h, self._v, self._h_next, decay, gain, spring, self._viscous_force, drift)
            self._h, self._h_next = self._h_next, self._h

    def _step_coefficients(self, dt: float) -> tuple:
        if self._coefficients is None or self._coefficients_dt != dt:
            self._coefficients, self._coefficients_dt = step_coefficients(self._operator, dt), dt
        return self._coefficients


def _at(x, f, r, c):
    """x[f, r, c] of an array, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(_at, inline="always")
def _at_overload(x, f, r, c):
    if isinstance(x, numba.types.Array):
        return lambda x, f, r, c: x[f, r, c]
    return lambda x, f, r, c: x


@numba.njit(cache=True)
def _fill(h, ring, source):
    """Copy the neighbours' border texels into the ring."""
    flat = h.reshape(-1)
    for i in range(len(ring)):
        flat[ring[i]] = flat[source[i]]


@numba.njit(cache=True, nogil=True)
def _drift(h, v, dt):
    n = h.shape[1] - 2
    for i in range(6 * n):
        f, r = i // n, i % n + 1
        for c in range(1, n + 1):
            h[f, r, c] += dt * v[f, r, c]


@numba.njit(inline="always")
def _force(w, h, f, r, c):
    """Sum over the eight links of weight (h_j - h_i) at padded texel (f, r, c)."""
    x = h[f, r, c]
    return (
        w[f, 0, r, c] * (h[f, r, c + 1] - x)
        + w[f, 0, r, c - 1] * (h[f, r, c - 1] - x)
        + w[f, 1, r, c] * (h[f, r + 1, c] - x)
        + w[f, 1, r - 1, c] * (h[f, r - 1, c] - x)
        + w[f, 2, r, c] * (h[f, r + 1, c + 1] - x)
        + w[f, 2, r - 1, c - 1] * (h[f, r - 1, c - 1] - x)
        + w[f, 3, r - 1, c] * (h[f, r - 1, c + 1] - x)
        + w[f, 3, r, c - 1] * (h[f, r + 1, c - 1] - x)
    )


@numba.njit(cache=True, nogil=True)
def _apply(w, h, out):
    n = h.shape[1] - 2
    for i in range(6 * n):
        f, r = i // n, i % n + 1
        for c in range(1, n + 1):
            out[f, r - 1, c - 1] = _force(w, h, f, r, c)


@numba.njit(cache=True, nogil=True)
def _kick_drift(w, h, v, h_next, decay, gain, spring, extra, dt):
    n = h.shape[1] - 2
    viscous = extra.shape[1] == n
    for i in range(6 * n):
        f, r = i // n, i % n + 1
        for c in range(1, n + 1):
            force = _force(w, h, f, r, c)
            if viscous:
                force += extra[f, r - 1, c - 1]
            kicked = (
                _at(decay, f, r - 1, c - 1) * v[f, r, c]
                + gain[f, r - 1, c - 1] * force
                - _at(spring, f, r - 1, c - 1) * h[f, r, c]
            )
            v[f, r, c] = kicked
            h_next[f, r, c] = h[f, r, c] + dt * kicked
