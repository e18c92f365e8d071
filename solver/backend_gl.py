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
        self._viscous = self._laplace = self._dent = self._extra = None
        with self._gl as ctx:
            self._h, self._h_next, self._v = (self._padded() for _ in range(3))
            self._stencil = self._upload(operator.stencil)
            self._ring_pairs = ctx.buffer(np.stack([ring, source], axis=1).astype(np.int32).tobytes())
            self._ring_count = len(ring)
            self._carries = self._upload(operator.carries)
            self._kicks, self._forces = _TexelList(self._gl), _TexelList(self._gl)
            if operator.viscous_stencil is not None:
                self._viscous = self._upload(operator.viscous_stencil)
            if operator.laplace_stencil is not None and operator.rigidity is not None:
                self._laplace, self._rigidity = self._upload(operator.laplace_stencil), self._upload(operator.rigidity)
                self._moment = self._padded()
            if self._viscous or self._laplace:
                self._extra = self._padded()
            if operator.yield_height is not None:
                self._dent, self._yield = self._padded(), self._upload(operator.yield_height)
        self._compile()
        self._coefficients: moderngl.Buffer | None = None
        self._shift = 0.0
        self._waiting: list[tuple[NDArray[np.int64], NDArray[np.float32]]] = []
        self.load(np.zeros(0, np.int64), np.zeros(0), 0.0)

    def height(self) -> NDArray[np.float32]:
        """Copy of the height [m], [6, N, N]."""
        return self._read(self._h) if self._dent is None else self._read(self._h) + self.dent()

    def dent(self) -> NDArray[np.float32]:
        """The part of the height that stays [m], [6, N, N]."""
        return np.zeros(self._operator.mass.shape, np.float32) if self._dent is None else self._read(self._dent)

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], [6, N, N]."""
        with self._gl:
            self._start(0.0)
        return self._read(self._v)

    def set_height(self, height: NDArray[np.float32], dent: NDArray[np.float32] | None = None) -> None:
        """Replace the elastic height, and what stays of it: nothing, unless given."""
        self._write(self._h, height)
        if self._dent is not None:
            self._write(self._dent, np.zeros_like(height) if dent is None else dent)

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity."""
        self._write(self._v, velocity)
        self._waiting, self._shift = [], 0.0

    def kick(self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: float) -> None:
        """Add velocities [m/s] to some texels, and one to all that carry waves.

        They are gathered here, and travel together when the next step or look at the velocity needs them.
        """
        self._waiting.append((texels, velocities))
        self._shift += everywhere

    def load(self, texels: NDArray[np.int64], forces: NDArray[np.float64], everywhere: float) -> None:
        """Hold forces [N] on some texels, and one acceleration [m/s^2] on all that carry waves, until the next call."""
        self._loaded, self._load_forces, self._acceleration = texels, forces, everywhere
        self._prepared_dt = 0.0

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        with self._gl:
            self._prepare(dt)
            self._start(dt / 2)
            self._flow()
            for step in range(substeps):
                drift = dt if step < substeps - 1 else dt / 2
                self._fill_ring(self._h)
                self._gather_extra_forces()
                self._kick_drift["dt"] = drift
                self._bind(self._h, self._v, self._h_next, self._stencil, self._coefficients, self._extra)
                self._run_texels(self._kick_drift)
                self._h, self._h_next = self._h_next, self._h
                self._kick_texels(self._forces, drift)
                self._flow()

    def wait(self) -> None:
        """Return when all steps are done."""
        with self._gl as ctx:
            ctx.finish()

    def finite(self) -> bool:
        """Whether all heights are finite, as far as it is known without waiting for the GPU: it is not."""
        return True

    def _compile(self) -> None:
        self._drift = self._shader("drift")
        self._ring = self._gl.compute_shader("ripple_sim.solver", "ring")
        self._kick = self._gl.compute_shader("ripple_sim.solver", "kick")
        self._kick_drift = self._shader("kick_drift", **({"EXTRA": 1} if self._extra else {}))
        if self._viscous:
            self._apply_viscous = self._shader("apply")
        if self._laplace:
            self._apply_rigidity = self._shader("apply", FACTOR=1)
            self._subtract_laplace = self._shader("apply", SUBTRACT=1, **({"ADD": 1} if self._viscous else {}))
        if self._dent:
            self._yielding = self._shader("flow")

    def _start(self, dt: float) -> None:
        """Hand out the kicks that wait, and drift."""
        if self._waiting:
            texels, where = np.unique(np.concatenate([each[0] for each in self._waiting]), return_inverse=True)
            self._kicks.set(
                self._inside[texels], np.bincount(where, np.concatenate([each[1] for each in self._waiting]))
            )
            self._waiting = []
            self._kick_texels(self._kicks, 0.0)
        if dt or self._shift:
            self._drift["dt"], self._drift["shift"] = dt, self._shift
            self._bind(self._h, self._v, self._carries)
            self._run_texels(self._drift)
        self._shift = 0.0

    def _flow(self) -> None:
        if self._dent is not None:
            self._bind(self._h, self._dent, self._yield)
            self._run_texels(self._yielding)

    def _gather_extra_forces(self) -> None:
        """Forces beside tension and stiffness: viscous, and of bending."""
        if self._viscous:
            self._fill_ring(self._v)
            self._bind(self._viscous, self._v, self._extra)
            self._run_texels(self._apply_viscous)
        if self._laplace:
            self._bind(self._laplace, self._h, self._moment, self._rigidity)
            self._run_texels(self._apply_rigidity)
            self._fill_ring(self._moment)
            self._bind(self._laplace, self._moment, self._extra)
            self._run_texels(self._subtract_laplace)

    def _prepare(self, dt: float) -> None:
        """Upload the coefficients of the kick and the load, once a step length and load."""
        if self._prepared_dt == dt:
            return
        k = step_coefficients(self._operator, dt)
        push = np.float32(self._acceleration) * k.span
        packed = np.empty((*k.gain.shape, 4), np.float32)
        for channel, value in enumerate((k.gain, k.decay, k.spring, push)):
            packed[..., channel] = value
        with self._gl as ctx:
            if self._coefficients is None:
                self._coefficients = ctx.buffer(packed.tobytes())
            else:
                self._coefficients.write(packed.tobytes())
        kicks = k.gain.reshape(-1)[self._loaded] * self._load_forces.astype(np.float32)
        self._forces.set(self._inside[self._loaded], kicks)
        self._prepared_dt = dt

    def _shader(self, name: str, **defines: int) -> moderngl.ComputeShader:
        return self._gl.compute_shader("ripple_sim.solver", name, N=self._n, **defines)

    def _kick_texels(self, kicks: _TexelList, dt: float) -> None:
        if kicks.count:
            self._kick["count"], self._kick["dt"] = kicks.count, dt
            self._bind(self._h, self._v, kicks.places, kicks.values)
            self._run_list(self._kick, kicks.count)

    def _fill_ring(self, field: moderngl.Buffer) -> None:
        self._bind(field, self._ring_pairs)
        self._ring["count"] = self._ring_count
        self._run_list(self._ring, self._ring_count)

    def _bind(self, *buffers: moderngl.Buffer | None) -> None:
        for binding, buffer in enumerate(buffers):
            if buffer is not None:
                buffer.bind_to_storage_buffer(binding)

    def _run_texels(self, shader: moderngl.ComputeShader) -> None:
        shader.run(-(-self._n // _GROUP), self._n, 6)
        self._barrier()

    def _run_list(self, shader: moderngl.ComputeShader, count: int) -> None:
        shader.run(-(-count // _GROUP))
        self._barrier()

    def _barrier(self) -> None:
        with self._gl as ctx:
            ctx.memory_barrier()

    def _padded(self) -> moderngl.Buffer:
        with self._gl as ctx:
            return ctx.buffer(np.zeros((6, self._n + 2, self._n + 2), np.float32).tobytes())

    def _upload(self, field: NDArray) -> moderngl.Buffer:
        with self._gl as ctx:
            return ctx.buffer(field.astype(np.float32).tobytes())

    def _read(self, buffer: moderngl.Buffer) -> NDArray[np.float32]:
        with self._gl:
            padded = np.frombuffer(buffer.read(), np.float32).reshape(6, self._n + 2, self._n + 2)
        return padded[:, 1:-1, 1:-1].copy()

    def _write(self, buffer: moderngl.Buffer, field: NDArray[np.float32]) -> None:
        padded = np.zeros((6, self._n + 2, self._n + 2), np.float32)
        padded[:, 1:-1, 1:-1] = field
        with self._gl:
            buffer.write(padded.tobytes())


class _TexelList:
    """Places in the padded field and a number for each, in buffers that grow when they must."""

    def __init__(self, gl: GLContext) -> None:
        self._gl = gl
        self.count = 0
        self._room = 1024
        self._reserve()

    def set(self, places: NDArray[np.int64], values: NDArray) -> None:
        """Replace the list."""
        self.count = len(places)
        with self._gl:
            if self.count > self._room:
                self.places.release()
                self.values.release()
                self._room = 2 * self.count
                self._reserve()
            if self.count:
                self.places.write(places.astype(np.int32).tobytes())
                self.values.write(values.astype(np.float32).tobytes())

    def _reserve(self) -> None:
        with self._gl as ctx:
            self.places, self.values = ctx.buffer(reserve=4 * self._room), ctx.buffer(reserve=4 * self._room)
