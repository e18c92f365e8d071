"""What the solver's speed is measured against: a memory copy, a sparse matrix, a plain compute shader."""

from __future__ import annotations

import moderngl
import numpy as np
from scipy.sparse import coo_array, diags_array

from ripple_sim.solver.gl import shared_context
from ripple_sim.solver.texels.cube_map.convention import padded_indices
from ripple_sim.solver.texels.halo import padded_addresses
from ripple_sim.solver.waves.operator import WaveOperator

# What one update must move: 4 link weights, gain, height and velocity in, height and velocity out, 4 bytes each.
BYTES_PER_UPDATE = 36


class Copy:
    """Copies as many bytes as one substep moves: half of them are read, half written."""

    def __init__(self, texels: int) -> None:
        self._from = np.ones(texels * BYTES_PER_UPDATE // 8, np.float32)
        self._to = np.zeros_like(self._from)

    def advance(self, substeps: int, dt: float) -> None:
        """Copy once a substep."""
        for _ in range(substeps):
            np.copyto(self._to, self._from)


class SparseLeapfrog:
    """Leapfrog with scipy's sparse matrix and numpy, in float32."""

    def __init__(self, operator: WaveOperator) -> None:
        n, size = operator.mass.shape[1], operator.mass.size
        index = padded_indices(n)
        low, high = slice(None, -1), slice(1, None)
        ends = (
            (index[:, low, low], index[:, low, high]),
            (index[:, low, low], index[:, high, low]),
            (index[:, low, low], index[:, high, high]),
            (index[:, low, high], index[:, high, low]),
        )
        i, j, weight = [], [], []
        for link, (a, b) in enumerate(ends):
            exists = (a >= 0) & (b >= 0) & (operator.stencil[:, link] != 0)
            # a link across a cube edge stands on both faces: its owner is the face of its lower texel
            exists &= np.minimum(a, b) // (n * n) == np.arange(6)[:, None, None]
            i.append(a[exists])
            j.append(b[exists])
            weight.append(operator.stencil[:, link][exists])
        places = np.concatenate(i), np.concatenate(j)
        links = coo_array((np.concatenate(weight), places), shape=(size, size)).tocsr()
        links = links + links.T
        laplace = links - diags_array(np.asarray(links.sum(axis=1)).ravel())
        self._matrix = (diags_array(1 / operator.mass.ravel()) @ laplace).tocsr().astype(np.float32)
        self.h, self.v = np.zeros(size, np.float32), np.zeros(size, np.float32)

    def advance(self, substeps: int, dt: float) -> None:
        """Take substeps: kick, drift."""
        for _ in range(substeps):
            self.v += np.float32(dt) * (self._matrix @ self.h)
            self.h += np.float32(dt) * self.v


class PlainShader:
    """One thread a texel, a dispatch for the update and one for the faces' borders."""

    def __init__(self, operator: WaveOperator) -> None:
        self._gl = shared_context()
        self._n = n = operator.mass.shape[1]
        _, ring, source = padded_addresses(n)
        with self._gl as ctx:
            self._h, self._h_next, self._v = (ctx.buffer(reserve=4 * 6 * (n + 2) ** 2) for _ in range(3))
            for buffer in (self._h, self._h_next, self._v):
                buffer.clear()
            self._stencil = ctx.buffer(operator.stencil.astype(np.float32).tobytes())
            self._gain = ctx.buffer((1 / operator.mass).astype(np.float32).tobytes())
            self._pairs = ctx.buffer(np.stack([ring, source], axis=1).astype(np.int32).tobytes())
        self._count = len(ring)
        self._update = self._gl.compute_shader("ripple_sim.bench.shaders", "plain_update", N=n)
        self._ring = self._gl.compute_shader("ripple_sim.bench.shaders", "plain_ring")

    def advance(self, substeps: int, dt: float) -> None:
        """Take substeps, and wait for them."""
        with self._gl as ctx:
            self._update["dt"], self._ring["count"] = dt, self._count
            for _ in range(substeps):
                self._h.bind_to_storage_buffer(0)
                self._pairs.bind_to_storage_buffer(1)
                self._ring.run(-(-self._count // 64))
                ctx.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT)
                buffers = (self._h, self._v, self._h_next, self._stencil, self._gain)
                for binding, buffer in enumerate(buffers):
                    buffer.bind_to_storage_buffer(binding)
                self._update.run(-(-self._n // 64), self._n, 6)
                ctx.memory_barrier(moderngl.SHADER_STORAGE_BARRIER_BIT)
                self._h, self._h_next = self._h_next, self._h
            ctx.finish()
