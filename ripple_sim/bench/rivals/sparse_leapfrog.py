"""SciPy's sparse matrix and NumPy: waves as one would write them in an afternoon. SciPy multiplies in one thread."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array, diags_array

from ripple_sim.solver.kernel import Floats32
from ripple_sim.solver.texels.cube_map.convention import padded_indices
from ripple_sim.solver.waves.operator import WaveOperator


class SparseLeapfrog:
    """Leapfrog with a matrix in CSR, in float32."""

    def __init__(self, operator: WaveOperator) -> None:
        self._shape = operator.mass.shape
        links = _links(operator)
        laplace = links - diags_array(np.asarray(links.sum(axis=1)).ravel())
        self._matrix = (diags_array(1 / operator.mass.ravel()) @ laplace).tocsr().astype(np.float32)
        self._h, self._v = np.zeros((2, operator.mass.size), np.float32)

    def set_height(self, height: Floats32) -> None:
        """Replace the height [m], [6, N, N]."""
        self._h[:] = height.ravel()

    def state(self) -> tuple[Floats32, Floats32]:
        """Height [m] and velocity [m/s], [6, N, N]."""
        return self._h.reshape(self._shape).copy(), self._v.reshape(self._shape).copy()

    def advance(self, substeps: int, dt: float) -> None:
        """Take substeps: kick, drift."""
        for _ in range(substeps):
            self._v += np.float32(dt) * (self._matrix @ self._h)
            self._h += np.float32(dt) * self._v


def _links(operator: WaveOperator) -> csr_array:
    """Weights of all links as a symmetric matrix [6 N^2, 6 N^2], without its diagonal."""
    n, size = operator.mass.shape[1], operator.mass.size
    index = padded_indices(n)
    low, high = slice(None, -1), slice(1, None)
    ends = (
        (index[:, low, low], index[:, low, high]),
        (index[:, low, low], index[:, high, low]),
        (index[:, low, low], index[:, high, high]),
        (index[:, low, high], index[:, high, low]),
    )
    i, j, weight = [], [], []
    for link, (a, b) in enumerate(ends):
        exists = (a >= 0) & (b >= 0) & (operator.stencil[:, link] != 0)
        # a link across a cube edge stands on both charts: its owner is the chart of its lower texel
        exists &= np.minimum(a, b) // (n * n) == np.arange(6)[:, None, None]
        i.append(a[exists])
        j.append(b[exists])
        weight.append(operator.stencil[:, link][exists])
    places = np.concatenate(i), np.concatenate(j)
    links = coo_array((np.concatenate(weight), places), shape=(size, size)).tocsr()
    return links + links.T
