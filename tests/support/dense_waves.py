"""The wave backends' scheme in numpy, with whole matrices in double precision."""

import numpy as np

from ripple_sim.solver.operator.wave_operator import WaveOperator
from ripple_sim.solver.texels.stencil import Stencil, stiffness_matrix


def matrix(stencil: Stencil | None, size: int) -> np.ndarray:
    """Matrix of a stencil's sums: minus its stiffness."""
    return np.zeros((size, size)) if stencil is None else -stiffness_matrix(stencil).toarray()


class DenseWaves:
    """Height, velocity and dent [texels], and leapfrog substeps of a wave operator."""

    def __init__(self, operator: WaveOperator, height: np.ndarray, velocity: np.ndarray) -> None:
        self._operator = operator
        self.h, self.v = height.ravel().astype(float), velocity.ravel().astype(float)
        self.dent = np.zeros_like(self.h)
        self.forces, self.acceleration = np.zeros_like(self.h), 0.0
        size = len(self.h)
        self._tension, self._viscous, self._laplace = (
            matrix(each, size) for each in (operator.stencil, operator.viscous_stencil, operator.laplace_stencil)
        )
        self._rigidity = np.zeros(size) if operator.rigidity is None else operator.rigidity.ravel()

    def advance(self, substeps: int, dt: float) -> None:
        operator = self._operator
        half = operator.damping.ravel() * dt / 2
        span = dt / (1 + half)
        gain = span / operator.mass.ravel() * operator.free.ravel()
        self.h += dt / 2 * self.v
        self._flow()
        for step in range(substeps):
            moments = self._rigidity * (self._laplace @ self.h)
            force = self._tension @ self.h + self._viscous @ self.v - self._laplace @ moments
            self.v = (
                (1 - half) / (1 + half) * self.v
                + gain * (force + self.forces)
                - span * operator.stiffness.ravel() * self.h
                + span * operator.response.ravel() * self.acceleration
            )
            self.h += (dt if step < substeps - 1 else dt / 2) * self.v
            self._flow()

    def _flow(self) -> None:
        if self._operator.yield_height is not None:
            most = self._operator.yield_height.ravel()
            kept = np.clip(self.h, -most, most)
            self.dent += self.h - kept
            self.h = kept
