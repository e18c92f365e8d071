"""GPU backend: the same leapfrog update as compute shaders, one file a stage in `shaders/`."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..gl import GLContext, shared_context
from ..operator.volume import volume_rate
from ..operator.wave_operator import WaveOperator, step_coefficients
from .gl_dispatch import Dispatch, Pressure, VolumeKeeper
from .gl_fields import DeviceField, FieldLayout, LinkBuffers, TexelList
from .gl_stiffness import StencilBuffer
from .kernels import Amplitude


class ExtraForces:
    """The forces that need stencils of their own, gathered in a field before a substep's kick.

    Attributes
    ----------
    field : moderngl.Buffer or None
        The sum of these forces; None for a material without any.
    """

    def __init__(self, gl: GLContext, fields: FieldLayout, dispatch: Dispatch, operator: WaveOperator) -> None:
        self._gl, self._fields, self._dispatch = gl, fields, dispatch
        self.field: moderngl.Buffer | None = None
        self._viscous: StencilBuffer | None = None
        self._laplace: StencilBuffer | None = None
        if operator.viscous_stencil is not None:
            self._viscous = StencilBuffer(gl, fields, dispatch, operator.viscous_stencil)
            self._apply_viscous = dispatch.texel_shader("apply")
        if operator.laplace_stencil is not None and operator.rigidity is not None:
            self._laplace = StencilBuffer(gl, fields, dispatch, operator.laplace_stencil)
            self._rigidity, self._moment = fields.upload(operator.rigidity), fields.zeros()
            self._apply_rigidity = dispatch.texel_shader("apply", FACTOR=1)
            added = {"ADD": 1} if self._viscous else {}
            self._subtract_laplace = dispatch.texel_shader("apply", SUBTRACT=1, **added)
        if self._viscous or self._laplace:
            self.field = fields.zeros()
        self._irregular = dispatch.shader("irregular", KICK=0)
        self._link(operator)

    def move(self, operator: WaveOperator) -> None:
        """Take over the stencils of the same surface with its texels elsewhere."""
        if self._viscous and operator.viscous_stencil is not None:
            self._viscous.write(operator.viscous_stencil, operator.mass)
        if self._laplace and operator.laplace_stencil is not None and operator.rigidity is not None:
            self._laplace.write(operator.laplace_stencil, operator.mass)
            self._fields.write(self._rigidity, operator.rigidity.astype(np.float32))
        self._link(operator)

    def gather(self, height: moderngl.Buffer, velocity: moderngl.Buffer) -> None:
        """Write the forces at a height, whose halo is filled, and a velocity."""
        if self.field is None:
            return
        dispatch = self._dispatch
        if self._viscous:
            dispatch.fill_halo(velocity)
            dispatch.bind(velocity, self.field, None, self._viscous.buffer)
            dispatch.run_texels(self._apply_viscous)
            self._apply_links(self._viscous_links, velocity, self.field)
        if self._laplace:
            dispatch.bind(height, self._moment, None, self._laplace.buffer, self._rigidity)
            dispatch.run_texels(self._apply_rigidity)
            self._apply_links(self._moment_links, height, self._moment)
            dispatch.fill_halo(self._moment)
            dispatch.bind(self._moment, self.field, None, self._laplace.buffer)
            dispatch.run_texels(self._subtract_laplace)
            self._apply_links(self._bending_links, self._moment, self.field)

    def _link(self, operator: WaveOperator) -> None:
        """Upload the links at irregular vertices."""
        ones = np.ones_like(operator.mass)
        if self._viscous:
            self._viscous_links = LinkBuffers(self._gl, self._fields, self._viscous.irregular, ones)
        if self._laplace and operator.rigidity is not None:
            self._moment_links, self._bending_links = (
                LinkBuffers(self._gl, self._fields, self._laplace.irregular, factors)
                for factors in (operator.rigidity, -ones)
            )

    def _apply_links(self, links: LinkBuffers, field: moderngl.Buffer, result: moderngl.Buffer) -> None:
        if links.count:
            self._dispatch.bind(field, result, None, links.texels, links.links)
            self._dispatch.run_list(self._irregular, links.count)


class GLBackend:
    """Height and velocity in float32 storage buffers; see `backends.Backend`."""

    name = "gl"

    def __init__(self, operator: WaveOperator, gl: GLContext | None = None, *, keeps_volume: bool = False) -> None:
        self.keeps_volume = keeps_volume
        self._gl = gl if gl is not None else shared_context()
        self._operator = operator
        self._fields = fields = FieldLayout(self._gl, operator.topology)
        self._dispatch = Dispatch(self._gl, fields)
        self._dent = self._yield = None
        self._h, self._h_next, self._v = (fields.zeros() for _ in range(3))
        self._stencil = StencilBuffer(self._gl, fields, self._dispatch, operator.stencil)
        self._response = fields.upload(operator.response)
        # a number for each part, where there are several: held by the load, and given at once
        self._held = None if operator.parts is None else Pressure(self._gl, fields, operator)
        self._given = None if operator.parts is None else Pressure(self._gl, fields, operator)
        self._kicks, self._forces = TexelList(self._gl), TexelList(self._gl)
        self._extra = ExtraForces(self._gl, fields, self._dispatch, operator)
        if operator.yield_height is not None:
            self._dent, self._yield = fields.zeros(), fields.upload(operator.yield_height)
        self._compile()
        self._shift: Amplitude = 0.0
        self._crests: moderngl.Buffer | None = None
        self._prepared = (0.0, keeps_volume)
        self._waiting: list[tuple[NDArray[np.int64], NDArray[np.float32]]] = []
        self.load(np.zeros(0, np.int64), np.zeros(0), 0.0)

    def height(self) -> NDArray[np.float32]:
        """Copy of the height [m], [C, n, n]."""
        elastic = self.elastic()
        return elastic if self._dent is None else elastic + self.dent()

    def snapshot(self) -> NDArray[np.float32] | DeviceField:
        """Copy of the height [m], [C, n, n], on the GPU; where the driver is software, in the host's memory."""
        if self._gl.software:
            return self.height()
        fields = [self._h, *([] if self._dent is None else [self._dent])]
        return DeviceField.gathered(self._gl, self._operator.mass.shape, self._fields.texel_addresses, *fields)

    def elastic(self) -> NDArray[np.float32]:
        """Copy of the part of the height that springs back [m], [C, n, n]."""
        return self._fields.read(self._h)

    def dent(self) -> NDArray[np.float32]:
        """The part of the height that stays [m], [C, n, n]."""
        return np.zeros(self._operator.mass.shape, np.float32) if self._dent is None else self._fields.read(self._dent)

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], [C, n, n]."""
        with self._gl:
            self._start(0.0)
        return self._fields.read(self._v)

    def crests(self) -> NDArray[np.float32]:
        """Greatest size of the height after any `advance` since the last call, or now [m], [C, n, n].

        They are kept on the GPU.
        """
        if self._crests is None:
            self._crests = self._fields.zeros()
        with self._gl:
            self._raise_crests(self._crests)
        crests = self._fields.read(self._crests)
        with self._gl:
            self._crests.clear()
        return crests

    def set_height(self, height: NDArray[np.float32], dent: NDArray[np.float32] | None = None) -> None:
        """Replace the elastic height, and the permanent one: 0 unless given."""
        self._fields.write(self._h, height)
        if self._dent is None and dent is not None and dent.any():
            # what another material has left, in a surface that does not yield itself
            self._dent = self._fields.zeros()
        if self._dent is not None:
            self._fields.write(self._dent, np.zeros_like(height) if dent is None else dent)

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity."""
        self._fields.write(self._v, velocity)
        self._waiting, self._shift = [], 0.0

    def kick(self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: Amplitude) -> None:
        """Add velocities [m/s] to some texels, and one to all, as they respond.

        They are collected, and uploaded together before the next step or read of the velocity.
        """
        self._waiting.append((texels, velocities))
        self._shift = self._shift + everywhere

    def load(self, texels: NDArray[np.int64], forces: NDArray[np.float64], everywhere: Amplitude) -> None:
        """Hold forces [N] on some texels, and one acceleration [m/s^2] on all, until the next call."""
        self._loaded, self._load_forces, self._acceleration = texels, forces, everywhere
        self._load_is_new = True

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        with self._gl:
            kick_drift = self._prepare(dt)
            self._start(dt / 2)
            self._flow()
            for step in range(substeps):
                drift = dt if step < substeps - 1 else dt / 2
                self._dispatch.fill_halo(self._h)
                self._extra.gather(self._h, self._v)
                if isinstance(self._held, VolumeKeeper):
                    self._held.follow(self._h, self._v)
                kick_drift["dt"] = drift
                pressure = (self._held.parts, self._held.amplitudes) if self._held is not None else ()
                self._dispatch.bind(
                    self._h,
                    self._v,
                    self._h_next,
                    self._stencil.buffer,
                    self._coefficients,
                    self._extra.field,
                    *pressure,
                )
                self._dispatch.run_texels(kick_drift)
                self._kick_irregular(drift)
                self._h, self._h_next = self._h_next, self._h
                self._kick_texels(self._forces, drift)
                self._flow()
            if self._crests is not None:
                self._raise_crests(self._crests)

    def move(self, operator: WaveOperator) -> None:
        """Take over the stencils of the same surface with its texels elsewhere."""
        self._operator = operator
        self._stencil.write(operator.stencil, operator.mass)
        self._extra.move(operator)
        if self._prepared[0]:
            self._links = LinkBuffers(self._gl, self._fields, self._stencil.irregular, self._step.gain)
        if operator.density is not None:
            self._prepared = (0.0, self.keeps_volume)  # what keeps the volume follows the stencils

    def wait(self) -> None:
        """Return when all steps are done."""
        self._gl.wait()

    def finite(self) -> bool:
        """True: nothing is known without waiting for the GPU."""
        return True

    def _compile(self) -> None:
        self._kick = self._dispatch.shader("kick")
        self._drift = self._dispatch.texel_shader("drift", **({} if self._given is None else {"PARTS": 1}))
        self._irregular_kick = self._dispatch.shader("irregular", KICK=1)
        if self._yield:
            self._yielding = self._dispatch.texel_shader("flow")

    def _start(self, dt: float) -> None:
        """Apply the kicks that wait, and drift."""
        if self._waiting:
            texels, where = np.unique(np.concatenate([each[0] for each in self._waiting]), return_inverse=True)
            kicks = np.bincount(where, np.concatenate([each[1] for each in self._waiting]))
            self._kicks.set(self._fields.texels[texels], kicks)
            self._waiting = []
            self._kick_texels(self._kicks, 0.0)
        if dt or np.any(self._shift):
            self._drift["dt"] = dt
            if self._given is None:
                self._drift["shift"] = self._shift
                self._dispatch.bind(self._h, self._v, self._response)
            else:
                self._given.set(self._shift)
                self._dispatch.bind(self._h, self._v, self._response, self._given.parts, self._given.amplitudes)
            self._dispatch.run_texels(self._drift)
        self._shift = 0.0

    def _flow(self) -> None:
        if self._dent is not None and self._yield is not None:
            self._dispatch.bind(self._h, self._dent, self._yield)
            self._dispatch.run_texels(self._yielding)

    def _raise_crests(self, crests: moderngl.Buffer) -> None:
        shader = self._dispatch.texel_shader("crests", **({} if self._dent is None else {"DENT": 1}))
        self._dispatch.bind(self._h, crests, self._dent)
        self._dispatch.run_texels(shader)

    def _kick_irregular(self, dt: float) -> None:
        """What the irregular links add to a substep."""
        if self._links.count:
            self._irregular_kick["dt"] = dt
            self._dispatch.bind(self._h, self._v, self._h_next, self._links.texels, self._links.links)
            self._dispatch.run_list(self._irregular_kick, self._links.count)

    def _prepare(self, dt: float) -> moderngl.ComputeShader:
        """Compile the kick for this material; upload its coefficients once a step length, and the load once."""
        new_length = self._prepared != (dt, self.keeps_volume)
        if new_length:
            self._step = k = step_coefficients(self._operator, dt)
            self._maps = any(np.ndim(value) for value in (k.decay, k.spring, k.span))
            self._coefficients = self._fields.upload(k.gain, *((k.decay, k.spring, k.span) if self._maps else ()))
            self._links = LinkBuffers(self._gl, self._fields, self._stencil.irregular, k.gain)
            self._keep_volume(dt)
            self._prepared = (dt, self.keeps_volume)
        k = self._step
        if new_length or self._load_is_new:
            kicks = k.gain.reshape(-1)[self._loaded] * self._load_forces.astype(np.float32)
            self._forces.set(self._fields.texels[self._loaded], kicks)
            if self._held is not None:
                self._held.set(self._acceleration)
            self._load_is_new = False
        defines = {"EXTRA": self._extra.field, "MAPS": self._maps, "PARTS": self._held}
        kick_drift = self._dispatch.texel_shader("kick_drift", **{name: 1 for name, used in defines.items() if used})
        if self._held is None:
            kick_drift["acceleration"] = self._acceleration
        if not self._maps:
            kick_drift["decay"], kick_drift["spring"], kick_drift["span"] = k.decay, k.spring, k.span
        return kick_drift

    def _keep_volume(self, dt: float) -> None:
        operator = self._operator
        rate = volume_rate(operator, dt) if self.keeps_volume else None
        if rate is not None:
            self._held = VolumeKeeper(self._gl, self._fields, operator, self._dispatch, rate)
        elif isinstance(self._held, VolumeKeeper):
            self._held = None if operator.parts is None else Pressure(self._gl, self._fields, operator)

    def _kick_texels(self, kicks: TexelList, dt: float) -> None:
        if kicks.count:
            self._kick["dt"] = dt
            self._dispatch.bind(self._h, self._v, kicks.places, kicks.values)
            self._dispatch.run_list(self._kick, kicks.count)
