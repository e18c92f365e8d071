"""Backend for surfaces with deep fluid below: shifted sparse solves on the CPU.

It runs on the CPU also where frames are drawn on the GPU.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..operator.deep_water import FluidOperator
from ..operator.step import damped_step
from ..operator.wave_operator import WaveOperator
from .cpu import RowLayout
from .field_backend import FieldBackend
from .kernels import Amplitude, Probes


class FluidBackend(FieldBackend):
    """Waves of a surface with deep fluid below; see `Backend`.

    The fluid keeps its volume whether or not `keeps_volume` asks for it.
    """

    name = "cpu"
    _operator: FluidOperator

    def __init__(self, operator: FluidOperator, *, keeps_volume: bool | None = False) -> None:
        self._operator = operator
        self.keeps_volume = keeps_volume
        self._fields = RowLayout(operator.topology)
        self._h = self._fields.zeros()
        self._v = self._fields.zeros()
        self._forces = np.zeros(operator.mass.size)

    def move(self, operator: WaveOperator) -> None:
        """Refuse: a surface with deep fluid cannot move; see `MovingOperator`."""
        raise NotImplementedError

    def kick(
        self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: Amplitude
    ) -> None:
        """Add momenta to some texels, as the velocities [m/s] of the texels' own mass.

        The fluid passes the momenta on to other texels, except their mean.
        """
        momentum = np.zeros(self._operator.mass.size)
        momentum[texels] = velocities * self._operator.mass.reshape(-1)[texels]
        change = self._operator.acceleration(momentum.reshape(self._operator.mass.shape))
        self._fields.write(self._v, self.velocity() + change)

    def load(
        self, texels: NDArray[np.int64], forces: NDArray[np.float64], everywhere: Amplitude
    ) -> None:
        """Hold forces [N] on some texels until the next call."""
        self._forces[:] = 0.0
        self._forces[texels] = forces

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        operator = self._operator
        loads = self._forces.reshape(operator.mass.shape)
        decay, span = damped_step(operator, dt)
        h = self.elastic().astype(np.float64)
        v = self.velocity().astype(np.float64)
        dent = self.dent()
        h += dt / 2 * v
        sum_count = 0 if self._probes is None else len(self._probes.heights)
        self._sums = np.zeros((substeps, sum_count), np.float32)
        for step in range(substeps):
            change = operator.acceleration(operator.elastic_force(h) + loads)
            if operator.viscosity_stencil is not None:
                change += operator.viscosity_stencil(v) / operator.mass * operator.free
            v = decay * v + span * change
            if self._probes is not None:
                self._sums[step] = self._probes.of(h + dt / 2 * v + dent, v)
            h += (dt if step < substeps - 1 else dt / 2) * v
        self._fields.write(self._h, h)
        self._fields.write(self._v, v)
        if self._crests is not None:
            self._raise_crests()

    def probe(self, probes: Probes | None) -> None:
        """Take sums of texels after every substep from now on; None ends it."""
        self._probes = probes
