"""SciPy's sparse matrix and NumPy: waves as one would write them in an afternoon. SciPy multiplies in one thread."""

from __future__ import annotations

import numpy as np
from scipy.sparse import diags_array

from ripple_sim.solver.kernel import Floats32
from ripple_sim.solver.operator.wave_operator import WaveOperator
from ripple_sim.solver.texels.stencil import stiffness_matrix


class SparseLeapfrog:
    """Leapfrog with a matrix in CSR, in float32."""

    def __init__(self, operator: WaveOperator) -> None:
        self._shape = operator.mass.shape
        self._matrix = (
            (diags_array(-1 / operator.mass.ravel()) @ stiffness_matrix(operator.stencil)).tocsr().astype(np.float32)
        )
        self._h, self._v = np.zeros((2, operator.mass.size), np.float32)

    def set_height(self, height: Floats32) -> None:
        """Replace the height [m], [C, n, n]."""
        self._h[:] = height.ravel()

    def state(self) -> tuple[Floats32, Floats32]:
        """Height [m] and velocity [m/s], [C, n, n]."""
        return self._h.reshape(self._shape).copy(), self._v.reshape(self._shape).copy()

    def advance(self, substeps: int, dt: float) -> None:
        """Take substeps: kick, drift."""
        for _ in range(substeps):
            self._v += np.float32(dt) * (self._matrix @ self._h)
            self._h += np.float32(dt) * self._v
