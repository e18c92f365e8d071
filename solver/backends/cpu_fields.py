"""Fields in memory as the compiled loops read them: charts with halo, aligned to cache lines and pages."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..texels.irregular import NO_LINKS
from ..texels.stencil import Stencil
from ..texels.topology import TexelTopology
from .arguments import Halo, Links, Weights

# From this resolution on memory is what takes time, milliseconds a substep: several threads share out the charts, and
# rows lie close together. Below, where caches hold the fields, rows that begin with a cache line are a tenth faster.
LARGE = 512

# Below this resolution charts lie side by side, row by row: one loop then runs over a row of all of them. On charts of
# 12 columns, loops that begin anew for each take four times as long.
SMALL = 64

# Floats of a cache line, and of a page of memory.
LINE, PAGE = 16, 1024


class FieldLayout:
    """Charts [C, n + 2, pitch] float32, the texels from row 1 and column 1 on.

    Side by side, all charts with their halo are one, [1, n + 2, (C + 1)(n + 2)]: loops run over the halo between them
    too, where coefficients are 0, and what they leave there is filled again. The last n + 2 columns stay 0.

    Parameters
    ----------
    topology : TexelTopology
    alone : bool
        Whether small charts, too, lie one after the other.

    Attributes
    ----------
    n : int
        Texels along a chart's side.
    columns : int
        Columns that loops run over, from 1 on.
    addresses : int64 [C n^2]
        Address of every texel, by flat texel index.
    halo : Halo
        Addresses of the halo, and of the texels that it shows.
    """

    def __init__(self, topology: TexelTopology, *, alone: bool = False) -> None:
        self._charts, self.n, _ = topology.shape
        self._alone = alone or self.n >= SMALL or self._charts == 1
        width = self.n + 2
        if self._alone:
            self.columns, self._pitch = self.n, width if self.n >= LARGE else -(-width // LINE) * LINE
        else:
            self.columns, self._pitch = self._charts * width - 2, (self._charts + 1) * width
        table = topology.addresses
        self.addresses = self._address(table.texels)
        self.halo = Halo(self._address(table.ghosts), self._address(table.sources))
        if topology.fixed_rim and not self._alone:
            # loops run over these: they are set to 0 again
            beside = np.flatnonzero(topology.rim)
            beside = self._address(beside[(beside // width % width % (width - 1)) > 0])
            ghosts, sources = self.halo
            self.halo = Halo(
                np.concatenate([ghosts, beside]), np.append(sources, np.full(len(beside), self._pitch - 1))
            )

    def zeros(self, shift: int = 0) -> NDArray[np.float32]:
        """A field with halo; its first texel, or that of every row of a chart alone, begins a cache line."""
        return aligned((self._charts if self._alone else 1, self.n + 2, self._pitch), 1, shift)

    def coefficients(self, field: NDArray | np.float32) -> Any:
        """A field [C, n, n] as loops read it beside one with halo, [C, n, columns], 0 between charts; or a number."""
        if np.ndim(field) == 0:
            return field
        field = np.asarray(field)
        if self._alone:
            laid = aligned(field.shape, 0, dtype=field.dtype)
            laid[:] = field
            return laid
        spread = np.zeros((self.n, self._charts, self.n + 2), field.dtype)
        spread[:, :, 1:-1] = field.transpose(1, 0, 2)
        laid = aligned((1, self.n, self.columns), 0, dtype=field.dtype)
        laid[0] = spread.reshape(self.n, -1)[:, 1:-1]
        return laid

    @functools.cached_property
    def places(self) -> NDArray[np.int64]:
        """Flat index of every texel in its `coefficients`, [C n^2]."""
        row, column = np.divmod(self.addresses, self._pitch)
        chart, row = np.divmod(row, self.n + 2)
        return (chart * self.n + row - 1) * self.columns + column - 1

    def weights(self, stencil: Stencil) -> Weights:
        """A stencil laid out like a field, and its irregular links."""
        count = self._charts
        rows = aligned((count if self._alone else 1, 4, self.n + 1, self._pitch), 1)
        return self.fill(rows, stencil)

    def fill(self, rows: NDArray[np.float32], stencil: Stencil) -> Weights:
        """The same in the rows of another one, written over."""
        count = self._charts
        if self._alone:
            rows[..., : self.n + 1] = stencil.weights
        else:
            beside = rows.reshape(4, self.n + 1, count + 1, self.n + 2)
            beside[:, :, :count, : self.n + 1] = stencil.weights.transpose(1, 2, 0, 3)
        links = stencil.irregular if stencil.irregular is not None else NO_LINKS
        addresses = self.addresses
        return Weights(
            rows,
            self.columns,
            Links(
                self.places[links.texels],
                addresses[links.texels],
                links.begins,
                addresses[links.others],
                links.weights.astype(np.float32),
            ),
        )

    def texels(self, field: NDArray[np.float32]) -> NDArray[np.float32]:
        """The texels of a field, without halo: a view [C, n, n]."""
        if self._alone:
            return field[:, 1:-1, 1 : self.n + 1]
        beside = field.reshape(self.n + 2, self._charts + 1, self.n + 2)
        return beside[1:-1, : self._charts, 1:-1].transpose(1, 0, 2)

    def _address(self, address: NDArray[np.int64]) -> NDArray[np.int64]:
        """From an address in [C, n + 2, n + 2] to one in a field here."""
        row, column = np.divmod(address, self.n + 2)
        if self._alone:
            return row * self._pitch + column
        chart, row = np.divmod(row, self.n + 2)
        return row * self._pitch + chart * (self.n + 2) + column


def aligned(shape: tuple[int, ...], column: int, shift: int = 0, dtype: DTypeLike = np.float32) -> NDArray:
    """Zeros, of four bytes each, whose first row has the given column `shift` of them into a page."""
    size = int(np.prod(shape))
    memory = np.zeros(size + PAGE, dtype)
    start = (shift - column - memory.ctypes.data // memory.itemsize) % PAGE
    return memory[start : start + size].reshape(shape)
