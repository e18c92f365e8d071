"""Fields in storage buffers, and the compute shaders that run over them.

Charts with their halo, links of stencils, lists of texels. A `DeviceField` stays on the GPU:
nothing is read back unless it is asked for. Shaders are compiled for a layout of fields, and run
over texels or lists. `Pressure` holds the pressure on each part of the surface in storage buffers;
see `volume_rate`.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..gl import GLContext
from ..operator.volume import VolumeRate
from ..operator.wave_operator import WaveOperator
from ..texels.stencil import IrregularLinks, Stencil
from ..texels.topology import TexelTopology
from .probes import Probes
from .step_kernels import Amplitude

# Packages below which the shaders lie.
_SOLVER_PACKAGE = "ripple_sim.solver"
_SHADER_PACKAGE = "ripple_sim.solver.backends.shaders"

_FIELD_GROUP = 256  # threads of a group that makes a `DeviceField`
_LIST_GROUP = 64  # threads of a group that works through a list
_TEXEL_GROUP = 256  # threads of a group that works on texels
_SUMMED_ENTRIES = 2048  # entries of a list that one group of threads adds up


def bind_buffers(*buffers: moderngl.Buffer | None) -> None:
    """Bind storage buffers to 0, 1, 2 ..., in the order in which a shader declares them.

    None leaves out a binding.
    """
    for binding, buffer in enumerate(buffers):
        if buffer is not None:
            buffer.bind_to_storage_buffer(binding)


def to_buffer(gl: GLContext, values: NDArray, kind: type) -> moderngl.Buffer:
    """Numbers of a type in a storage buffer; it has eight bytes for none, as none can be empty."""
    with gl as ctx:
        return ctx.buffer(np.ascontiguousarray(values, kind).tobytes() or bytes(8))


class DeviceField:
    """A frozen field [C, n, n] in a storage buffer, made by `gathered` or `blend`.

    `numpy.asarray` reads it back. The buffer holds float32 numbers, chart by chart and row by row.
    """

    def __init__(
        self,
        gl: GLContext,
        shape: tuple[int, ...],
        share: float,
        *sources: moderngl.Buffer,
        **defines: int,
    ) -> None:
        self.gl = gl
        self.shape = shape
        count = int(np.prod(shape))
        with gl as ctx:
            self.buffer: moderngl.Buffer = ctx.buffer(reserve=4 * count)
            self._peak = ctx.buffer(bytes(4))
            program = gl.compute_shader(
                _SOLVER_PACKAGE, "backends/shaders/device_field", GROUP=_FIELD_GROUP, **defines
            )
            program["count"] = count
            program["share"] = share
            bind_buffers(self.buffer, self._peak, *sources)
            program.run(-(-count // _FIELD_GROUP))
            ctx.memory_barrier()
            self._fence = gl.put_fence()

    @classmethod
    def gathered(
        cls,
        gl: GLContext,
        shape: tuple[int, ...],
        addresses: moderngl.Buffer,
        *fields: moderngl.Buffer,
    ) -> DeviceField:
        """One field, or the sum of two, by the address of every texel in them."""
        first = fields[0]
        second = fields[-1]
        return cls(gl, shape, float(len(fields) - 1), first, second, addresses)

    def blend(self, other: DeviceField, share: float) -> DeviceField:
        """The field that lies a share of the way to another field."""
        return DeviceField(self.gl, self.shape, share, self.buffer, other.buffer, BLEND=1)

    @functools.cached_property
    def peak(self) -> float:
        """The largest size of a value; NaN if one is not a number.

        Waits until the field is computed, and no longer.
        """
        self.gl.wait_for(self._fence)
        with self.gl:
            return float(np.frombuffer(self._peak.read(), np.float32)[0])

    def read(self) -> NDArray[np.float32]:
        """A copy in the host's memory."""
        with self.gl:
            self.gl.wait()
            return np.frombuffer(self.buffer.read(), np.float32).reshape(self.shape).copy()

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray:
        return self.read().astype(np.float32 if dtype is None else dtype, copy=False)


class FieldLayout:
    """Charts with their halo, [C, n + 2, n + 2] float32, and the shaders that run over them.

    Attributes
    ----------
    gl : GLContext
    texels : int64 [C n^2]
        Address of every texel, by flat texel index.
    """

    def __init__(self, gl: GLContext, topology: TexelTopology) -> None:
        self.gl = gl
        self._places = topology.halo.shape
        self._n = topology.shape[1]
        self.texels, *halo = topology.addresses
        # places in the halo, and the texels that they show
        self._pairs = np.stack(halo, axis=1)
        self._halo = self.halo_pairs(1)
        self._fill_halo = self.shader("halo")

    def shader(self, name: str, **defines: float) -> moderngl.ComputeShader:
        """A shader that runs over a list."""
        return self.gl.compute_shader(_SHADER_PACKAGE, name, GROUP=_LIST_GROUP, **defines)

    def texel_shader(self, name: str, **defines: int) -> moderngl.ComputeShader:
        """A shader that runs over all texels, see charts.glsl."""
        return self.gl.compute_shader(
            _SHADER_PACKAGE,
            name,
            GROUP=_TEXEL_GROUP,
            N=self._n,
            CHARTS=self._places[0],
            **defines,
        )

    def run_texels(self, shader: moderngl.ComputeShader) -> None:
        """Run a shader over all texels."""
        shader.run(-(-len(self.texels) // _TEXEL_GROUP))
        self.gl.barrier()

    def run_list(self, shader: moderngl.ComputeShader, count: int) -> None:
        """Run a shader over a list of `count` entries, if there are any."""
        if count:
            shader["count"] = count
            shader.run(-(-count // _LIST_GROUP))
            self.gl.barrier()

    def halo_pairs(self, number: int) -> tuple[int, moderngl.Buffer]:
        """Pairs of a place in the halo and the texel that it shows: how many, and the pairs.

        They are the pairs of `number` fields that lie one after the other.
        """
        starts = int(np.prod(self._places)) * np.arange(number)
        pairs = (starts[:, None, None] + self._pairs).reshape(-1, 2)
        return len(pairs), to_buffer(self.gl, pairs, np.int32)

    def fill_halo(
        self, field: moderngl.Buffer, halo: tuple[int, moderngl.Buffer] | None = None
    ) -> None:
        """Fill the halo of a field, or of several fields with their `halo_pairs`."""
        count, pairs = self._halo if halo is None else halo
        bind_buffers(field, pairs)
        self.run_list(self._fill_halo, count)

    @functools.cached_property
    def texel_addresses(self) -> moderngl.Buffer:
        """`texels`, on the GPU."""
        return to_buffer(self.gl, self.texels, np.int32)

    def zeros(self) -> moderngl.Buffer:
        """A field of zeros."""
        return self.upload(np.float32(0))

    def upload(self, *fields: NDArray | np.float32) -> moderngl.Buffer:
        """Fields [C, n, n], or numbers, one after the other, with zeros round them."""
        with self.gl as ctx:
            return ctx.buffer(self._with_halo(*fields))

    def links(self, stencil: Stencil) -> NDArray[np.float32]:
        """The four links of a stencil that start in each place, [4, C, n + 2, n + 2]."""
        links = np.zeros((4, *self._places), np.float32)
        links[:, :, :-1, :-1] = stencil.weights.swapaxes(0, 1)
        return links

    def upload_links(
        self, links: IrregularLinks, factors: NDArray
    ) -> tuple[int, moderngl.Buffer, moderngl.Buffer]:
        """The irregular links of a stencil, with the addresses of their ends, as shaders read them.

        The forces on each texel are multiplied by its factor; `factors` is [C, n, n].

        Returns
        -------
        int
            Number of texels with irregular links.
        texels, links : moderngl.Buffer
            (address, first link, one after its last) of each such texel, and the address of each
            link's other end with the bits of its weight.
        """
        scale = np.repeat(factors.reshape(-1)[links.texels], np.diff(links.begins))
        texels = np.stack([self.texels[links.texels], links.begins[:-1], links.begins[1:]], axis=1)
        bits = (scale * links.weights).astype(np.float32).view(np.int32)
        others = np.stack([self.texels[links.others], bits], axis=1)
        return (
            len(links.texels),
            to_buffer(self.gl, texels, np.int32),
            to_buffer(self.gl, others, np.int32),
        )

    def read(self, buffer: moderngl.Buffer) -> NDArray[np.float32]:
        """A field's texels, [C, n, n]."""
        with self.gl:
            self.gl.wait()
            places = np.frombuffer(buffer.read(), np.float32)
        return places.reshape(self._places)[:, 1:-1, 1:-1].copy()

    def write(self, buffer: moderngl.Buffer, field: NDArray[np.float32] | np.float32) -> None:
        """Replace a field's texels; the halo becomes 0."""
        with self.gl:
            buffer.write(self._with_halo(field))

    def _with_halo(self, *fields: NDArray | np.float32) -> NDArray[np.float32]:
        places = np.zeros((len(fields), *self._places), np.float32)
        for around, field in zip(places, fields, strict=True):
            around[:, 1:-1, 1:-1] = field
        return places


class TexelList:
    """Places in a field and a number for each, in buffers that grow when they must."""

    def __init__(self, gl: GLContext) -> None:
        self._gl = gl
        self._room = 0
        self.count = 0

    def set(self, places: NDArray[np.int64], values: NDArray) -> None:
        """Replace the list."""
        self.count = len(places)
        with self._gl as ctx:
            if self.count > self._room:
                self._room = max(2 * self.count, 1024)
                self.places = ctx.buffer(reserve=4 * self._room)
                self.values = ctx.buffer(reserve=4 * self._room)
            if self.count:
                self.places.write(places.astype(np.int32).tobytes())
                self.values.write(values.astype(np.float32).tobytes())


class Pressure:
    """Amplitudes of the operator's response, one for each part of the surface.

    Attributes
    ----------
    parts : Buffer
        A field with the number of each texel's part.
    amplitudes : Buffer
        The amplitude of each part.
    follow : callable or None
        With a `rate`: computes the amplitudes of the coming substep from its height and velocity,
        so that the volume stays.
    """

    def __init__(
        self, fields: FieldLayout, operator: WaveOperator, rate: VolumeRate | None = None
    ) -> None:
        numbers = (
            np.zeros(operator.mass.shape, np.int32) if operator.parts is None else operator.parts
        )
        self._gl = fields.gl
        self._count = int(numbers.max()) + 1
        self.parts = fields.upload(numbers)
        with fields.gl as ctx:
            self._asked = ctx.buffer(reserve=4 * self._count)
            self.amplitudes = self._asked if rate is None else ctx.buffer(reserve=4 * self._count)
        self.follow: Callable[[moderngl.Buffer, moderngl.Buffer], None] | None = None
        if rate is None:
            return
        begins, texels, heights, velocities = rate
        # the entries of each part are cut into chunks: first and one after the last of each chunk,
        # and where the chunks of each part begin
        chunks_of_parts = []
        for first_entry, last_entry in itertools.pairwise(begins):
            cuts = np.append(np.arange(first_entry, last_entry, _SUMMED_ENTRIES), last_entry)
            chunks_of_parts.append(np.stack([cuts[:-1], cuts[1:]], axis=1))
        chunks = np.concatenate(chunks_of_parts)
        chunk_begins = np.cumsum([0, *(len(part_chunks) for part_chunks in chunks_of_parts)])
        velocity_factors = velocities if len(velocities) else np.zeros_like(heights)
        factors = np.stack([heights, velocity_factors], axis=1)
        entries = (
            to_buffer(self._gl, fields.texels[texels], np.int32),
            to_buffer(self._gl, factors, np.float32),
            to_buffer(self._gl, chunks, np.int32),
        )
        first = to_buffer(self._gl, chunk_begins, np.int32)
        sums = to_buffer(self._gl, np.zeros(len(chunks)), np.float32)
        weigh = fields.shader("volume")
        balance = fields.shader("volume", PARTS=1)
        # local names: a cycle through `self` would keep buffers until Python collects garbage
        gl = self._gl
        asked = self._asked
        amplitudes = self.amplitudes
        count = self._count

        def follow(height: moderngl.Buffer, velocity: moderngl.Buffer) -> None:
            bind_buffers(height, velocity, *entries, sums)
            weigh.run(len(chunks))
            gl.barrier()
            bind_buffers(asked, sums, first, amplitudes)
            fields.run_list(balance, count)

        self.follow = follow

    def set(self, amplitude: Amplitude) -> None:
        """Write what the load asks for: a number, or one for each part."""
        with self._gl:
            self._asked.write(np.full(self._count, amplitude, np.float32).tobytes())


class DeviceProbes:
    """The sums of `Probes`, taken on the GPU by one group of threads for each sum.

    The sums of all substeps of a step are read back together.
    """

    def __init__(self, fields: FieldLayout, probes: Probes) -> None:
        self._gl = fields.gl
        self._count = len(probes.heights)
        self._steps = 0
        self._room = 0
        self._shaders = fields.shader("probe"), fields.shader("probe", DENT=1)
        weights = probes.weights.astype(np.float32).view(np.int32)
        entries = np.stack([fields.texels[probes.texels], weights], axis=1)
        rows = np.stack([probes.begins[:-1], probes.begins[1:], probes.heights], axis=1)
        self._rows = to_buffer(fields.gl, rows, np.int32)
        self._entries = to_buffer(fields.gl, entries, np.int32)

    def begin(self, substeps: int) -> None:
        """Make room for the sums of a number of substeps."""
        self._steps = substeps
        if substeps > self._room:
            self._room = substeps
            with self._gl as ctx:
                self._sums = ctx.buffer(reserve=4 * substeps * self._count)

    def take(
        self,
        step: int,
        drifted: float,
        height: moderngl.Buffer,
        velocity: moderngl.Buffer,
        dent: moderngl.Buffer | None,
    ) -> None:
        """Take the sums of a substep.

        Its heights have drifted for `drifted` [s] beyond the time of its velocities.
        """
        shader = self._shaders[dent is not None]
        shader["first"] = step * self._count
        shader["drifted"] = drifted
        bind_buffers(height, velocity, self._rows, self._entries, self._sums, dent)
        shader.run(self._count)
        self._gl.barrier()  # later substeps overwrite the values read here

    def read(self) -> NDArray[np.float32]:
        """The sums of all substeps, [substeps, k]."""
        with self._gl:
            self._gl.wait()
            sums = np.frombuffer(self._sums.read(4 * self._steps * self._count), np.float32)
        return sums.reshape(self._steps, self._count).copy()
