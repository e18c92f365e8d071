"""CPU backend: the leapfrog update as one pass over the texels, compiled by numba.

One thread on all but the largest atlases: a substep takes 0.07 ms at N = 128 and 0.3 ms at N = 256, less than a helper
may be kept from its core by the threads that render and encode meanwhile. Whoever waits for it then loses more than two
threads gain.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..atlas.padding import padded_addresses
from . import kernels, threads
from .operator import StepCoefficients, WaveOperator, number_or_field, step_coefficients

# From this resolution on, where a substep takes milliseconds, several threads share out the faces.
_THREADED = 512

# Floats of a page of memory.
_PAGE = 1024


class CPUBackend:
    """Height and velocity in padded float32 faces; see `waves.Backend`.

    Parameters
    ----------
    operator : WaveOperator
    thread_count : int, optional
        How many share out the faces, where the material neither bends, drags nor yields; by default as many as can be
        of use from N = 512 on. The numbers do not depend on it.
    """

    name = "cpu"

    def __init__(self, operator: WaveOperator, thread_count: int | None = None) -> None:
        n = operator.mass.shape[1]
        self._operator = operator
        self._inside, self._ring, self._ring_source = padded_addresses(n)
        self._stencil = operator.stencil.astype(np.float32)
        self._viscous, self._laplace = _single(operator.viscous_stencil), _single(operator.laplace_stencil)
        self._rigidity = _single(operator.rigidity)
        self._yield = None if operator.yield_height is None else number_or_field(operator.yield_height)
        bends, yields = self._laplace is not None, self._yield is not None
        fields = _fields((6, n + 2, n + 2), 6)
        self._h, self._h_next, self._v = fields[:3]
        self._moment = fields[3] if bends else None
        self._extra = fields[4] if bends or self._viscous is not None else np.float32(0)
        self._dent = fields[5] if yields else None
        plain = not (bends or yields or self._viscous is not None)
        if thread_count is None:
            thread_count = threads.available() if n >= _THREADED else 1
        self._threads = thread_count if plain else 1
        self._carries = number_or_field(operator.carries)
        self._shift = self._prepared_dt = 0.0
        self.load(np.zeros(0, np.int64), np.zeros(0), 0.0)

    def height(self) -> NDArray[np.float32]:
        """Copy of the height [m], [6, N, N]."""
        elastic = self._h[:, 1:-1, 1:-1]
        return elastic.copy() if self._dent is None else elastic + self.dent()

    def dent(self) -> NDArray[np.float32]:
        """The part of the height that stays [m], [6, N, N]."""
        if self._dent is None:
            return np.zeros(self._operator.mass.shape, np.float32)
        return self._dent[:, 1:-1, 1:-1].copy()

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], [6, N, N]."""
        self._drift(0.0)
        return self._v[:, 1:-1, 1:-1].copy()

    def set_height(self, height: NDArray[np.float32], dent: NDArray[np.float32] | None = None) -> None:
        """Replace the elastic height, and what stays of it: nothing, unless given."""
        self._h[:, 1:-1, 1:-1] = height
        if self._dent is not None:
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
        fields = (np.float32(dt), self._ring, self._ring_source, self._stencil, self._h, self._v, self._h_next)
        kick = (k.gain, k.decay, k.spring, k.span, np.float32(self._acceleration), self._kicked, self._kicks)
        if self._threads > 1:
            kernels.fill(self._h, self._ring, self._ring_source)
            threads.advance(self._threads, substeps, *fields, *kick)
        else:
            if self._yield is not None:
                kernels.flow(self._h, self._dent, self._yield)
            bending = (self._laplace, self._rigidity, self._moment)
            kernels.advance(substeps, *fields, *kick, self._viscous, *bending, self._extra, self._yield, self._dent)
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
            kernels.drift(self._h, self._v, self._carries, np.float32(self._shift), np.float32(dt))
        self._shift = 0.0

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
            self._load_is_new = False
        return k


def _single(field: NDArray[np.float64] | None) -> NDArray[np.float32] | None:
    return None if field is None else field.astype(np.float32)


def _fields(shape: tuple[int, ...], count: int) -> list[NDArray[np.float32]]:
    """Fields of zeros that begin at different places of a page.

    Processors tell an early store from a later load by the place in the page alone: fields in step cost 3 to 8 %.
    """
    size = int(np.prod(shape))
    stride = -(-size // _PAGE) * _PAGE + _PAGE // 3
    memory = np.zeros(count * stride, np.float32)
    return [memory[i * stride : i * stride + size].reshape(shape) for i in range(count)]
