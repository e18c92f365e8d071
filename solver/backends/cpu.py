"""CPU backend: the leapfrog update as one pass over the texels, compiled by numba.

One thread on all but the largest atlases: a substep takes 0.07 ms at N = 128 and 0.3 ms at N = 256, less than a helper
may be kept from its core by the threads that render and encode meanwhile. Whoever waits for it then loses more than two
threads gain.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.operator.step_coefficients import StepCoefficients, number_or_field, step_coefficients
from ripple_sim.solver.operator.wave_operator import WaveOperator
from ripple_sim.solver.texels.irregular import NO_LINKS
from ripple_sim.solver.texels.stencil import Stencil

from . import kernels, threads

# From this resolution on memory is what takes time, milliseconds a substep: several threads share out the charts, and
# rows lie close together. Below, where caches hold the fields, rows that begin with a cache line are a tenth faster.
_LARGE = 512

# Floats of a cache line, and of a page of memory.
_LINE, _PAGE = 16, 1024


class CPUBackend:
    """Height and velocity in float32 charts with halo; see `backends.Backend`.

    Parameters
    ----------
    operator : WaveOperator
    thread_count : int, optional
        How many share out the charts, where the material neither bends, drags nor yields; by default as many as can be
        of use from N = 512 on. The numbers do not depend on it.
    """

    name = "cpu"

    def __init__(self, operator: WaveOperator, thread_count: int | None = None) -> None:
        self._operator = operator
        self._charts, n, _ = operator.topology.shape
        self._n, self._pitch = n, n + 2 if n >= _LARGE else -(-(n + 2) // _LINE) * _LINE
        addresses = operator.topology.addresses
        self._texel_addresses = self._address(addresses.texels)
        self._halo = kernels.Halo(self._address(addresses.ghosts), self._address(addresses.sources))
        self._stencil = self._weights(operator.stencil)
        self._viscous = None if operator.viscous_stencil is None else self._weights(operator.viscous_stencil)
        # Stores to one field and loads from another at the same place of a page are taken for a conflict: each field
        # begins elsewhere in its page.
        self._h, self._h_next, self._v = (self._zeros(shift * _PAGE // 3 // _LINE * _LINE) for shift in range(3))
        self._bending = self._plasticity = None
        if operator.laplace_stencil is not None and operator.rigidity is not None:
            rigidity = operator.rigidity.astype(np.float32)
            self._bending = kernels.Bending(self._weights(operator.laplace_stencil), rigidity, self._zeros())
        if operator.yield_height is not None:
            self._plasticity = kernels.Plasticity(number_or_field(operator.yield_height), self._zeros())
        drags = self._bending is not None or self._viscous is not None
        self._extra = self._zeros() if drags else np.float32(0)
        if thread_count is None:
            thread_count = threads.available() if n >= _LARGE else 1
        self._threads = 1 if drags or self._plasticity is not None else thread_count
        self._movable = number_or_field(operator.movable)
        self._shift = self._prepared_dt = 0.0
        self.load(np.zeros(0, np.int64), np.zeros(0), 0.0)

    @property
    def thread_count(self) -> int:
        """How many threads share out the charts."""
        return self._threads

    def height(self) -> NDArray[np.float32]:
        """Copy of the height [m], [C, n, n]."""
        elastic = self._texels(self._h)
        return elastic.copy() if self._plasticity is None else elastic + self.dent()

    def dent(self) -> NDArray[np.float32]:
        """The part of the height that stays [m], [C, n, n]."""
        if self._plasticity is None:
            return np.zeros(self._operator.mass.shape, np.float32)
        return self._texels(self._plasticity.dent).copy()

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], [C, n, n]."""
        self._drift(0.0)
        return self._texels(self._v).copy()

    def set_height(self, height: NDArray[np.float32], dent: NDArray[np.float32] | None = None) -> None:
        """Replace the elastic height, and what stays of it: nothing, unless given."""
        self._texels(self._h)[:] = height
        if self._plasticity is not None:
            self._texels(self._plasticity.dent)[:] = 0 if dent is None else dent

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity."""
        self._texels(self._v)[:] = velocity
        self._shift = 0.0

    def kick(self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: float) -> None:
        """Add velocities [m/s] to some texels (each named once), and one to all movable texels.

        The latter is only noted: the next drift, which touches every texel anyway, hands it out.
        """
        self._v.reshape(-1)[self._texel_addresses[texels]] += velocities
        self._shift += everywhere

    def load(self, texels: NDArray[np.int64], forces: NDArray[np.float64], everywhere: float) -> None:
        """Hold forces [N] on some texels, and one acceleration [m/s^2] on all movable texels, until the next call."""
        self._loaded, self._forces, self._acceleration = texels, forces, everywhere
        self._load_is_new = True

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        k = self._prepare(dt)
        self._drift(dt / 2)
        state = kernels.State(self._h, self._v, self._h_next)
        acceleration = np.float32(self._acceleration)
        kick = kernels.Kick(self._stencil, k.gain, k.decay, k.spring, k.span, self._extra, acceleration)
        step = (np.float32(dt), state, self._halo, kick, self._loads)
        if self._threads > 1:
            kernels.fill(self._h, self._halo)
            threads.advance(self._threads, substeps, *step)
        else:
            if self._plasticity is not None:
                kernels.flow(self._h, self._plasticity)
            kernels.advance(substeps, *step, self._viscous, (self._bending, self._plasticity))
        if substeps % 2:
            self._h, self._h_next = self._h_next, self._h

    def wait(self) -> None:
        """Return when all steps are done: at once, they are."""

    def finite(self) -> bool:
        """Whether all heights are finite."""
        with np.errstate(over="ignore", invalid="ignore"):
            return bool(np.isfinite(self._h.sum()))

    def _drift(self, dt: float) -> None:
        if dt or self._shift:
            kernels.drift(self._h, self._v, self._movable, np.float32(self._shift), np.float32(dt))
        self._shift = 0.0

    def _prepare(self, dt: float) -> StepCoefficients:
        """Coefficients of the kick, computed once a step length, and the load's, once a load as well."""
        new_length = self._prepared_dt != dt
        if new_length:
            k = step_coefficients(self._operator, dt)
            gain = _aligned(k.gain.shape, 0)
            gain[:] = k.gain
            self._coefficients = dataclasses.replace(k, gain=gain)
            self._prepared_dt = dt
        k = self._coefficients
        if new_length or self._load_is_new:
            kicks = k.gain.reshape(-1)[self._loaded] * self._forces.astype(np.float32)
            self._loads = kernels.Loads(self._texel_addresses[self._loaded], kicks)
            self._load_is_new = False
        return k

    def _zeros(self, shift: int = 0) -> NDArray[np.float32]:
        """A field with halo [C, n + 2, pitch]; its first texel, or that of every row, begins a cache line."""
        return _aligned((self._charts, self._n + 2, self._pitch), 1, shift)

    def _weights(self, stencil: Stencil) -> kernels.Weights:
        """A stencil laid out like a field, and its irregular links."""
        rows = _aligned((self._charts, 4, self._n + 1, self._pitch), 1)
        rows[..., : self._n + 1] = stencil.weights
        links = stencil.irregular if stencil.irregular is not None else NO_LINKS
        addresses = self._texel_addresses
        return kernels.Weights(
            rows,
            kernels.Links(
                links.texels,
                addresses[links.texels],
                links.begins,
                addresses[links.others],
                links.weights.astype(np.float32),
            ),
        )

    def _texels(self, field: NDArray[np.float32]) -> NDArray[np.float32]:
        return field[:, 1:-1, 1 : self._n + 1]

    def _address(self, address: NDArray[np.int64]) -> NDArray[np.int64]:
        """From an address in [C, n + 2, n + 2] to one in a field here."""
        row, column = np.divmod(address, self._n + 2)
        return row * self._pitch + column


def _aligned(shape: tuple[int, ...], column: int, shift: int = 0) -> NDArray[np.float32]:
    """Zeros of which the given column is so many floats into a page in the first row."""
    size = int(np.prod(shape))
    memory = np.zeros(size + _PAGE, np.float32)
    start = (shift - column - memory.ctypes.data // memory.itemsize) % _PAGE
    return memory[start : start + size].reshape(shape)
