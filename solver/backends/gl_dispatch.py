"""Compute shaders of the waves: compiled for a layout of fields, bound to buffers, and run over texels or lists.

`Pressure` holds the pressure on each part of the surface in storage buffers; see `VolumeRate`.
"""

from __future__ import annotations

import itertools

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..gl import GLContext
from ..operator.volume import VolumeRate
from ..operator.wave_operator import WaveOperator
from .gl_fields import FieldLayout, bind_buffers
from .kernels import Amplitude, Probes

# Threads of a group that works through a list.
_LIST_GROUP = 64


class Dispatch:
    """Runs the shaders in `shaders/` on fields of one layout."""

    def __init__(self, gl: GLContext, fields: FieldLayout) -> None:
        self._gl = gl
        self._fields = fields
        self._halo = self.shader("halo")

    def shader(self, name: str, **defines: float) -> moderngl.ComputeShader:
        """A shader that runs over a list."""
        return self._gl.compute_shader("ripple_sim.solver.backends.shaders", name, LIST_GROUP=_LIST_GROUP, **defines)

    def texel_shader(self, name: str, **defines: int) -> moderngl.ComputeShader:
        """A shader that runs over all texels, see charts.glsl."""
        return self.shader(name, N=self._fields.n, **defines)

    def run_texels(self, shader: moderngl.ComputeShader) -> None:
        """Run a shader over all texels."""
        self.run_list(shader, self._fields.count)

    def run_list(self, shader: moderngl.ComputeShader, count: int) -> None:
        """Run a shader over a list of so many entries, of which it is told."""
        shader["count"] = count
        shader.run(-(-count // _LIST_GROUP))
        self._gl.barrier()

    def fill_halo(self, field: moderngl.Buffer) -> None:
        """Fill the halo of a field."""
        count = self._fields.halo_count
        if count:
            bind_buffers(field, self._fields.halo_pairs)
            self.run_list(self._halo, count)


# Entries of a list that one group of threads adds up.
_CHUNK = 2048


class Pressure:
    """Amplitudes of the operator's response, one for each part, of which the field `parts` has the numbers.

    With a `rate` they follow height and velocity, so that the volume stays.
    """

    def __init__(
        self, gl: GLContext, fields: FieldLayout, operator: WaveOperator, dispatch: Dispatch,
        rate: VolumeRate | None = None,
    ) -> None:  # fmt: skip
        numbers = np.zeros(operator.mass.shape, np.int32) if operator.parts is None else operator.parts
        self._gl, self._fields, self._count = gl, fields, int(numbers.max()) + 1
        self.parts = fields.upload(numbers)
        with gl as ctx:
            self._asked = self.amplitudes = ctx.buffer(reserve=4 * self._count)
        self.follows = rate is not None
        if rate is None:
            return
        self._dispatch = dispatch
        velocities = rate.velocities if len(rate.velocities) else np.zeros_like(rate.heights)
        chunks, begins = _chunks(rate.begins)
        self._chunk_count = len(chunks)
        with gl as ctx:
            self._addresses = ctx.buffer(fields.texels[rate.texels].astype(np.int32).tobytes())
            self._factors = ctx.buffer(np.stack([rate.heights, velocities], axis=1).tobytes())
            self._chunks = ctx.buffer(chunks.astype(np.int32).tobytes())
            self._begins = ctx.buffer(begins.astype(np.int32).tobytes())
            self._sums, self._asked = ctx.buffer(reserve=4 * len(chunks)), ctx.buffer(reserve=4 * self._count)
        self._weigh, self._balance = dispatch.shader("volume"), dispatch.shader("volume", PARTS=1)

    def set(self, amplitude: Amplitude) -> None:
        """Write what the load asks for: a number, or one for each part."""
        with self._gl:
            self._asked.write(np.full(self._count, amplitude, np.float32).tobytes())

    def follow(self, height: moderngl.Buffer, velocity: moderngl.Buffer) -> None:
        """Set the amplitudes of the coming substep."""
        bind_buffers(height, velocity, self._addresses, self._factors, self._chunks, self._sums)
        self._weigh.run(self._chunk_count)
        self._gl.barrier()
        bind_buffers(self._asked, self._sums, self._begins, self.amplitudes)
        self._dispatch.run_list(self._balance, self._count)


def _chunks(begins: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cut the entries of each part into chunks: first and one after the last of each; where those of a part begin."""
    bounds = [np.append(np.arange(first, last, _CHUNK), last) for first, last in itertools.pairwise(begins)]
    chunks = [np.stack([each[:-1], each[1:]], axis=1) for each in bounds]
    return np.concatenate(chunks), np.cumsum([0, *map(len, chunks)])


class DeviceProbes:
    """The sums of `Probes`, one group of threads each; those of all substeps of a step are read back together."""

    def __init__(self, gl: GLContext, fields: FieldLayout, dispatch: Dispatch, probes: Probes) -> None:
        self._gl, self._count, self._steps, self._room = gl, len(probes.heights), 0, 0
        self._shaders = dispatch.shader("probe"), dispatch.shader("probe", DENT=1)
        weights = probes.weights.astype(np.float32).view(np.int32)
        entries = np.stack([fields.texels[probes.texels].astype(np.int32), weights], axis=1)
        rows = np.stack([probes.begins[:-1], probes.begins[1:], probes.heights], axis=1)
        with gl as ctx:
            self._rows, self._entries = ctx.buffer(rows.astype(np.int32).tobytes()), ctx.buffer(entries.tobytes())

    def begin(self, substeps: int) -> None:
        """Make room for the sums of so many substeps."""
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
        """The sums of a substep, whose heights have drifted beyond its velocities [s]."""
        shader = self._shaders[dent is not None]
        shader["first"], shader["drifted"] = step * self._count, drifted
        bind_buffers(height, velocity, self._rows, self._entries, self._sums, dent)
        shader.run(self._count)
        self._gl.barrier()  # later substeps write what is read here

    def read(self) -> NDArray[np.float32]:
        """The sums of all substeps, [substeps, k]."""
        with self._gl:
            self._gl.wait()
            sums = np.frombuffer(self._sums.read(4 * self._steps * self._count), np.float32)
        return sums.reshape(self._steps, self._count).copy()
