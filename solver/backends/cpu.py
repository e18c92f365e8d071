"""CPU backend: the leapfrog update as one pass over the texels, compiled by numba.

One thread on all but the largest atlases: a substep takes 0.07 ms at N = 128 and 0.3 ms at N = 256, less than a helper
may wait for its core while other threads render and encode. Waiting for it then costs more than two threads gain.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.operator.step_coefficients import StepCoefficients, number_or_field, step_coefficients
from ripple_sim.solver.operator.wave_operator import WaveOperator

from . import blocks, kernels, threads
from .arguments import (
    NO_FEATURES,
    Amplitude,
    Balance,
    Bending,
    Coefficient,
    Drift,
    Features,
    Kick,
    Loads,
    Plasticity,
    State,
    Weights,
)
from .cpu_coefficients import is_varied, laid_out, part_runs, pressure, volume_balance
from .cpu_fields import LARGE, LINE, PAGE, FieldLayout


class CPUBackend:
    """Height and velocity in float32 charts with halo; see `backends.Backend`.

    Parameters
    ----------
    operator : WaveOperator
    thread_count : int, optional
        How many share out the charts, where the material neither bends, drags nor yields and the volume needs no
        keeping; by default as many as can be of use from N = 512 on. The numbers do not depend on it.
    keeps_volume : bool
        See `backends.Backend`.
    """

    name = "cpu"

    def __init__(self, operator: WaveOperator, thread_count: int | None = None, *, keeps_volume: bool = False) -> None:
        self._operator = operator
        self.keeps_volume = keeps_volume
        plain = operator.viscous_stencil is operator.laplace_stencil is operator.yield_height is None
        plain = plain and blocks.on_borders(operator.stencil.irregular, operator.mass.shape[1])
        large = operator.mass.size >= 6 * LARGE**2
        if thread_count is None:
            thread_count = threads.available() if large else 1
        self._threads = thread_count if plain else 1
        self._in_blocks = plain and (large or thread_count > 1)
        self._fields = fields = FieldLayout(operator.topology, alone=self._in_blocks)
        self._stencil = fields.weights(operator.stencil)
        self._viscous = None if operator.viscous_stencil is None else fields.weights(operator.viscous_stencil)
        # the processor takes a store to one field and a load from another at the same place of a page for a conflict:
        # each field begins elsewhere in its page
        self._h, self._h_next, self._v = (fields.zeros(shift * PAGE // 3 // LINE * LINE) for shift in range(3))
        self._bending = self._plasticity = self._dent = None
        if operator.laplace_stencil is not None and operator.rigidity is not None:
            rigidity = fields.coefficients(operator.rigidity.astype(np.float32))
            self._bending = Bending(fields.weights(operator.laplace_stencil), rigidity, fields.zeros())
        if operator.yield_height is not None:
            self._dent = fields.zeros()
            limit = fields.coefficients(operator.yield_height.astype(np.float32))
            self._plasticity = Plasticity(fields.columns, limit, self._dent)
        self._most = blocks.block_length(fields.n, self._h.shape[2])
        self._response = fields.coefficients(number_or_field(operator.response))
        self._part_runs = None if operator.parts is None else part_runs(operator.parts, fields)
        self._balance: Balance | None = None
        self._extra: Coefficient = np.float32(0)
        self._shift: Amplitude = 0.0
        self._crests: NDArray[np.float32] | None = None
        self._prepared = (0.0, keeps_volume)
        self.load(np.zeros(0, np.int64), np.zeros(0), 0.0)

    @property
    def _by_threads(self) -> bool:
        return self._in_blocks and self._balance is None

    @property
    def thread_count(self) -> int:
        """How many threads share out the charts."""
        return self._threads

    def height(self) -> NDArray[np.float32]:
        """Copy of the height [m], [C, n, n]."""
        elastic = self.elastic()
        return elastic if self._dent is None else elastic + self.dent()

    def snapshot(self) -> NDArray[np.float32]:
        """The same as `height`."""
        return self.height()

    def elastic(self) -> NDArray[np.float32]:
        """Copy of the part of the height that springs back [m], [C, n, n]."""
        return self._fields.texels(self._h).copy()

    def dent(self) -> NDArray[np.float32]:
        """The part of the height that stays [m], [C, n, n]."""
        if self._dent is None:
            return np.zeros(self._operator.mass.shape, np.float32)
        return self._fields.texels(self._dent).copy()

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], [C, n, n]."""
        self._drift(0.0)
        return self._fields.texels(self._v).copy()

    def crests(self) -> NDArray[np.float32]:
        """Greatest size of the height after any `advance` since the last call, or now [m], [C, n, n]."""
        if self._crests is None:
            self._crests = self._fields.zeros()
        self._raise_crests(self._crests)
        crests = self._fields.texels(self._crests).copy()
        self._crests[:] = 0
        return crests

    def set_height(self, height: NDArray[np.float32], dent: NDArray[np.float32] | None = None) -> None:
        """Replace the elastic height, and the permanent one: 0 unless given."""
        self._h[:] = 0  # what is no number between charts too
        self._fields.texels(self._h)[:] = height
        if self._dent is None and dent is not None and dent.any():
            # what another material has left, in a surface that does not yield itself
            self._dent = self._fields.zeros()
        if self._dent is not None:
            self._fields.texels(self._dent)[:] = 0 if dent is None else dent

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity."""
        self._v[:] = 0
        self._fields.texels(self._v)[:] = velocity
        self._shift = 0.0

    def kick(self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: Amplitude) -> None:
        """Add velocities [m/s] to some texels (each named once), and one to all, as they respond.

        The latter is only noted: the next drift, which touches every texel anyway, adds it.
        """
        self._v.reshape(-1)[self._fields.addresses[texels]] += velocities
        self._shift = self._shift + everywhere

    def load(self, texels: NDArray[np.int64], forces: NDArray[np.float64], everywhere: Amplitude) -> None:
        """Hold forces [N] on some texels, and one acceleration [m/s^2] on all, until the next call."""
        self._loaded, self._forces, self._acceleration = texels, forces, everywhere
        self._load_is_new = True

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        k = self._prepare(dt)
        state = State(self._h, self._v, self._h_next)
        kick = Kick(self._stencil, k.gain, k.decay, k.spring, k.span, self._extra, self._pressure(self._acceleration))
        length, step = np.float32(dt), (state, self._fields.halo, kick, self._loads)
        if self._by_threads:
            plan = threads.Plan(substeps, self._most, length)
            threads.advance(self._threads, plan, *step, self._start(dt / 2))
        else:
            self._drift(dt / 2)
            if self._plasticity is not None:
                kernels.flow(self._h, self._plasticity)
            kernels.advance(substeps, length, *step, *self._beside())
        if substeps % 2:
            self._h, self._h_next = self._h_next, self._h
        if self._crests is not None:
            self._raise_crests(self._crests)

    def move(self, operator: WaveOperator) -> None:
        """Take over the stencils of the same surface with its texels elsewhere."""
        self._operator, fields = operator, self._fields
        self._stencil = fields.fill(self._stencil.rows, operator.stencil)
        if self._viscous is not None and operator.viscous_stencil is not None:
            self._viscous = fields.fill(self._viscous.rows, operator.viscous_stencil)
        if self._bending is not None and operator.laplace_stencil is not None and operator.rigidity is not None:
            laplace = fields.fill(self._bending.laplace.rows, operator.laplace_stencil)
            rigidity = fields.coefficients(operator.rigidity.astype(np.float32))
            self._bending = self._bending._replace(laplace=laplace, rigidity=rigidity)
        if operator.density is not None:
            self._prepared = (0.0, self.keeps_volume)  # what keeps the volume follows the stencils

    def wait(self) -> None:
        """Return when all steps are done: at once, they are."""

    def finite(self) -> bool:
        """Whether all heights are finite."""
        with np.errstate(over="ignore", invalid="ignore"):
            return bool(np.isfinite(self._h.sum()))

    def _raise_crests(self, crests: NDArray[np.float32]) -> None:
        # the next height is but scratch between steps
        height = self._h if self._dent is None else np.add(self._h, self._dent, out=self._h_next)
        kernels.raise_crests(height, crests)

    def _drift(self, dt: float) -> None:
        if dt or np.any(self._shift):
            kernels.drift(self._h, self._v, self._start(dt))

    def _start(self, dt: float) -> Drift:
        """The drift by which a step begins; the noted shift is in it."""
        drift = Drift(self._fields.columns, self._response, self._pressure(self._shift), np.float32(dt))
        self._shift = 0.0
        return drift

    def _pressure(self, amplitude: Amplitude) -> Coefficient:
        """An amplitude as the loops take it."""
        return pressure(amplitude, self._part_runs if self._balance is None else self._balance.spread, self._fields)

    def _beside(self) -> tuple[Weights | None, Features | None]:
        """The last two arguments of `kernels.advance`."""
        if not self._has_features:
            return self._viscous, None
        return None, Features(
            self._viscous or NO_FEATURES.viscous,
            self._bending or NO_FEATURES.bending,
            self._plasticity or NO_FEATURES.plasticity,
            self._balance or NO_FEATURES.balance,
        )

    def _prepare(self, dt: float) -> StepCoefficients:
        """Coefficients of the kick, computed once a step length, and the load's, once a load as well."""
        new_length = self._prepared != (dt, self.keeps_volume)
        if new_length:
            self._balance = None
            if self.keeps_volume:
                self._balance = volume_balance(self._operator, dt, self._fields, self._part_runs)
            k = step_coefficients(self._operator, dt)
            varied = is_varied(k) or self._part_runs is not None or self._balance is not None
            self._coefficients = laid_out(k, self._fields, varied=varied)
            self._has_features = varied or self._bending is not None or self._plasticity is not None
            drags = self._viscous is not None or (self._has_features and not self._by_threads)
            if drags != bool(np.ndim(self._extra)):
                self._extra = self._fields.zeros() if drags else np.float32(0)
            self._prepared = (dt, self.keeps_volume)
        k = self._coefficients
        if new_length or self._load_is_new:
            kicks = k.gain.reshape(-1)[self._fields.places[self._loaded]] * self._forces.astype(np.float32)
            addresses = self._fields.addresses[self._loaded]
            order = np.argsort(addresses, kind="stable")
            self._loads = Loads(addresses[order], kicks[order])
            if self._balance is not None:
                self._balance.loaded[:] = self._acceleration
            self._load_is_new = False
        return k
