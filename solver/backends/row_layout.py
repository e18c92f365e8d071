"""`RowLayout`: how fields lie in memory on the CPU, for loops over long rows."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..operator.curvatures import STEPS, Curvatures
from ..operator.wave_operator import WaveOperator
from ..texels.stencil import Stencil
from ..texels.topology import TexelTopology
from .curvature_kernels import BLOCK, Squares
from .stencil_kernels import Links, Weights

# Below this resolution [texels along a side] charts lie side by side, row by row: one loop then
# runs over a row of all charts. On charts of 12 columns, a loop for each chart takes four times as
# long.
_MAX_JOINED_RESOLUTION = 64

_LINE_FLOATS = 16  # float32 in a cache line of 64 bytes
_PAGE_FLOATS = 1024  # float32 in a page of 4096 bytes


class RowLayout:
    """Charts [C, n + 2, pitch] float32, the texels from row 1 and column 1 on.

    Side by side, all charts with their halo are one, [1, n + 2, (C + 1)(n + 2)]: loops run over the
    halo between them too, where coefficients are 0, and what they leave there is filled again. The
    last n + 2 columns stay 0.

    Attributes
    ----------
    n : int
        Texels along a chart's side.
    columns : int
        Columns that loops run over, from 1 on.
    addresses : int64 [C n^2]
        Address of every texel, by flat texel index.
    halo : int64 [2, k]
        Addresses of the halo's places, and of the texels that they show.
    """

    def __init__(self, topology: TexelTopology) -> None:
        self._charts, self.n, _ = topology.shape
        self._alone = self.n >= _MAX_JOINED_RESOLUTION or self._charts == 1
        width = self.n + 2
        if self._alone:
            self.columns = self.n
            self._pitch = -(-width // _LINE_FLOATS) * _LINE_FLOATS
        else:
            self.columns = self._charts * width - 2
            self._pitch = (self._charts + 1) * width
        texels, ghosts, sources = topology.addresses
        self.addresses = self._address(texels)
        self.halo = np.stack([self._address(ghosts), self._address(sources)])
        if topology.fixed_rim and not self._alone:
            # loops run over the rim's places beside the charts: they are set to 0 again
            rim = np.flatnonzero(topology.rim)
            row = rim // width % width
            beside = self._address(rim[row % (width - 1) > 0])
            always_zero = np.full(len(beside), self._pitch - 1)
            self.halo = np.append(self.halo, [beside, always_zero], axis=1)

    def zeros(self, shift: int = 0) -> NDArray[np.float32]:
        """A field of zeros with halo.

        The first texel begins a cache line; where charts do not lie side by side, the first texel
        of every row does.
        """
        return aligned((self._charts if self._alone else 1, self.n + 2, self._pitch), 1, shift)

    def staggered_zeros(self, count: int) -> list[NDArray[np.float32]]:
        """Fields of zeros that are used together, each beginning elsewhere in its page of memory.

        The processor takes a store to one field and a load from another at the same place of a page
        for a conflict.
        """
        shifts = (i * _PAGE_FLOATS // count // _LINE_FLOATS * _LINE_FLOATS for i in range(count))
        return [self.zeros(shift) for shift in shifts]

    def coefficients(self, field: NDArray | np.float32) -> Any:
        """A field [C, n, n] as loops read it beside a field with halo, or a number as it is.

        It is flat, [C n columns], and 0 between the charts.
        """
        if np.ndim(field) == 0:
            return field
        field = np.asarray(field)
        laid = aligned(
            field.shape if self._alone else (1, self.n, self.columns), 0, dtype=field.dtype
        )
        if not self._alone:
            beside = np.zeros((self.n, self._charts, self.n + 2), field.dtype)
            beside[:, :, 1:-1] = field.transpose(1, 0, 2)
            field = beside.reshape(self.n, -1)[:, 1:-1]
        laid[:] = field
        return laid.reshape(-1)

    @functools.cached_property
    def places(self) -> NDArray[np.int64]:
        """Flat index of every texel in its `coefficients`, [C n^2]."""
        row, column = np.divmod(self.addresses, self._pitch)
        chart, row = np.divmod(row, self.n + 2)
        return (chart * self.n + row - 1) * self.columns + column - 1

    def weights(self, stencil: Stencil, rows: NDArray[np.float32]) -> Weights:
        """A stencil laid out like a field; `rows` of an earlier stencil are used again, if any."""
        count = self._charts
        if not rows.size:
            rows = aligned((count if self._alone else 1, 4, self.n + 1, self._pitch), 1)
        if self._alone:
            rows[..., : self.n + 1] = stencil.weights
        else:
            beside = rows.reshape(4, self.n + 1, count + 1, self.n + 2)
            beside[:, :, :count, : self.n + 1] = stencil.weights.transpose(1, 2, 0, 3)
        links = stencil.irregular
        irregular = Links(
            texels=self.places[links.texels],
            addresses=self.addresses[links.texels],
            begins=links.begins,
            others=self.addresses[links.others],
            weights=links.weights.astype(np.float32),
            ends=np.zeros(len(links.others), np.float32),
        )
        return Weights(rows, self.columns, irregular)

    def squares(self, bending: Curvatures) -> Squares:
        """Weights of curvatures laid out like coefficients, and room for their forces."""
        weights_of_neighbours = []
        for weights_of_kinds in bending.weights.astype(np.float32).swapaxes(0, 1):
            weights_of_neighbours.append(
                np.stack([self.coefficients(weight) for weight in weights_of_kinds])
            )
        weights = np.stack(weights_of_neighbours)
        return Squares(
            weights=weights,
            steps=np.array([row * self._pitch + column for row, column in STEPS]),
            rows=weights.shape[-1] // self.columns,
            chart_rows=self.n,
            columns=self.columns,
            pitch=self._pitch,
            force=self.zeros().reshape(-1),
            scratch=np.zeros((4, BLOCK), np.float32),
        )

    def texels(self, field: NDArray[np.float32]) -> NDArray[np.float32]:
        """The texels of a field, without halo: a view [C, n, n]."""
        if self._alone:
            return field[:, 1:-1, 1 : self.n + 1]
        beside = field.reshape(self.n + 2, self._charts + 1, self.n + 2)
        return beside[1:-1, : self._charts, 1:-1].transpose(1, 0, 2)

    def read(self, field: NDArray[np.float32]) -> NDArray[np.float32]:
        """Copy of a field's texels, [C, n, n]."""
        return self.texels(field).copy()

    def write(self, field: NDArray[np.float32], values: NDArray | np.float32) -> None:
        """Replace a field's texels; all other places become 0, also where they were not numbers."""
        field[:] = 0
        self.texels(field)[:] = values

    def _address(self, address: NDArray[np.int64]) -> NDArray[np.int64]:
        """From an address in [C, n + 2, n + 2] to one in a field here."""
        row, column = np.divmod(address, self.n + 2)
        if self._alone:
            return row * self._pitch + column
        chart, row = np.divmod(row, self.n + 2)
        return row * self._pitch + chart * (self.n + 2) + column


def aligned(
    shape: tuple[int, ...], column: int, shift: int = 0, dtype: DTypeLike = np.float32
) -> NDArray:
    """Zeros of four bytes each; `column` of the first row is `shift` numbers into a page."""
    size = int(np.prod(shape))
    memory = np.zeros(size + _PAGE_FLOATS, dtype)
    start = (shift - column - memory.ctypes.data // memory.itemsize) % _PAGE_FLOATS
    return memory[start : start + size].reshape(shape)


def part_runs(
    operator: WaveOperator, fields: RowLayout
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Runs of texels of one part in coefficients: where each begins [k + 1], and its part [k]."""
    parts = np.zeros(operator.mass.shape, np.int32) if operator.parts is None else operator.parts
    beside = fields.coefficients(parts)
    begins = np.flatnonzero(np.diff(beside, prepend=-1))
    return np.append(begins, beside.size), beside[begins].astype(np.int64)
