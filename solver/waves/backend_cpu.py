"""CPU backend: the leapfrog update as one pass over the texels, compiled by numba.

One thread: a substep takes 0.1 ms at N = 128, less than it costs to wake a second thread, and far less than it costs to
wait for one whose core is busy encoding a frame.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..atlas.padding import padded_addresses
from . import kernels
from .operator import StepCoefficients, WaveOperator, number_or_field, step_coefficients


class CPUBackend:
    """Height and velocity in padded float32 faces; see `waves.Backend`."""

    name = "cpu"

    def __init__(self, operator: WaveOperator) -> None:
        n = operator.mass.shape[1]
        self._operator = operator
        self._inside, self._ring, self._ring_source = padded_addresses(n)
        shape = (6, n + 2, n + 2)
        self._h, self._h_next, self._v = (np.zeros(shape, np.float32) for _ in range(3))
        self._stencil = operator.stencil.astype(np.float32)
        self._viscous = _single(operator.viscous_stencil)
        self._laplace, self._rigidity = _single(operator.laplace_stencil), _single(operator.rigidity)
        self._yield = None if operator.yield_height is None else number_or_field(operator.yield_height)
        self._dent = np.zeros(shape if self._yield is not None else (1, 1, 1), np.float32)
        self._moment = np.zeros(shape if self._laplace is not None else (1, 1, 1), np.float32)
        extra = self._viscous is not None or self._laplace is not None
        self._extra = np.zeros(shape, np.float32) if extra else np.float32(0)
        self._carries = number_or_field(operator.carries)
        self._shift = self._prepared_dt = 0.0
        self.load(np.zeros(0, np.int64), np.zeros(0), 0.0)

    def height(self) -> NDArray[np.float32]:
        """Copy of the height [m], [6, N, N]."""
        elastic = self._h[:, 1:-1, 1:-1]
        return elastic.copy() if self._yield is None else elastic + self.dent()

    def dent(self) -> NDArray[np.float32]:
        """The part of the height that stays [m], [6, N, N]."""
        if self._yield is None:
            return np.zeros(self._operator.mass.shape, np.float32)
        return self._dent[:, 1:-1, 1:-1].copy()

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], [6, N, N]."""
        self._drift(0.0)
        return self._v[:, 1:-1, 1:-1].copy()

    def set_height(self, height: NDArray[np.float32], dent: NDArray[np.float32] | None = None) -> None:
        """Replace the elastic height, and what stays of it: nothing, unless given."""
        self._h[:, 1:-1, 1:-1] = height
        if self._yield is not None:
            self._dent[:, 1:-1, 1:-1] = 0 if dent is None else dent

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity."""
        self._v[:, 1:-1, 1:-1] = velocity
        self._shift = 0.0

    def kick(self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: float) -> None:
        """Add velocities [m/s] to some texels (each named once), and one to all that carry waves.

        The latter is only noted: the next drift, which touches every texel anyway, hands it out.
        """
        self._v.reshape(-1)[self._inside[texels]] += velocities
        self._shift += everywhere

    def load(self, texels: NDArray[np.int64], forces: NDArray[np.float64], everywhere: float) -> None:
        """Hold forces [N] on some texels, and one acceleration [m/s^2] on all that carry waves, until the next call."""
        self._loaded, self._forces, self._acceleration = texels, forces, everywhere
        self._load_is_new = True

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        k = self._prepare(dt)
        self._drift(dt / 2)
        self._flow()
        for step in range(substeps):
            kernels.fill(self._h, self._ring, self._ring_source)
            self._gather_extra_forces()
            drift = np.float32(dt if step < substeps - 1 else dt / 2)
            kernels.kick_drift(
                self._stencil, self._h, self._v, self._h_next, self._extra, k.gain, k.decay, k.spring, self._push, drift
            )
            self._h, self._h_next = self._h_next, self._h
            if len(self._kicks):
                kernels.kick(self._h, self._v, self._kicked, self._kicks, drift)
            self._flow()

    def wait(self) -> None:
        """Return when all steps are done: at once, they are."""

    def finite(self) -> bool:
        """Whether all heights are finite."""
        with np.errstate(over="ignore", invalid="ignore"):
            return bool(np.isfinite(self._h.sum()))

    def _drift(self, dt: float) -> None:
        if dt or self._shift:
            kernels.drift(self._h, self._v, self._carries, np.float32(self._shift), np.float32(dt))
        self._shift = 0.0

    def _flow(self) -> None:
        if self._yield is not None:
            kernels.flow(self._h, self._dent, self._yield)

    def _gather_extra_forces(self) -> None:
        """Forces beside tension and stiffness: viscous, and of bending."""
        if self._viscous is not None:
            kernels.fill(self._v, self._ring, self._ring_source)
            kernels.apply(self._viscous, self._v, np.float32(1), False, self._extra)
        if self._laplace is not None:
            kernels.apply(self._laplace, self._h, self._rigidity, False, self._moment)
            kernels.fill(self._moment, self._ring, self._ring_source)
            kernels.apply(self._laplace, self._moment, np.float32(-1), self._viscous is not None, self._extra)

    def _prepare(self, dt: float) -> StepCoefficients:
        """Coefficients of the kick, computed once a step length, and the load's, once a load as well."""
        new_length = self._prepared_dt != dt
        if new_length:
            self._coefficients = step_coefficients(self._operator, dt)
            self._prepared_dt = dt
        k = self._coefficients
        if new_length or self._load_is_new:
            self._kicked = self._inside[self._loaded]
            self._kicks = k.gain.reshape(-1)[self._loaded] * self._forces.astype(np.float32)
            self._push = np.float32(self._acceleration) * k.span if self._acceleration else np.float32(0)
            self._load_is_new = False
        return k


def _single(field: NDArray[np.float64] | None) -> NDArray[np.float32] | None:
    return None if field is None else field.astype(np.float32)
