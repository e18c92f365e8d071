"""Fields in storage buffers: faces cut into strips with a ring round each, laid out to be read by eights."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.gl import GLContext
from ripple_sim.solver.texels.cube_map.convention import padded_indices

# Floats that a thread reads at once. A strip's texels begin at this column, so that their eights are aligned; the ring
# is left of it.
EIGHT = 8

# Columns of a strip, at most. A group of threads side by side walks up a strip, so its reads follow one another in
# memory; on whole faces of 512 columns every row was a jump, and updates were half as many.
_STRIP = 64


class FieldLayout:
    """Strips of [N + 2, stride] float32, the texels from row 1 and column 8 on.

    Attributes
    ----------
    n, width, stride, strips, eights : int
        Texels along a face's edge; columns and floats in a strip's row; strips of all faces; eights of floats in a
        whole field.
    inside : int64 [6 N^2]
        Address of every texel, by flat texel index.
    ring_pairs : moderngl.Buffer
        (place in the ring of a strip, texel it shows), `ring_count` of them.
    """

    def __init__(self, gl: GLContext, resolution: int) -> None:
        self._gl = gl
        self.n = n = resolution
        self._face_strips = -(-n // _STRIP)
        self.strips = 6 * self._face_strips
        self.width = EIGHT * -(-n // (EIGHT * self._face_strips))
        self.stride = EIGHT + self.width + EIGHT
        self.eights = self.strips * (n + 2) * self.stride // EIGHT
        self.inside, ring, source = self._addresses()
        self.ring_count = len(ring)
        with gl as ctx:
            self.ring_pairs = ctx.buffer(np.stack([ring, source], axis=1).astype(np.int32).tobytes())

    def zeros(self) -> moderngl.Buffer:
        """A field of zeros."""
        with self._gl as ctx:
            return ctx.buffer(bytes(4 * EIGHT * self.eights))

    def upload(self, *fields: NDArray | np.float32) -> moderngl.Buffer:
        """Fields [6, N, N], or numbers, one after the other, with zeros round them."""
        with self._gl as ctx:
            return ctx.buffer(self._pack(*fields))

    def upload_stencil(self, stencil: NDArray[np.float64]) -> moderngl.Buffer:
        """The four links of a stencil that start in each place, side by side.

        A column further to the right than the field: what a thread reads begins with the links of its west neighbours.
        """
        places = self._empty(4)
        for strip, first, last in self._columns():
            cells = stencil[..., first : last + 1]
            places[:, strip, : self.n + 1, EIGHT : EIGHT + cells.shape[-1]] = np.moveaxis(cells, 1, -1)
        with self._gl as ctx:
            return ctx.buffer(places.tobytes())

    def read(self, buffer: moderngl.Buffer) -> NDArray[np.float32]:
        """A field's texels, [6, N, N]."""
        with self._gl:
            self._gl.wait()
            places = np.frombuffer(buffer.read(), np.float32).reshape(6, self._face_strips, self.n + 2, self.stride)
        texels = np.empty((6, self.n, self.n), np.float32)
        for strip, first, last in self._columns():
            texels[:, :, first:last] = places[:, strip, 1:-1, EIGHT : EIGHT + last - first]
        return texels

    def write(self, buffer: moderngl.Buffer, field: NDArray[np.float32]) -> None:
        """Replace a field's texels; the ring becomes 0."""
        with self._gl:
            buffer.write(self._pack(field))

    def _pack(self, *fields: NDArray | np.float32) -> bytes:
        packed = np.stack([self._empty(1)] * len(fields))
        for places, field in zip(packed, fields, strict=True):
            for strip, first, last in self._columns():
                texels = np.broadcast_to(field, (6, self.n, self.n))[:, :, first:last]
                places[:, strip, 1:-1, EIGHT : EIGHT + last - first, 0] = texels
        return packed.tobytes()

    def _empty(self, components: int) -> NDArray[np.float32]:
        return np.zeros((6, self._face_strips, self.n + 2, self.stride, components), np.float32)

    def _columns(self) -> list[tuple[int, int, int]]:
        """(strip of a face, its first column, one after its last)."""
        return [(s, s * self.width, min((s + 1) * self.width, self.n)) for s in range(self._face_strips)]

    def _addresses(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Where each texel lies, each place of a ring, and the texel that it shows."""
        n = self.n
        place = np.arange(EIGHT * self.eights).reshape(6, self._face_strips, n + 2, self.stride)
        inside = np.empty((6, n, n), np.int64)
        for strip, first, last in self._columns():
            inside[:, :, first:last] = place[:, strip, 1:-1, EIGHT : EIGHT + last - first]
        shown = padded_indices(n)
        ring, source = [], []
        for strip, first, last in self._columns():
            columns = slice(first, last + 2)
            own = np.zeros((6, n + 2, last + 2 - first), bool)
            own[:, 1:-1, 1:-1] = True
            exists = ~own & (shown[:, :, columns] >= 0)
            ring.append(place[:, strip, :, EIGHT - 1 : EIGHT + last - first + 1][exists])
            source.append(inside.reshape(-1)[shown[:, :, columns][exists]])
        return inside.reshape(-1), np.concatenate(ring), np.concatenate(source)


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
                self._room = 2 * self.count
                self._reserve()
            if self.count:
                self.places.write(places.astype(np.int32).tobytes())
                self.values.write(values.astype(np.float32).tobytes())

    def _reserve(self) -> None:
        with self._gl as ctx:
            self.places, self.values = ctx.buffer(reserve=4 * self._room), ctx.buffer(reserve=4 * self._room)
