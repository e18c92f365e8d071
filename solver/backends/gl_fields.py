"""Fields in storage buffers: charts cut into strips with a halo round each, laid out to be read by eights."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.gl import GLContext
from ripple_sim.solver.texels.irregular import NO_LINKS
from ripple_sim.solver.texels.stencil import Stencil
from ripple_sim.solver.texels.topology import TexelTopology

# Floats that a thread reads at once. A strip's texels begin at this column, so that their eights are aligned; the halo
# is left of it.
EIGHT = 8

# Columns of a strip, at most. A group of threads side by side walks up a strip, so its reads follow one another in
# memory; on whole charts of 512 columns every row was a jump, and updates were half as many.
_STRIP = 64


class FieldLayout:
    """Strips of [N + 2, stride] float32, the texels from row 1 and column 8 on.

    Attributes
    ----------
    n, width, stride, strips, eights : int
        Texels along a chart's side; columns and floats in a strip's row; strips of all charts; eights of floats in a
        whole field.
    texels : int64 [C n^2]
        Address of every texel, by flat texel index.
    halo_pairs : moderngl.Buffer
        (place in the halo of a strip, texel it shows), `halo_count` of them.
    """

    def __init__(self, gl: GLContext, topology: TexelTopology) -> None:
        self._gl = gl
        self._topology = topology
        self._charts, self.n, _ = topology.shape
        self._chart_strips = -(-self.n // _STRIP)
        self.strips = self._charts * self._chart_strips
        self.width = EIGHT * -(-self.n // (EIGHT * self._chart_strips))
        self.stride = EIGHT + self.width + EIGHT
        self.eights = self.strips * (self.n + 2) * self.stride // EIGHT
        self.texels, ghosts, sources = self._addresses()
        self.halo_count = len(ghosts)
        with gl as ctx:
            pairs = np.stack([ghosts, sources], axis=1).astype(np.int32)
            # one chart within fixed rims has none
            self.halo_pairs = ctx.buffer(pairs.tobytes() or bytes(8))

    def zeros(self) -> moderngl.Buffer:
        """A field of zeros."""
        with self._gl as ctx:
            return ctx.buffer(bytes(4 * EIGHT * self.eights))

    def upload(self, *fields: NDArray | np.float32) -> moderngl.Buffer:
        """Fields [C, n, n], or numbers, one after the other, with zeros round them."""
        with self._gl as ctx:
            return ctx.buffer(self._pack(*fields))

    def upload_stencil(self, stencil: Stencil) -> moderngl.Buffer:
        """The four links of a stencil that start in each place, side by side.

        A column further to the right than the field: what a thread reads begins with the links of its west neighbours.
        """
        places = self._empty(4)
        for strip, first, last in self._columns():
            cells = stencil.weights[..., first : last + 1]
            places[:, strip, : self.n + 1, EIGHT : EIGHT + cells.shape[-1]] = np.moveaxis(cells, 1, -1)
        with self._gl as ctx:
            return ctx.buffer(places.tobytes())

    def read(self, buffer: moderngl.Buffer) -> NDArray[np.float32]:
        """A field's texels, [C, n, n]."""
        with self._gl:
            self._gl.wait()
            places = np.frombuffer(buffer.read(), np.float32).reshape(
                self._charts, self._chart_strips, self.n + 2, self.stride
            )
        texels = np.empty(self._topology.shape, np.float32)
        for strip, first, last in self._columns():
            texels[:, :, first:last] = places[:, strip, 1:-1, EIGHT : EIGHT + last - first]
        return texels

    def write(self, buffer: moderngl.Buffer, field: NDArray[np.float32]) -> None:
        """Replace a field's texels; the halo becomes 0."""
        with self._gl:
            buffer.write(self._pack(field))

    def _pack(self, *fields: NDArray | np.float32) -> bytes:
        packed = np.stack([self._empty(1)] * len(fields))
        for places, field in zip(packed, fields, strict=True):
            for strip, first, last in self._columns():
                texels = np.broadcast_to(field, self._topology.shape)[:, :, first:last]
                places[:, strip, 1:-1, EIGHT : EIGHT + last - first, 0] = texels
        return packed.tobytes()

    def _empty(self, components: int) -> NDArray[np.float32]:
        return np.zeros((self._charts, self._chart_strips, self.n + 2, self.stride, components), np.float32)

    def _columns(self) -> list[tuple[int, int, int]]:
        """(strip of a chart, its first column, one after its last)."""
        return [(s, s * self.width, min((s + 1) * self.width, self.n)) for s in range(self._chart_strips)]

    def _addresses(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Where each texel lies, each place of the halo that shows a texel, and that texel."""
        n = self.n
        place = np.arange(EIGHT * self.eights).reshape(self._charts, self._chart_strips, n + 2, self.stride)
        texels = np.empty(self._topology.shape, np.int64)
        for strip, first, last in self._columns():
            texels[:, :, first:last] = place[:, strip, 1:-1, EIGHT : EIGHT + last - first]
        shown = self._topology.halo
        ghosts, sources = [], []
        for strip, first, last in self._columns():
            columns = slice(first, last + 2)
            own = np.zeros((self._charts, n + 2, last + 2 - first), bool)
            own[:, 1:-1, 1:-1] = True
            exists = ~own & (self._topology.ghosts | self._topology.own)[:, :, columns]
            ghosts.append(place[:, strip, :, EIGHT - 1 : EIGHT + last - first + 1][exists])
            sources.append(texels.reshape(-1)[shown[:, :, columns][exists]])
        return texels.reshape(-1), np.concatenate(ghosts), np.concatenate(sources)


class LinkBuffers:
    """The irregular links of a stencil, with the addresses of their ends.

    Parameters
    ----------
    factors : [C, n, n]
        By which the forces on each texel are multiplied.

    Attributes
    ----------
    count : int
        Texels that have any.
    texels, links : moderngl.Buffer
        (address, first link, one after its last) of each such texel, and the address of each link's other end with the
        bits of its weight.
    """

    def __init__(self, gl: GLContext, fields: FieldLayout, stencil: Stencil, factors: NDArray) -> None:
        irregular = stencil.irregular if stencil.irregular is not None else NO_LINKS
        self.count = len(irregular.texels)
        scale = np.repeat(factors.reshape(-1)[irregular.texels], np.diff(irregular.begins))
        texels = [fields.texels[irregular.texels], irregular.begins[:-1], irregular.begins[1:]]
        bits = (scale * irregular.weights).astype(np.float32).view(np.int32)
        links = np.stack([fields.texels[irregular.others].astype(np.int32), bits], axis=1)
        with gl as ctx:
            self.texels = ctx.buffer(np.stack(texels, axis=1).astype(np.int32).tobytes() or bytes(4))
            self.links = ctx.buffer(links.tobytes() or bytes(4))


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
