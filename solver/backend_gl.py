"""GPU backend: the same leapfrog update as compute shaders, one file a stage in `shaders/`."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from .gl import GLContext, shared_context
from .operator import WaveOperator, step_coefficients
from .padding import padded_addresses

_GROUP = 64


class GLBackend:
    """Height and velocity in padded float32 storage buffers; see `waves.Backend`."""

    name = "gl"

    def __init__(self, operator: WaveOperator, gl: GLContext | None = None) -> None:
        self._gl = gl if gl is not None else shared_context()
        self._operator = operator
        self._n = n = operator.mass.shape[1]
        self._inside, ring, source = padded_addresses(n)
        padded = np.zeros((6, n + 2, n + 2), np.float32)
        with self._gl as ctx:
            self._h, self._h_next, self._v = (ctx.buffer(padded.tobytes()) for _ in range(3))
            self._stencil = ctx.buffer(operator.stencil.astype(np.float32).tobytes())
            self._ring_pairs = ctx.buffer(np.stack([ring, source], axis=1).astype(np.int32).tobytes())
            self._ring_count = len(ring)
            self._drift = self._shader("drift")
            self._ring = self._gl.compute_shader("ripple_sim.solver", "ring")
            self._impulse = self._gl.compute_shader("ripple_sim.solver", "impulse")
            self._shift = self._shader("shift")
            if operator.viscous_stencil is not None:
                self._viscous = self._shader("viscous")
                self._viscous_stencil = ctx.buffer(operator.viscous_stencil.astype(np.float32).tobytes())
                self._viscous_force = ctx.buffer(reserve=4 * 6 * n * n)
        self._kick_drift: moderngl.ComputeShader | None = None
        self._fields: list[tuple[moderngl.Buffer, int]] = []
        self._coefficients_dt = 0.0

    def height(self) -> NDArray[np.float32]:
        """Copy of the height [m], [6, N, N]."""
        return self._read(self._h)

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], [6, N, N]."""
        return self._read(self._v)

    def set_height(self, height: NDArray[np.float32]) -> None:
        """Replace the height."""
        self._write(self._h, height)

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity."""
        self._write(self._v, velocity)

    def kick(self, texels: NDArray[np.int64], velocities: NDArray[np.float64], everywhere: float) -> None:
        """Add velocities [m/s] to some texels (each named once), and one velocity to all."""
        with self._gl as ctx:
            self._v.bind_to_storage_buffer(0)
            if everywhere:
                self._shift["shift"] = everywhere
                self._run_texels(self._shift)
            if len(texels):
                places = ctx.buffer(self._inside[texels].astype(np.int32).tobytes())
                kicks = ctx.buffer(velocities.astype(np.float32).tobytes())
                places.bind_to_storage_buffer(1)
                kicks.bind_to_storage_buffer(2)
                self._impulse["count"] = len(texels)
                self._run_list(self._impulse, len(texels))
                places.release()
                kicks.release()

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        with self._gl:
            self._prepare(dt)
            assert self._kick_drift is not None
            self._h.bind_to_storage_buffer(0)
            self._v.bind_to_storage_buffer(1)
            self._drift["dt"] = dt / 2
            self._run_texels(self._drift)
            for step in range(substeps):
                self._fill_ring(self._h)
                if self._operator.viscous_stencil is not None:
                    self._fill_ring(self._v)
                    self._v.bind_to_storage_buffer(0)
                    self._viscous_stencil.bind_to_storage_buffer(1)
                    self._viscous_force.bind_to_storage_buffer(2)
                    self._run_texels(self._viscous)
                for binding, buffer in enumerate((self._h, self._v, self._h_next, self._stencil)):
                    buffer.bind_to_storage_buffer(binding)
                for buffer, binding in self._fields:
                    buffer.bind_to_storage_buffer(binding)
                self._kick_drift["dt"] = dt if step < substeps - 1 else dt / 2
                self._run_texels(self._kick_drift)
                self._h, self._h_next = self._h_next, self._h

    def _prepare(self, dt: float) -> None:
        """Compile the kick for this material and upload its coefficients, once a step length."""
        if self._coefficients_dt == dt:
            return
        decay, gain, spring = step_coefficients(self._operator, dt)
        for buffer, binding in self._fields:
            if binding != 7:
                buffer.release()
        defines = {}
        fields: list[tuple[NDArray, int]] = [(gain, 4)]
        for name, value, binding in (("decay", decay, 5), ("spring", spring, 6)):
            if np.ndim(value):
                defines[f"{name.upper()}_FIELD"] = 1
                fields.append((np.asarray(value), binding))
        with self._gl as ctx:
            self._fields = [(ctx.buffer(value.tobytes()), binding) for value, binding in fields]
            if self._operator.viscous_stencil is not None:
                defines["VISCOUS"] = 1
                self._fields.append((self._viscous_force, 7))
            if self._kick_drift is None:
                self._kick_drift = self._shader("kick_drift", **defines)
            for name, value in (("decay", decay), ("spring", spring)):
                if not np.ndim(value):
                    self._kick_drift[name] = float(value)
        self._coefficients_dt = dt

    def _shader(self, name: str, **defines: int) -> moderngl.ComputeShader:
        return self._gl.compute_shader("ripple_sim.solver", name, N=self._n, **defines)

    def _fill_ring(self, field: moderngl.Buffer) -> None:
        field.bind_to_storage_buffer(0)
        self._ring_pairs.bind_to_storage_buffer(1)
        self._ring["count"] = self._ring_count
        self._run_list(self._ring, self._ring_count)

    def _run_texels(self, shader: moderngl.ComputeShader) -> None:
        shader.run(-(-self._n // _GROUP), self._n, 6)
        self._barrier()

    def _run_list(self, shader: moderngl.ComputeShader, count: int) -> None:
        shader.run(-(-count // _GROUP))
        self._barrier()

    def _barrier(self) -> None:
        with self._gl as ctx:
            ctx.memory_barrier()

    def _read(self, buffer: moderngl.Buffer) -> NDArray[np.float32]:
        with self._gl:
            padded = np.frombuffer(buffer.read(), np.float32).reshape(6, self._n + 2, self._n + 2)
        return padded[:, 1:-1, 1:-1].copy()

    def _write(self, buffer: moderngl.Buffer, field: NDArray[np.float32]) -> None:
        padded = np.zeros((6, self._n + 2, self._n + 2), np.float32)
        padded[:, 1:-1, 1:-1] = field
        with self._gl:
            buffer.write(padded.tobytes())
