"""GPU backend: the same leapfrog update as compute shaders, one file a stage in `shaders/`.

The stiffness of a moving surface is made there too, from its vertices, in a storage buffer.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..gl import GLContext, shared_context
from ..kernel import Ints
from ..operator.bending import Bending
from ..operator.curvatures import KINDS, Curvatures
from ..operator.step import step_coefficients
from ..operator.volume import volume_rate
from ..operator.wave_operator import WaveOperator
from ..texels import cells
from ..texels.moving import MovedStencil, interpolate
from ..texels.quad_pass import MIN_AREA_RATIO
from ..texels.stencil import IrregularLinks, Stencil, crossing_links, missing_links
from ..texels.topology import TexelTopology
from .backend import NO_LOAD, TexelLoad
from .gl_fields import (
    DeviceField,
    DeviceProbes,
    FieldLayout,
    Pressure,
    TexelList,
    bind_buffers,
    to_buffer,
)
from .probes import Probes
from .step_kernels import Amplitude
from .surface_fields import SurfaceFields

# Constants of `cells` that the shader of a quad's stiffness needs
_QUAD_CONSTANTS = (
    "PER_HOURGLASS",
    "MAX_HOURGLASS_SHARE",
    "EVENNESS",
    "MIN_AREA",
    "DETOUR_FADE",
    "TINY",
    "PER_TINY",
)


class DeviceStiffness:
    """Computes stencils for one coefficient and one set of cells as the vertices move.

    `stencil` is the first one; `mass` is the mass of each texel [kg], [C, n, n]. The GPU computes
    the quads. The CPU computes the few other cells, and their results are uploaded.
    """

    def __init__(
        self, fields: FieldLayout, stencil: MovedStencil, mass: NDArray[np.float64]
    ) -> None:
        self._fields = fields
        self._mass = mass
        gl = fields.gl
        topology = stencil.topology
        texels = stencil.cells
        ride = stencil.places.ride
        self._width = topology.halo.shape[1]
        self._count = topology.halo.size
        special = texels.special_places
        self._special_corners = ride.corners[special]
        self._special_weights = ride.weights[special]
        self._special_positions = np.empty((3, len(special)))
        self._around = np.zeros((3, self._count))
        added = texels.special_links
        crossing = crossing_links(topology)
        missing = missing_links(topology)
        self._added = _link_groups(gl, topology, added, np.arange(len(added) + 1))
        self._copies = _link_groups(gl, topology, crossing.copies, crossing.begins)
        self._missing = _link_groups(gl, topology, missing, np.arange(len(missing) + 1))
        shares = np.where(topology.rim, 0.5, 1.0) if topology.fixed_rim else np.ones(self._count)
        with gl as ctx:
            self._vertices = ctx.buffer(reserve=stencil.places.V.nbytes)
            self._places = ctx.buffer(reserve=24 * self._count)
            self._sides = ctx.buffer(reserve=24 * self._count)
            self._values = ctx.buffer(reserve=4 * (1 + len(added)))
            self._peak = ctx.buffer(bytes(4))
        quads = stencil.coefficient[0]
        self._corners = to_buffer(gl, ride.corners, np.int32)
        self._weights = to_buffer(gl, np.nan_to_num(ride.weights), np.float64)
        self._conductance = to_buffer(gl, quads.conductance, np.float32)
        self._per_area = to_buffer(gl, quads.per_area, np.float32)
        self._detours = to_buffer(gl, quads.detours, np.float32)
        self._shares = to_buffer(gl, shares, np.float32)
        self._masses = to_buffer(gl, mass, np.float32)
        self._beside = to_buffer(gl, np.zeros(mass.size), np.float32)
        names = ("ride", "quad_links", "close_links", "add_links", "link_rates")
        self._shaders = {name: fields.shader(name) for name in names}
        law = {name: float(getattr(cells, name)) for name in _QUAD_CONSTANTS}
        self._shaders["quads"] = fields.shader("quads", **law, MIN_AREA_RATIO=float(MIN_AREA_RATIO))

    def write(self, stencil: MovedStencil, buffer: moderngl.Buffer) -> IrregularLinks:
        """Write the nine-point stencil into a buffer of `FieldLayout.links`.

        Returns the irregular links.
        """
        V = stencil.places.V
        quads, _ = stencil.coefficient
        interpolate(V, self._special_corners, self._special_weights, self._special_positions)
        self._around[:, stencil.cells.special_places] = self._special_positions
        values, of_cells = stencil.cells.special(self._around, stencil.coefficient)
        irregular = stencil.with_added(of_cells)
        with self._fields.gl:
            self._vertices.write(V.tobytes())
            self._values.write(values.astype(np.float32).tobytes() or bytes(4))
            self._run(
                "ride", self._count, self._vertices, self._corners, self._weights, self._places
            )
            quad_buffers = (
                self._places,
                self._conductance,
                self._per_area,
                self._detours,
                self._sides,
            )
            self._run(
                "quads",
                self._count,
                *quad_buffers,
                width=self._width,
                scale=quads.scale,
                power=quads.power,
            )
            self._run("quad_links", self._count, self._sides, buffer, width=self._width)
            for (groups, *links), factor in ((self._missing, 0.0), (self._copies, 1.0)):
                self._run("close_links", groups, buffer, *links, factor=factor)
            added_count, added_places, _ = self._added
            self._run("add_links", added_count, buffer, added_places, self._values)
            stencil.known_fastest = self._fastest(buffer, irregular)
        return irregular

    def _fastest(self, buffer: moderngl.Buffer, irregular: IrregularLinks) -> float:
        """Gershgorin's bound of the highest rate that a stencil of irregular links gives."""
        if len(irregular.texels):
            beside = np.zeros(self._mass.size, np.float32)
            sizes = np.abs(irregular.weights)
            beside[irregular.texels] = np.add.reduceat(sizes, irregular.begins[:-1])
            self._beside.write(beside.tobytes())
        self._peak.write(bytes(4))
        rate_buffers = (
            buffer,
            self._peak,
            self._fields.texel_addresses,
            self._shares,
            self._beside,
            self._masses,
        )
        self._run("link_rates", self._mass.size, *rate_buffers, width=self._width)
        return float(np.frombuffer(self._peak.read(), np.float32)[0])

    def _run(self, name: str, count: int, *buffers: moderngl.Buffer, **uniforms: float) -> None:
        """Run a shader over a list of `count` entries, if there are any."""
        shader = self._shaders[name]
        for uniform, value in uniforms.items():
            shader[uniform] = value
        bind_buffers(*buffers)
        self._fields.run_list(shader, count)


def _link_groups(
    gl: GLContext, topology: TexelTopology, links: Ints, begins: Ints
) -> tuple[int, moderngl.Buffer, moderngl.Buffer]:
    """Groups of links: how many, the links, and the first and one after the last of each group.

    A link is its place in the fields of east, north, north-east, and across north-east, which lie
    one after the other.
    """
    charts, n, _ = topology.shape
    chart, link, r, c = np.unravel_index(links, (charts, 4, n + 1, n + 1))
    place = ((link * charts + chart) * (n + 2) + r) * (n + 2) + c
    bounds = np.stack([begins[:-1], begins[1:]], axis=1)
    return (
        len(begins) - 1,
        to_buffer(gl, place, np.int32),
        to_buffer(gl, bounds, np.int32),
    )


class StencilBuffer:
    """The nine-point stencil as the wave step reads it, and the irregular links."""

    def __init__(self, fields: FieldLayout, stencil: Stencil) -> None:
        self._fields = fields
        self.buffer = to_buffer(fields.gl, fields.links(stencil), np.float32)
        self.irregular = stencil.irregular
        self._device: DeviceStiffness | None = None

    def write(self, stencil: Stencil, mass: NDArray[np.float64]) -> None:
        """Take over another stencil of the same topology.

        The GPU computes it where texels lie on their triangles, and no texel lies on two. Else it
        is uploaded; so it is with a software driver, whose shaders run on the processor's own
        cores: the CPU's loops take a fifth of their time.
        """
        if (
            isinstance(stencil, MovedStencil)
            and not self._fields.gl.software
            and stencil.places.ride.on_triangles
        ):
            if self._device is None:
                self._device = DeviceStiffness(self._fields, stencil, mass)
            self.irregular = self._device.write(stencil, self.buffer)
        else:
            with self._fields.gl:
                self.buffer.write(self._fields.links(stencil))
            self.irregular = stencil.irregular


class Squares:
    """Bending by the squares of three curvatures; see `Curvatures`."""

    def __init__(self, fields: FieldLayout, bending: Curvatures, *, add: bool) -> None:
        self._fields = fields
        self._weights, self._transposed = (
            fields.upload(*each.reshape(-1, *bending.topology.shape))
            for each in (bending.weights, bending.transposed)
        )
        self._curvatures = fields.upload(*np.zeros(KINDS, np.float32))
        self._halo = fields.halo_pairs(KINDS)
        self._take = fields.texel_shader("curvatures")
        self._bend = fields.texel_shader("bend", **({"ADD": 1} if add else {}))

    def gather(self, height: moderngl.Buffer, result: moderngl.Buffer) -> None:
        """Write the forces at a height, whose halo is filled, or add them."""
        bind_buffers(height, self._curvatures, self._weights)
        self._fields.run_texels(self._take)
        self._fields.fill_halo(self._curvatures, self._halo)
        bind_buffers(self._curvatures, result, self._transposed)
        self._fields.run_texels(self._bend)


class ExtraForces:
    """The forces that need stencils of their own, gathered in a field before a substep's kick.

    `field` is the sum of these forces; None for a material without any.
    """

    def __init__(self, fields: FieldLayout, operator: WaveOperator) -> None:
        self._fields = fields
        self._viscosity: StencilBuffer | None = None
        self._laplace: StencilBuffer | None = None
        self._squares: Squares | None = None
        if operator.viscosity_stencil is not None:
            self._viscosity = StencilBuffer(fields, operator.viscosity_stencil)
            self._apply_viscosity = fields.texel_shader("apply")
        if isinstance(operator.bending, Curvatures):
            self._squares = Squares(fields, operator.bending, add=self._viscosity is not None)
        if isinstance(operator.bending, Bending):
            self._laplace = StencilBuffer(fields, operator.bending.laplace)
            self._rigidity = fields.upload(operator.bending.rigidity)
            self._moment = fields.zeros()
            self._apply_rigidity = fields.texel_shader("apply", FACTOR=1)
            added = {"ADD": 1} if self._viscosity else {}
            self._subtract_laplace = fields.texel_shader("apply", SUBTRACT=1, **added)
        self.field = fields.zeros() if self._viscosity or self._laplace or self._squares else None
        self._irregular = fields.shader("irregular", KICK=0)
        self._link(operator)

    def move(self, operator: WaveOperator) -> None:
        """Take over the stencils of the same surface with its texels elsewhere."""
        if self._viscosity and operator.viscosity_stencil is not None:
            self._viscosity.write(operator.viscosity_stencil, operator.mass)
        if self._laplace and isinstance(operator.bending, Bending):
            self._laplace.write(operator.bending.laplace, operator.mass)
            self._fields.write(self._rigidity, operator.bending.rigidity.astype(np.float32))
        self._link(operator)

    def gather(self, height: moderngl.Buffer, velocity: moderngl.Buffer) -> None:
        """Write the forces at a height, whose halo is filled, and a velocity."""
        if self.field is None:
            return
        if self._viscosity:
            self._fields.fill_halo(velocity)
            self._apply(
                self._apply_viscosity, self._viscosity, self._viscosity_links, velocity, self.field
            )
        if self._laplace:
            self._apply(
                self._apply_rigidity,
                self._laplace,
                self._moment_links,
                height,
                self._moment,
                self._rigidity,
            )
            self._fields.fill_halo(self._moment)
            self._apply(
                self._subtract_laplace, self._laplace, self._bending_links, self._moment, self.field
            )
        if self._squares:
            self._squares.gather(height, self.field)

    def _link(self, operator: WaveOperator) -> None:
        """Upload the links at irregular vertices."""
        ones = np.ones_like(operator.mass)
        if self._viscosity:
            self._viscosity_links = self._fields.upload_links(self._viscosity.irregular, ones)
        if self._laplace and isinstance(operator.bending, Bending):
            self._moment_links, self._bending_links = (
                self._fields.upload_links(self._laplace.irregular, factors)
                for factors in (operator.bending.rigidity, -ones)
            )

    def _apply(
        self,
        shader: moderngl.ComputeShader,
        stencil: StencilBuffer,
        links: tuple[int, moderngl.Buffer, moderngl.Buffer],
        field: moderngl.Buffer,
        result: moderngl.Buffer,
        *factors: moderngl.Buffer,
    ) -> None:
        bind_buffers(field, result, None, stencil.buffer, *factors)
        self._fields.run_texels(shader)
        count, *buffers = links
        if count:
            bind_buffers(field, result, None, *buffers)
            self._fields.run_list(self._irregular, count)


class GLBackend:
    """Height and velocity in float32 storage buffers; see `Backend`."""

    name = "gl"

    def __init__(
        self,
        operator: WaveOperator,
        gl: GLContext | None = None,
        *,
        keeps_volume: bool | None = False,
    ) -> None:
        self.keeps_volume = keeps_volume
        self._gl = gl if gl is not None else shared_context()
        self._operator = operator
        self._layout = layout = FieldLayout(self._gl, operator.topology)
        self._yield: moderngl.Buffer | None = None
        self.fields = SurfaceFields(
            layout, operator.topology.shape, h=layout.zeros(), v=layout.zeros()
        )
        # room for the height of the next substep
        self._h_next = layout.zeros()
        self._stencil = StencilBuffer(layout, operator.stencil)
        self._response = layout.upload(operator.response)
        # velocity shifts of the kicks, a number for each part where there are several; and the
        # accelerations that the load holds
        self._part_shifts = None if operator.parts is None else Pressure(layout, operator)
        self._held: Pressure | None = None
        self._kicks = TexelList(self._gl)
        self._forces = TexelList(self._gl)
        self._extra = ExtraForces(layout, operator)
        if operator.yield_height is not None:
            self.fields.dent = layout.zeros()
            self._yield = layout.upload(operator.yield_height)
            self._yielding = layout.texel_shader("flow")
        self._kick = layout.shader("kick")
        self._irregular_kick = layout.shader("irregular", KICK=1)
        self._drift = layout.texel_shader("drift")
        parts = {} if self._part_shifts is None else {"PARTS": 1}
        self._shift_and_drift = layout.texel_shader("drift", SHIFT=1, **parts)
        self._shift: Amplitude = 0.0
        self._prepared = (0.0, keeps_volume)
        self._waiting: list[tuple[NDArray[np.int64], NDArray[np.float32]]] = []
        self._load = NO_LOAD
        # the load whose forces are uploaded
        self._uploaded: TexelLoad | None = None
        self._probes: DeviceProbes | None = None

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], with all kicks."""
        with self._gl:
            self._start(0.0)
        return self.fields.velocity()

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity [m/s]; earlier kicks are gone."""
        self.fields.set_velocity(velocity)
        self._waiting = []
        self._shift = 0.0

    def crests(self) -> NDArray[np.float32]:
        """Greatest size of the height since the last call [m]: after any `advance`, or now."""
        self._raise_crests(self.fields.watched_crests())
        return self.fields.take_crests()

    def snapshot(self) -> NDArray[np.float32] | DeviceField:
        """Copy of the height [m], [C, n, n], on the GPU; with a software driver, on the host."""
        if self._gl.software:
            return self.fields.height()
        fields = [self.fields.h]
        if self.fields.dent is not None:
            fields.append(self.fields.dent)
        return DeviceField.gathered(
            self._gl, self._operator.mass.shape, self._layout.texel_addresses, *fields
        )

    def kick(
        self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: Amplitude
    ) -> None:
        """Add velocities [m/s] to some texels, and one to all, as they respond.

        They are collected, and uploaded together before the next step or read of the velocity.
        """
        self._waiting.append((texels, velocities))
        self._shift = self._shift + everywhere

    def hold(self, load: TexelLoad) -> None:
        """Let a load act in every substep until the next call."""
        self._load = load

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        fields = self.fields
        with self._gl:
            kick_drift = self._prepare(dt)
            self._start(dt / 2)
            self._flow()
            if self._probes is not None:
                self._probes.begin(substeps)
            for step in range(substeps):
                drift = dt if step < substeps - 1 else dt / 2
                self._layout.fill_halo(fields.h)
                self._extra.gather(fields.h, fields.v)
                if self._held is not None and self._held.follow is not None:
                    self._held.follow(fields.h, fields.v)
                self._kick_and_drift(kick_drift, drift)
                fields.h, self._h_next = self._h_next, fields.h
                self._kick_texels(self._forces, drift)
                if self._probes is not None:
                    self._probes.take(step, drift - dt / 2, fields.h, fields.v, fields.dent)
                self._flow()
            if fields.crests is not None:
                self._raise_crests(fields.crests)

    def _kick_and_drift(self, shader: moderngl.ComputeShader, drift: float) -> None:
        """Kick the velocities by all forces, and let the heights drift for a time [s]."""
        fields = (self.fields.h, self.fields.v, self._h_next)
        operator = (self._stencil.buffer, self._coefficients, self._extra.field)
        pressure = () if self._held is None else (self._held.parts, self._held.amplitudes)
        shader["dt"] = drift
        bind_buffers(*fields, *operator, *pressure)
        self._layout.run_texels(shader)
        link_count, *link_buffers = self._links
        if link_count:
            self._irregular_kick["dt"] = drift
            bind_buffers(*fields, *link_buffers)
            self._layout.run_list(self._irregular_kick, link_count)

    def probe(self, probes: Probes | None) -> None:
        """Take sums of texels after every substep from now on; None ends it."""
        self._probes = probes and DeviceProbes(self._layout, probes)

    def probed(self) -> NDArray[np.float32]:
        """The sums of the latest `advance`, [substeps, k]."""
        return np.zeros((0, 0), np.float32) if self._probes is None else self._probes.read()

    def move(self, operator: WaveOperator) -> None:
        """Take over the stencils of the same surface with its texels elsewhere."""
        self._operator = operator
        self._stencil.write(operator.stencil, operator.mass)
        self._extra.move(operator)
        if self._prepared[0]:
            self._links = self._layout.upload_links(self._stencil.irregular, self._step.gain)
        if operator.density is not None:
            self._prepared = (0.0, self.keeps_volume)  # what keeps the volume follows the stencils

    def wait(self) -> None:
        """Return when all steps are done."""
        self._gl.wait()

    def finite(self) -> bool:
        """True: nothing is known without waiting for the GPU."""
        return True

    def _start(self, dt: float) -> None:
        """Apply the kicks that wait, and drift for dt [s]."""
        if self._waiting:
            all_texels = np.concatenate([texels for texels, _ in self._waiting])
            all_velocities = np.concatenate([velocities for _, velocities in self._waiting])
            texels, texel_of_kick = np.unique(all_texels, return_inverse=True)
            kicks = np.bincount(texel_of_kick, all_velocities)
            self._kicks.set(self._layout.texels[texels], kicks)
            self._waiting = []
            self._kick_texels(self._kicks, 0.0)
        fields = (self.fields.h, self.fields.v)
        if np.any(self._shift):
            self._shift_and_drift["dt"] = dt
            if self._part_shifts is None:
                self._shift_and_drift["shift"] = self._shift
                bind_buffers(*fields, self._response)
            else:
                self._part_shifts.set(self._shift)
                shifts = (self._part_shifts.parts, self._part_shifts.amplitudes)
                bind_buffers(*fields, self._response, *shifts)
            self._layout.run_texels(self._shift_and_drift)
        elif dt:
            self._drift["dt"] = dt
            bind_buffers(*fields)
            self._layout.run_texels(self._drift)
        self._shift = 0.0

    def _flow(self) -> None:
        """Move the height beyond the yield height into the dent, where the material yields."""
        if self._yield is not None:
            bind_buffers(self.fields.h, self.fields.dent, self._yield)
            self._layout.run_texels(self._yielding)

    def _raise_crests(self, crests: moderngl.Buffer) -> None:
        """Raise the crests to the size of the height where that is greater."""
        dent = self.fields.dent
        with self._gl:
            defines = {} if dent is None else {"DENT": 1}
            shader = self._layout.texel_shader("crests", **defines)
            bind_buffers(self.fields.h, crests, dent)
            self._layout.run_texels(shader)

    def _prepare(self, dt: float) -> moderngl.ComputeShader:
        """The shader that kicks this material's velocities, for substeps of dt [s].

        Coefficients are uploaded once for each step length, the load also for each new load.
        """
        new_length = self._prepared != (dt, self.keeps_volume)
        if new_length:
            self._prepare_coefficients(dt)
            self._prepared = (dt, self.keeps_volume)
        k = self._step
        load = self._load
        if new_length or load is not self._uploaded:
            kicks = k.gain.reshape(-1)[load.texels] * load.forces.astype(np.float32)
            self._forces.set(self._layout.texels[load.texels], kicks)
            if self._held is not None:
                self._held.set(load.acceleration)
            self._uploaded = load
        used_by_define = {"EXTRA": self._extra.field, "MAPS": self._maps, "PARTS": self._held}
        defines = {name: 1 for name, used in used_by_define.items() if used}
        kick_drift = self._layout.texel_shader("kick_drift", **defines)
        if not self._maps:
            kick_drift["decay"] = k.decay
            kick_drift["spring"] = k.spring
        if self._maps and self._held is None:
            kick_drift["acceleration"] = load.acceleration
        elif self._held is None:
            kick_drift["push"] = k.span * np.float32(load.acceleration)
        elif not self._maps:
            kick_drift["span"] = k.span
        return kick_drift

    def _prepare_coefficients(self, dt: float) -> None:
        """Upload the coefficients of the kick for substeps of dt [s]."""
        self._step = k = step_coefficients(self._operator, dt)
        uniform_or_maps = (k.decay, k.spring, k.span)
        self._maps = any(np.ndim(value) for value in uniform_or_maps)
        maps = uniform_or_maps if self._maps else ()
        self._coefficients = self._layout.upload(k.gain, *maps)
        self._links = self._layout.upload_links(self._stencil.irregular, k.gain)
        rate = volume_rate(self._operator, dt, self.keeps_volume)
        several = rate is not None or self._operator.parts is not None
        self._held = Pressure(self._layout, self._operator, rate) if several else None

    def _kick_texels(self, kicks: TexelList, dt: float) -> None:
        if kicks.count:
            self._kick["dt"] = dt
            bind_buffers(self.fields.h, self.fields.v, kicks.places, kicks.values)
            self._layout.run_list(self._kick, kicks.count)
