"""The pressure on each part of the surface, in storage buffers; see `VolumeRate`."""

from __future__ import annotations

import itertools

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..gl import GLContext
from ..operator.volume import VolumeRate
from ..operator.wave_operator import WaveOperator
from .arguments import Amplitude
from .gl_dispatch import Dispatch
from .gl_fields import FieldLayout

# Entries of a list that one group of threads adds up.
_CHUNK = 2048


class Pressure:
    """Amplitudes of the operator's response, one for each part.

    Attributes
    ----------
    parts : moderngl.Buffer
        A field with the number of each texel's part.
    amplitudes : moderngl.Buffer
        One number for each part.
    """

    def __init__(self, gl: GLContext, fields: FieldLayout, operator: WaveOperator) -> None:
        numbers = np.zeros(operator.mass.shape, np.int32) if operator.parts is None else operator.parts
        self._gl, self._fields, self._count = gl, fields, int(numbers.max()) + 1
        self.parts = fields.upload(numbers)
        with gl as ctx:
            self.amplitudes = ctx.buffer(reserve=4 * self._count)

    def set(self, amplitude: Amplitude) -> None:
        """Write the amplitudes: a number, or one for each part."""
        with self._gl:
            self.amplitudes.write(np.full(self._count, amplitude, np.float32).tobytes())


class VolumeKeeper(Pressure):
    """Amplitudes that follow height and velocity, so that the volume stays."""

    def __init__(
        self, gl: GLContext, fields: FieldLayout, operator: WaveOperator, dispatch: Dispatch, rate: VolumeRate
    ) -> None:
        super().__init__(gl, fields, operator)
        self._dispatch = dispatch
        velocities = rate.velocities if len(rate.velocities) else np.zeros_like(rate.heights)
        chunks, begins = _chunks(rate.begins)
        self._chunk_count = len(chunks)
        with gl as ctx:
            self._addresses = ctx.buffer(fields.texels[rate.texels].astype(np.int32).tobytes())
            self._factors = ctx.buffer(np.stack([rate.heights, velocities], axis=1).tobytes())
            self._chunks = ctx.buffer(chunks.astype(np.int32).tobytes())
            self._begins = ctx.buffer(begins.astype(np.int32).tobytes())
            self._sums, self._loaded = ctx.buffer(reserve=4 * len(chunks)), ctx.buffer(reserve=4 * self._count)
        self._weigh, self._balance = dispatch.shader("weigh"), dispatch.shader("balance")

    def set(self, amplitude: Amplitude) -> None:
        """Write what the load asks for."""
        with self._gl:
            self._loaded.write(np.full(self._count, amplitude, np.float32).tobytes())

    def follow(self, height: moderngl.Buffer, velocity: moderngl.Buffer) -> None:
        """Set the amplitudes of the coming substep."""
        self._dispatch.bind(height, velocity, self._addresses, self._factors, self._chunks, self._sums)
        self._dispatch.run_groups(self._weigh, self._chunk_count)
        self._balance["count"] = self._count
        self._dispatch.bind(self._loaded, self._sums, self._begins, self.amplitudes)
        self._dispatch.run_list(self._balance, self._count)


def _chunks(begins: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cut the entries of each part into chunks: first and one after the last of each; where those of a part begin."""
    bounds = [np.append(np.arange(first, last, _CHUNK), last) for first, last in itertools.pairwise(begins)]
    chunks = [np.stack([each[:-1], each[1:]], axis=1) for each in bounds]
    return np.concatenate(chunks), np.cumsum([0, *map(len, chunks)])
