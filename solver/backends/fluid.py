"""Backend for surfaces with deep fluid below: shifted sparse solves on the CPU.

It runs on the CPU also where frames are drawn on the GPU.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..operator.deep_water import FluidOperator
from ..operator.step import damped_step
from ..operator.wave_operator import WaveOperator
from .backend import TexelLoad
from .cpu import all_finite
from .probes import Probes
from .row_layout import RowLayout
from .step_kernels import Amplitude
from .surface_fields import SurfaceFields


class FluidBackend:
    """Waves of a surface with deep fluid below; see `Backend`.

    The fluid keeps its volume whether or not `keeps_volume` asks for it.
    """

    name = "cpu"

    def __init__(self, operator: FluidOperator, *, keeps_volume: bool | None = False) -> None:
        self._operator = operator
        self.keeps_volume = keeps_volume
        layout = RowLayout(operator.topology)
        self.fields = SurfaceFields(
            layout, operator.topology.shape, h=layout.zeros(), v=layout.zeros()
        )
        self._forces = np.zeros(operator.mass.size)
        self._probes: Probes | None = None
        # sums of the probes, [substeps, k]
        self._sums = np.zeros((0, 0), np.float32)

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s]."""
        return self.fields.velocity()

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity [m/s]."""
        self.fields.set_velocity(velocity)

    def snapshot(self) -> NDArray[np.float32]:
        """Copy of the height [m]."""
        return self.fields.height()

    def crests(self) -> NDArray[np.float32]:
        """Greatest size of the height since the last call [m]: after any `advance`, or now."""
        self.fields.watched_crests()
        self._raise_crests()
        return self.fields.take_crests()

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
        self.fields.layout.write(self.fields.v, self.velocity() + change)

    def hold(self, load: TexelLoad) -> None:
        """Let the forces of a load act until the next call; its acceleration does not matter."""
        self._forces[:] = 0.0
        self._forces[load.texels] = load.forces

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        operator = self._operator
        loads = self._forces.reshape(operator.mass.shape)
        decay, span = damped_step(operator, dt)
        h = self.fields.elastic_height().astype(np.float64)
        v = self.velocity().astype(np.float64)
        dent = self.fields.permanent_height()
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
        layout = self.fields.layout
        layout.write(self.fields.h, h)
        layout.write(self.fields.v, v)
        if self.fields.crests is not None:
            self._raise_crests()

    def probe(self, probes: Probes | None) -> None:
        """Take sums of texels after every substep from now on; None ends it."""
        self._probes = probes

    def probed(self) -> NDArray[np.float32]:
        """The sums of the latest `advance`, [substeps, k]."""
        return self._sums

    def wait(self) -> None:
        """Return at once: all steps are done."""

    def finite(self) -> bool:
        """Whether all heights are finite."""
        return all_finite(self.fields.h)

    def _raise_crests(self) -> None:
        """Raise the crests to the height where that is greater."""
        layout = self.fields.layout
        field = self.fields.watched_crests()
        layout.write(field, np.maximum(layout.read(field), np.abs(self.fields.height())))
