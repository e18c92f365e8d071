"""The naive compiled loop: the nine-point stencil over charts with halo, as a competent user of numba writes it first.

It has the solver's own weights, and no tuning: no alignment, no slices, nothing fused but the update itself. This is
the rival that counts, since anyone has it in a quarter of an hour.

The memory bound: a loop that reads and writes as many bytes as one substep, and computes next to nothing.

A plain compute shader: one thread a texel, everything in storage buffers, no tiles and nothing packed.

SciPy's sparse matrix and NumPy: waves as one would write them in an afternoon. SciPy multiplies in one thread.
"""

from __future__ import annotations

import functools
import itertools
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import moderngl
import numba
import numpy as np
from scipy.sparse import diags_array

from ripple_sim.solver.gl import shared_context
from ripple_sim.solver.kernel import Floats32, Ints, kernel
from ripple_sim.solver.operator.wave_operator import WaveOperator
from ripple_sim.solver.texels.stencil import stiffness_matrix

# Streams of float32 that one substep reads at every texel: 4 link weights, gain, height and velocity; and those that
# it writes: velocity and the next height.
READS, WRITES = 7, 2

# Floats of a page of memory. A store and a load at the same place of a page are taken for a conflict: each stream
# begins elsewhere in its page, as in the solver.
_PAGE = 1024

# The compiler makes vector code of short slices, as the solver's kernel has them.
_SLICE = 1024


class Streams(NamedTuple):
    """Arrays of one float32 a texel, [texels]; only the last two are written, and all but the last are read."""

    east: Floats32
    north: Floats32
    northeast: Floats32
    northwest: Floats32
    gain: Floats32
    height: Floats32
    velocity: Floats32
    next_height: Floats32


class MemoryStream:
    """Streams the bytes of a substep through memory, each thread its own share; no thread waits for another."""

    def __init__(self, texels: int, threads: int = 1) -> None:
        count = len(Streams._fields)
        pitch = -(-texels // _PAGE) * _PAGE + _PAGE // count
        # filled, since untouched pages are all one page, which a cache holds
        memory = np.full((count, pitch), 1e-3, np.float32)
        self.streams = Streams(*memory[:, :texels])
        bounds = np.linspace(0, texels, threads + 1).astype(np.int64)
        self._shares = list(itertools.pairwise(bounds))
        self._pool = ThreadPoolExecutor(threads)

    def advance(self, substeps: int, dt: float) -> None:
        """Read and write every stream once a substep; this thread takes the first share itself."""
        passes = functools.partial(_stream, self.streams, substeps, np.float32(dt))
        helpers = [self._pool.submit(passes, *share) for share in self._shares[1:]]
        passes(*self._shares[0])
        for helper in helpers:
            helper.result()


@kernel
def _stream(s: Streams, substeps: int, dt: np.float32, first: int, last: int) -> None:
    """Kick and drift the texels from `first` to `last` by the sum of their weights."""
    for _ in range(substeps):
        for start in range(first, last, _SLICE):
            stop = min(start + _SLICE, last)
            east, north = s.east[start:stop], s.north[start:stop]
            northeast, northwest = s.northeast[start:stop], s.northwest[start:stop]
            gain, height = s.gain[start:stop], s.height[start:stop]
            velocity, next_height = s.velocity[start:stop], s.next_height[start:stop]
            for i in range(stop - start):
                kicked = velocity[i] + dt * gain[i] * (east[i] + north[i] + northeast[i] + northwest[i])
                velocity[i] = kicked
                next_height[i] = height[i] + dt * kicked


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


_GROUP = 64


class PlainShader:
    """Leapfrog with a dispatch for the charts' halos and one for the update, each substep."""

    def __init__(self, operator: WaveOperator) -> None:
        self._gl = shared_context()
        self._n = n = operator.mass.shape[1]
        addresses = operator.topology.addresses
        with self._gl as ctx:
            self._h, self._h_next, self._v = (ctx.buffer(reserve=4 * 6 * (n + 2) ** 2) for _ in range(3))
            for buffer in (self._h, self._h_next, self._v):
                buffer.clear()
            self._stencil = ctx.buffer(operator.stencil.weights.astype(np.float32).tobytes())
            self._gain = ctx.buffer((1 / operator.mass).astype(np.float32).tobytes())
            self._pairs = ctx.buffer(np.stack([addresses.ghosts, addresses.sources], axis=1).astype(np.int32).tobytes())
        self._count = len(addresses.ghosts)
        self._update = self._gl.compute_shader("ripple_sim.bench.shaders", "plain_update", N=n)
        self._halo = self._gl.compute_shader("ripple_sim.solver.backends.shaders", "halo", LIST_GROUP=_GROUP)

    def set_height(self, height: Floats32) -> None:
        """Replace the height [m], [C, n, n]."""
        with_halo = np.pad(height.astype(np.float32), ((0, 0), (1, 1), (1, 1)))
        with self._gl:
            self._h.write(with_halo.tobytes())

    def state(self) -> tuple[Floats32, Floats32]:
        """Height [m] and velocity [m/s], [C, n, n]."""
        shape = (6, self._n + 2, self._n + 2)
        with self._gl:
            h, v = (np.frombuffer(each.read(), np.float32).reshape(shape) for each in (self._h, self._v))
        return h[:, 1:-1, 1:-1].copy(), v[:, 1:-1, 1:-1].copy()

    def advance(self, substeps: int, dt: float) -> None:
        """Take substeps, and wait for them."""
        with self._gl as ctx:
            self._update["dt"], self._halo["count"] = dt, self._count
            for _ in range(substeps):
                self._h.bind_to_storage_buffer(0)
                self._pairs.bind_to_storage_buffer(1)
                self._halo.run(-(-self._count // _GROUP))
                ctx.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT)
                buffers = (self._h, self._v, self._h_next, self._stencil, self._gain)
                for binding, buffer in enumerate(buffers):
                    buffer.bind_to_storage_buffer(binding)
                self._update.run(-(-self._n // _GROUP), self._n, 6)
                ctx.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT)
                self._h, self._h_next = self._h_next, self._h
            ctx.finish()


class SparseLeapfrog:
    """Leapfrog with a matrix in CSR, in float32."""

    def __init__(self, operator: WaveOperator) -> None:
        self._shape = operator.mass.shape
        self._matrix = (
            (diags_array(-1 / operator.mass.ravel()) @ stiffness_matrix(operator.stencil)).tocsr().astype(np.float32)
        )
        self._h, self._v = np.zeros((2, operator.mass.size), np.float32)

    def set_height(self, height: Floats32) -> None:
        """Replace the height [m], [C, n, n]."""
        self._h[:] = height.ravel()

    def state(self) -> tuple[Floats32, Floats32]:
        """Height [m] and velocity [m/s], [C, n, n]."""
        return self._h.reshape(self._shape).copy(), self._v.reshape(self._shape).copy()

    def advance(self, substeps: int, dt: float) -> None:
        """Take substeps: kick, drift."""
        for _ in range(substeps):
            self._v += np.float32(dt) * (self._matrix @ self._h)
            self._h += np.float32(dt) * self._v
