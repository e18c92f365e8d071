"""A plain compute shader: one thread a texel, everything in storage buffers, no tiles and nothing packed."""

from __future__ import annotations

import moderngl
import numpy as np

from ripple_sim.solver.gl import shared_context
from ripple_sim.solver.kernel import Floats32
from ripple_sim.solver.operator.wave_operator import WaveOperator

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
