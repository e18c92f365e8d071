"""Fields in storage buffers: faces with a ring round them, laid out to be read by fours."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..atlas.padding import padded_addresses
from ..gl import GLContext

# A face's texels begin at this column, so that fours of them are aligned; the ring is left of it.
_FIRST = 4


class FieldLayout:
    """Faces of [N + 2, stride] float32, the texels from row 1 and column 4 on.

    Attributes
    ----------
    n, stride, quads : int
        Texels along an edge; floats in a row; fours of floats in a whole field.
    inside : int64 [6 N^2]
        Address of every texel, by flat texel index.
    ring_pairs : moderngl.Buffer
        (place in the ring, texel it shows), `ring_count` of them.
    """

    def __init__(self, gl: GLContext, resolution: int) -> None:
        self._gl = gl
        self.n = n = resolution
        # room for the ring on both sides, and for the fours that hang over where N is no multiple of four
        self.stride = _FIRST + 4 * (-(-n // 4)) + 4
        self.quads = 6 * (n + 2) * self.stride // 4
        inside, ring, source = (self._address(places) for places in padded_addresses(n))
        self.inside = inside
        self.ring_count = len(ring)
        with gl as ctx:
            self.ring_pairs = ctx.buffer(np.stack([ring, source], axis=1).astype(np.int32).tobytes())

    def zeros(self) -> moderngl.Buffer:
        """A field of zeros."""
        with self._gl as ctx:
            return ctx.buffer(bytes(16 * self.quads))

    def upload(self, field: NDArray) -> moderngl.Buffer:
        """A field [6, N, N] with zeros round it."""
        with self._gl as ctx:
            return ctx.buffer(self.pack(field))

    def upload_stencil(self, stencil: NDArray[np.float64]) -> moderngl.Buffer:
        """The four links of a stencil that start in each place, side by side."""
        places = np.zeros((6, self.n + 2, self.stride, 4), np.float32)
        places[:, : self.n + 1, _FIRST - 1 : _FIRST + self.n] = np.moveaxis(stencil, 1, -1)
        with self._gl as ctx:
            return ctx.buffer(places.tobytes())

    def pack(self, *fields: NDArray | np.float32) -> bytes:
        """Fields [6, N, N], or numbers, one after the other."""
        packed = np.zeros((len(fields), 6, self.n + 2, self.stride), np.float32)
        for place, field in zip(packed, fields, strict=True):
            self._texels(place)[:] = field
        return packed.tobytes()

    def read(self, buffer: moderngl.Buffer) -> NDArray[np.float32]:
        """A field's texels, [6, N, N]."""
        with self._gl:
            padded = np.frombuffer(buffer.read(), np.float32).reshape(6, self.n + 2, self.stride)
        return self._texels(padded).copy()

    def write(self, buffer: moderngl.Buffer, field: NDArray[np.float32]) -> None:
        """Replace a field's texels; the ring becomes 0."""
        with self._gl:
            buffer.write(self.pack(field))

    def _texels(self, padded: NDArray[np.float32]) -> NDArray[np.float32]:
        return padded[:, 1:-1, _FIRST : _FIRST + self.n]

    def _address(self, padded: NDArray[np.int64]) -> NDArray[np.int64]:
        """From an address in [6, N + 2, N + 2] to one in this layout."""
        row, column = np.divmod(padded, self.n + 2)
        return row * self.stride + column + _FIRST - 1


class TexelList:
    """Places in a field and a number for each, in buffers that grow when they must."""

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
