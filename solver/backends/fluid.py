"""Backend of surfaces with deep fluid below: shifted sparse solves on the CPU, whatever draws the frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..operator.deep_water import FluidOperator
from ..operator.wave_operator import WaveOperator, damped_step
from .kernels import Amplitude


class FluidBackend:
    """Height and velocity in float32; see `backends.Backend`. The fluid keeps its volume, asked to or not.

    Parameters
    ----------
    operator : FluidOperator
    keeps_volume : bool
        Changes nothing.
    """

    name = "cpu"

    def __init__(self, operator: FluidOperator, *, keeps_volume: bool = False) -> None:
        self._operator = operator
        self.keeps_volume = keeps_volume
        self._h, self._v, self._dent = np.zeros((3, *operator.mass.shape), np.float32)
        self._forces = np.zeros(operator.mass.size)
        self._crests = np.zeros_like(self._h)

    def height(self) -> NDArray[np.float32]:
        """Copy of the height [m], [C, n, n]."""
        return self._h + self._dent

    def snapshot(self) -> NDArray[np.float32]:
        """The same as `height`."""
        return self.height()

    def elastic(self) -> NDArray[np.float32]:
        """Copy of the part of the height that springs back [m], [C, n, n]."""
        return self._h.copy()

    def dent(self) -> NDArray[np.float32]:
        """The part of the height that another material has left [m], [C, n, n]."""
        return self._dent.copy()

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], [C, n, n]."""
        return self._v.copy()

    def move(self, operator: WaveOperator) -> None:
        """It cannot; see `MovingOperator`."""
        raise NotImplementedError

    def crests(self) -> NDArray[np.float32]:
        """Greatest size of the height after any `advance` since the last call, or now [m], [C, n, n]."""
        crests = np.maximum(self._crests, np.abs(self.height()))
        self._crests[:] = 0
        return crests

    def set_height(self, height: NDArray[np.float32], dent: NDArray[np.float32] | None = None) -> None:
        """Replace the elastic height, and the permanent one: 0 unless given."""
        self._h[:] = height
        self._dent[:] = 0 if dent is None else dent

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity."""
        self._v[:] = velocity

    def kick(self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: Amplitude) -> None:
        """Add momenta to some texels, given as the velocities [m/s] that their own mass would have.

        The fluid hands them on, and lets none of their mean through.
        """
        momentum = np.zeros(self._operator.mass.size)
        momentum[texels] = velocities * self._operator.mass.reshape(-1)[texels]
        self._v += self._operator.acceleration(momentum.reshape(self._v.shape))

    def load(self, texels: NDArray[np.int64], forces: NDArray[np.float64], everywhere: Amplitude) -> None:
        """Hold forces [N] on some texels until the next call."""
        self._forces[:] = 0.0
        self._forces[texels] = forces

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        operator, loads = self._operator, self._forces.reshape(self._v.shape)
        decay, span = damped_step(operator, dt)
        h, v = self._h.astype(np.float64), self._v.astype(np.float64)
        h += dt / 2 * v
        for step in range(substeps):
            change = operator.acceleration(operator.elastic_force(h) + loads)
            if operator.viscous_stencil is not None:
                change += operator.viscous_stencil(v) / operator.mass * operator.free
            v = decay * v + span * change
            h += (dt if step < substeps - 1 else dt / 2) * v
        self._h[:], self._v[:] = h, v
        np.maximum(self._crests, np.abs(self.height()), out=self._crests)

    def wait(self) -> None:
        """Return when all steps are done: at once, they are."""

    def finite(self) -> bool:
        """Whether all heights are finite."""
        with np.errstate(over="ignore", invalid="ignore"):
            return bool(np.isfinite(self._h.sum()))
