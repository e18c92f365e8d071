"""Fields in memory as the compiled loops read them: charts with halo, aligned to cache lines and pages."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.texels.irregular import NO_LINKS
from ripple_sim.solver.texels.stencil import Stencil
from ripple_sim.solver.texels.topology import TexelTopology

from .arguments import Halo, Links, Weights

# From this resolution on memory is what takes time, milliseconds a substep: several threads share out the charts, and
# rows lie close together. Below, where caches hold the fields, rows that begin with a cache line are a tenth faster.
LARGE = 512

# Floats of a cache line, and of a page of memory.
LINE, PAGE = 16, 1024


class FieldLayout:
    """Charts [C, n + 2, pitch] float32, the texels from row 1 and column 1 on.

    Attributes
    ----------
    n : int
        Texels along a chart's side.
    addresses : int64 [C n^2]
        Address of every texel, by flat texel index.
    halo : Halo
        Addresses of the halo, and of the texels that it shows.
    """

    def __init__(self, topology: TexelTopology) -> None:
        self._charts, self.n, _ = topology.shape
        self._pitch = self.n + 2 if self.n >= LARGE else -(-(self.n + 2) // LINE) * LINE
        table = topology.addresses
        self.addresses = self._address(table.texels)
        self.halo = Halo(self._address(table.ghosts), self._address(table.sources))

    def zeros(self, shift: int = 0) -> NDArray[np.float32]:
        """A field with halo [C, n + 2, pitch]; its first texel, or that of every row, begins a cache line."""
        return aligned((self._charts, self.n + 2, self._pitch), 1, shift)

    def weights(self, stencil: Stencil) -> Weights:
        """A stencil laid out like a field, and its irregular links."""
        rows = aligned((self._charts, 4, self.n + 1, self._pitch), 1)
        rows[..., : self.n + 1] = stencil.weights
        links = stencil.irregular if stencil.irregular is not None else NO_LINKS
        addresses = self.addresses
        return Weights(
            rows,
            Links(
                links.texels,
                addresses[links.texels],
                links.begins,
                addresses[links.others],
                links.weights.astype(np.float32),
            ),
        )

    def texels(self, field: NDArray[np.float32]) -> NDArray[np.float32]:
        """The texels of a field, without halo: a view [C, n, n]."""
        return field[:, 1:-1, 1 : self.n + 1]

    def _address(self, address: NDArray[np.int64]) -> NDArray[np.int64]:
        """From an address in [C, n + 2, n + 2] to one in a field here."""
        row, column = np.divmod(address, self.n + 2)
        return row * self._pitch + column


def aligned(shape: tuple[int, ...], column: int, shift: int = 0) -> NDArray[np.float32]:
    """Zeros whose first row has the given column `shift` floats into a page."""
    size = int(np.prod(shape))
    memory = np.zeros(size + PAGE, np.float32)
    start = (shift - column - memory.ctypes.data // memory.itemsize) % PAGE
    return memory[start : start + size].reshape(shape)
