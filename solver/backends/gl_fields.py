"""Fields in storage buffers: strips with a halo round each, cut from charts or of several charts, read by eights.

A field of texels that stays on the GPU: nothing is read back unless it is asked for.
"""

from __future__ import annotations

import functools
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ..gl import GLContext
from ..kernel import Floats, Floats32, Ints, kernel
from ..texels.stencil import NO_LINKS, IrregularLinks, Stencil
from ..texels.topology import TexelTopology

_GROUP = 256
_SHADERS = "ripple_sim.solver"


class DeviceField:
    """A frozen field [C, n, n] in a storage buffer, made by `gathered` or `blend`; `numpy.asarray` reads it back.

    Attributes
    ----------
    gl : GLContext
    shape : (C, n, n)
    buffer : moderngl.Buffer
        float32, chart by chart and row by row.
    """

    def __init__(
        self, gl: GLContext, shape: tuple[int, ...], shader: str, *sources: moderngl.Buffer, **uniforms: float
    ):
        self.gl, self.shape = gl, shape
        count = int(np.prod(shape))
        with gl as ctx:
            self.buffer: moderngl.Buffer = ctx.buffer(reserve=4 * count)
            self._peak = ctx.buffer(bytes(4))
            program = gl.shared_compute_shader(_SHADERS, f"backends/shaders/{shader}", GROUP=_GROUP)
            program["count"] = count
            for name, value in uniforms.items():
                program[name] = value
            for binding, buffer in enumerate((self.buffer, self._peak, *sources)):
                buffer.bind_to_storage_buffer(binding)
            program.run(-(-count // _GROUP))
            ctx.memory_barrier()
            self._fence = gl.put_fence()

    @classmethod
    def gathered(
        cls, gl: GLContext, shape: tuple[int, ...], addresses: moderngl.Buffer, *fields: moderngl.Buffer
    ) -> DeviceField:
        """One field, or the sum of two, by the address of every texel in them."""
        first, second = fields[0], fields[-1]
        return cls(gl, shape, "gather", addresses, first, second, share=float(len(fields) - 1))

    def blend(self, other: DeviceField, share: float) -> DeviceField:
        """The field a share of the way to another."""
        return DeviceField(self.gl, self.shape, "blend", self.buffer, other.buffer, share=share)

    @functools.cached_property
    def peak(self) -> float:
        """The largest size of a value; NaN if one is not a number. Waits until the field is there, for nothing else."""
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


# Floats that a thread reads at once. A strip's texels begin at this column, so that their eights are aligned; the halo
# is left of it.
EIGHT = 8

# Columns of a strip, at most. A group of threads side by side walks up a strip, so its reads follow one another in
# memory; on whole charts of 512 columns every row was a jump, and updates were half as many.
_STRIP = 64


class FieldLayout:
    """Strips of [N + 2, stride] float32, the texels from row 1 and column 8 on.

    Small charts lie side by side in a strip, each with its halo. Shaders run over the halo between them too, where
    coefficients are 0, and what they leave there is filled again.

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
        self._together = min(max(1, (_STRIP + 2) // (self.n + 2)), self._charts)
        self.strips = -(-self._charts // self._together) * self._chart_strips
        columns = self._together * (self.n + 2) - 2
        self.width = EIGHT * -(-columns // (EIGHT * self._chart_strips))
        self.stride = EIGHT + self.width + EIGHT
        self.eights = self.strips * (self.n + 2) * self.stride // EIGHT
        self.texels, ghosts, sources = self._addresses()
        self.halo_count = len(ghosts)
        with gl as ctx:
            pairs = np.stack([ghosts, sources], axis=1).astype(np.int32)
            # one chart within fixed rims has none
            self.halo_pairs = ctx.buffer(pairs.tobytes() or bytes(8))

    @functools.cached_property
    def texel_addresses(self) -> moderngl.Buffer:
        """`texels`, on the GPU."""
        with self._gl as ctx:
            return ctx.buffer(self.texels.astype(np.int32).tobytes())

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
        with self._gl as ctx:
            buffer = ctx.buffer(reserve=16 * EIGHT * self.eights)
        self.write_stencil(buffer, stencil)
        return buffer

    def write_stencil(self, buffer: moderngl.Buffer, stencil: Stencil) -> None:
        """Write another stencil over one that was uploaded."""
        places = self._stencil_scratch
        for block, first, _ in self._places:
            _lay_out(stencil.weights, block, first, places)
        with self._gl:
            buffer.write(places)

    @functools.cached_property
    def _stencil_scratch(self) -> NDArray[np.float32]:
        return np.zeros((EIGHT * self.eights, 4), np.float32)

    @functools.cached_property
    def _places(self) -> list[tuple[NDArray[np.int64], int, int]]:
        return [(np.ascontiguousarray(block), first, last) for block, first, last in self._blocks()]

    def link_addresses(self) -> NDArray[np.int64]:
        """Pairs [k, 2]: a place of [C, n + 2, n + 2], and where the links that start there lie in a stencil."""
        charts, n = self._charts, self.n
        places = np.arange(charts * (n + 2) ** 2).reshape(charts, n + 2, n + 2)[:, :-1, :-1]
        pairs = [
            np.stack([places[:, :, first : last + 1], block[:, :-1, :-1] + 1], axis=-1).reshape(-1, 2)
            for block, first, last in self._places
        ]
        return np.concatenate(pairs)

    def read(self, buffer: moderngl.Buffer) -> NDArray[np.float32]:
        """A field's texels, [C, n, n]."""
        with self._gl:
            self._gl.wait()
            places = np.frombuffer(buffer.read(), np.float32)
        return places[self.texels].reshape(self._topology.shape)

    def write(self, buffer: moderngl.Buffer, field: NDArray[np.float32]) -> None:
        """Replace a field's texels; the halo becomes 0."""
        with self._gl:
            buffer.write(self._pack(field))

    def _pack(self, *fields: NDArray | np.float32) -> bytes:
        packed = np.zeros((len(fields), EIGHT * self.eights), np.float32)
        for places, field in zip(packed, fields, strict=True):
            places[self.texels] = np.broadcast_to(field, self._topology.shape).reshape(-1)
        return packed.tobytes()

    def _blocks(self) -> list[tuple[NDArray[np.int64], int, int]]:
        """Addresses of charts with halo, [C, n + 2, k + 2], for columns from a first one to before a last."""
        n, place = self.n, np.arange(EIGHT * self.eights)
        if self._chart_strips == 1:
            beside = place.reshape(self.strips, n + 2, self.stride)[..., EIGHT - 1 :][..., : self._together * (n + 2)]
            charts = beside.reshape(self.strips, n + 2, self._together, n + 2).swapaxes(1, 2)
            return [(charts.reshape(-1, n + 2, n + 2)[: self._charts], 0, n)]
        strips = place.reshape(self._charts, self._chart_strips, n + 2, self.stride)
        ends = [(s * self.width, min((s + 1) * self.width, n)) for s in range(self._chart_strips)]
        return [
            (strips[:, s, :, EIGHT - 1 : EIGHT + last - first + 1], first, last) for s, (first, last) in enumerate(ends)
        ]

    def _addresses(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Where each texel lies, each place of the halo that is to be filled, and what with: texels, or a 0."""
        topology, blocks = self._topology, self._blocks()
        texels = np.empty(topology.shape, np.int64)
        for block, first, last in blocks:
            texels[:, :, first:last] = block[:, 1:-1, 1:-1]
        ghosts, sources = [], []
        for block, first, last in blocks:
            columns = slice(first, last + 2)
            own = np.zeros(block.shape, bool)
            own[:, 1:-1, 1:-1] = True
            exists = ~own & (topology.ghosts | topology.own)[:, :, columns]
            ghosts.append(block[exists])
            sources.append(texels.reshape(-1)[topology.halo[:, :, columns][exists]])
            if self._together > 1 and topology.fixed_rim:
                ghosts.append(block[topology.rim])
                sources.append(np.zeros_like(ghosts[-1]))  # the first place, which nothing writes to
        return texels.reshape(-1), np.concatenate(ghosts), np.concatenate(sources)


class LinkBuffers:
    """The irregular links of a stencil, with the addresses of their ends.

    Parameters
    ----------
    links : IrregularLinks or None
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

    def __init__(self, gl: GLContext, fields: FieldLayout, links: IrregularLinks | None, factors: NDArray) -> None:
        irregular = links if links is not None else NO_LINKS
        self.count = len(irregular.texels)
        scale = np.repeat(factors.reshape(-1)[irregular.texels], np.diff(irregular.begins))
        texels = [fields.texels[irregular.texels], irregular.begins[:-1], irregular.begins[1:]]
        bits = (scale * irregular.weights).astype(np.float32).view(np.int32)
        others = np.stack([fields.texels[irregular.others].astype(np.int32), bits], axis=1)
        with gl as ctx:
            self.texels = ctx.buffer(np.stack(texels, axis=1).astype(np.int32).tobytes() or bytes(4))
            self.links = ctx.buffer(others.tobytes() or bytes(4))


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


@kernel
def _lay_out(weights: Floats, block: Ints, first: int, places: Floats32) -> None:
    """Write the four links of every place of a block's columns, from a first one on, at its address and one."""
    charts, rows, columns = block.shape
    for chart in range(charts):
        for r in range(rows - 1):
            for c in range(columns - 1):
                for link in range(4):
                    places[block[chart, r, c] + 1, link] = weights[chart, link, r, first + c]
