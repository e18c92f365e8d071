"""Compute shaders of the waves: compiled for a layout of fields, bound to buffers, and run over texels or lists.

`Pressure` holds the pressure on each part of the surface in storage buffers; see `volume_rate`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..gl import GLContext
from ..operator.volume import VolumeRate
from ..operator.wave_operator import WaveOperator
from .gl_fields import FieldLayout, bind_buffers
from .kernels import Amplitude, Probes

# Threads of a group that works through a list.
_GROUP = 64


class Dispatch:
    """Runs the shaders in `shaders/` on fields of one layout."""

    def __init__(self, gl: GLContext, fields: FieldLayout) -> None:
        self._gl = gl
        self._fields = fields
        self._halo = self.shader("halo")

    def shader(self, name: str, **defines: float) -> moderngl.ComputeShader:
        """A shader that runs over a list."""
        return self._gl.compute_shader("ripple_sim.solver.backends.shaders", name, GROUP=_GROUP, **defines)

    def texel_shader(self, name: str, **defines: int) -> moderngl.ComputeShader:
        """A shader that runs over all texels, see charts.glsl."""
        return self.shader(name, N=self._fields.n, **defines)

    def run_texels(self, shader: moderngl.ComputeShader) -> None:
        """Run a shader over all texels."""
        self.run_list(shader, self._fields.count)

    def run_list(self, shader: moderngl.ComputeShader, count: int) -> None:
        """Run a shader over a list of so many entries, of which it is told."""
        shader["count"] = count
        shader.run(-(-count // _GROUP))
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

    Attributes
    ----------
    follow : callable or None
        With a `rate`: sets the amplitudes of the coming substep by its height and velocity, so that the volume stays.
    """

    def __init__(
        self, gl: GLContext, fields: FieldLayout, operator: WaveOperator, dispatch: Dispatch,
        rate: VolumeRate | None = None,
    ) -> None:  # fmt: skip
        numbers = np.zeros(operator.mass.shape, np.int32) if operator.parts is None else operator.parts
        self._gl, self._count = gl, int(numbers.max()) + 1
        self.parts = fields.upload(numbers)
        with gl as ctx:
            self._asked = ctx.buffer(reserve=4 * self._count)
            self.amplitudes = self._asked if rate is None else ctx.buffer(reserve=4 * self._count)
        self.follow = None if rate is None else self._following(rate, fields, dispatch)

    def set(self, amplitude: Amplitude) -> None:
        """Write what the load asks for: a number, or one for each part."""
        with self._gl:
            self._asked.write(np.full(self._count, amplitude, np.float32).tobytes())

    def _following(
        self, rate: VolumeRate, fields: FieldLayout, dispatch: Dispatch
    ) -> Callable[[moderngl.Buffer, moderngl.Buffer], None]:
        begins, texels, heights, velocities = rate
        chunks, bounds = _chunks(begins)
        tables = (
            fields.texels[texels].astype(np.int32),
            np.stack([heights, velocities if len(velocities) else np.zeros_like(heights)], axis=1),
            *(each.astype(np.int32) for each in (chunks, bounds)),
        )
        with self._gl as ctx:
            *entries, first = (ctx.buffer(each.tobytes()) for each in tables)
            sums = ctx.buffer(reserve=4 * len(chunks))
        weigh, balance = dispatch.shader("volume"), dispatch.shader("volume", PARTS=1)
        # by themselves: a circle with `self` would keep buffers until Python looks for garbage
        gl, asked, amplitudes, count = self._gl, self._asked, self.amplitudes, self._count

        def follow(height: moderngl.Buffer, velocity: moderngl.Buffer) -> None:
            bind_buffers(height, velocity, *entries, sums)
            weigh.run(len(chunks))
            gl.barrier()
            bind_buffers(asked, sums, first, amplitudes)
            dispatch.run_list(balance, count)

        return follow


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
