"""CPU backend: the leapfrog update as one pass over the texels, compiled by numba.

Large surfaces are stepped by several threads, see `crews`.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..operator.bending import Bending
from ..operator.step import StepCoefficients, number_or_field, step_coefficients
from ..operator.volume import volume_rate
from ..operator.wave_operator import WaveOperator
from .backend import NO_LOAD, TexelLoad
from .crews import Team
from .meeting import alone
from .probes import ProbedSums, Probes
from .row_layout import RowLayout, part_runs
from .stencil_kernels import NO_WEIGHTS, Coefficient, Weights
from .step_kernels import NO_FEATURES, Amplitude, Kick, Pulses, State, advance
from .surface_fields import SurfaceFields
from .volume_kernels import NO_BALANCE, Balance

_NO_DENT = np.zeros(0, np.float32)


def volume_balance(
    operator: WaveOperator, dt: float, conserve: bool | None, fields: RowLayout
) -> Balance | None:
    """The balance that keeps the volume over a substep of dt [s]; see `volume_rate`.

    None where nothing has to keep the volume.
    """
    rate = volume_rate(operator, dt, conserve)
    if rate is None:
        return None
    begins, texels, heights, velocities = rate
    addresses = fields.addresses[texels]
    continues_run = np.append(False, np.diff(addresses) == 1)
    first_of_parts = begins[:-1]
    continues_run[first_of_parts[first_of_parts < len(continues_run)]] = False
    run_starts = np.flatnonzero(~continues_run)
    part_count = len(begins) - 1
    part_begins, parts = part_runs(operator, fields)
    return Balance(
        begins=np.searchsorted(run_starts, begins),
        addresses=addresses[run_starts],
        runs=np.append(run_starts, len(addresses)),
        heights=heights,
        velocities=velocities,
        loaded=np.zeros(part_count, np.float32),
        total=np.zeros(part_count, np.float32),
        pressure=fields.coefficients(np.zeros(operator.mass.shape, np.float32)),
        part_begins=part_begins,
        parts=parts,
    )


def all_finite(height: NDArray[np.float32]) -> bool:
    """Whether all heights of a field are finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(height.sum()))


class CPUBackend:
    """Height and velocity in float32 charts with halo; see `Backend`."""

    name = "cpu"

    def __init__(
        self,
        operator: WaveOperator,
        *,
        keeps_volume: bool | None = False,
        threads: int | None = None,
    ) -> None:
        self.keeps_volume = keeps_volume
        self._team = Team(operator.mass.size, threads)
        self._layout = layout = RowLayout(operator.topology)
        height, next_height, velocity = layout.staggered_zeros(3)
        self.fields = SurfaceFields(layout, operator.topology.shape, h=height, v=velocity)
        # room for the height of the next substep
        self._h_next = next_height
        self._stencil = NO_WEIGHTS
        self._viscosity: Weights | None = None
        self._features = NO_FEATURES
        if isinstance(operator.bending, Bending):
            self._features = self._features._replace(moment=layout.zeros().reshape(-1))
        elif operator.bending is not None:
            self._features = self._features._replace(squares=layout.squares(operator.bending))
        if operator.yield_height is not None:
            self.fields.dent = layout.zeros()
            limit = np.full_like(height, np.inf)
            layout.texels(limit)[:] = operator.yield_height
            self._features = self._features._replace(limit=limit.reshape(-1))
        self.move(operator)
        self._response = layout.coefficients(number_or_field(operator.response))
        self._part_runs = None if operator.parts is None else part_runs(operator, layout)
        self._part_count = 1 if operator.parts is None else int(operator.parts.max()) + 1
        self._balance: Balance | None = None
        self._extra: Coefficient = np.float32(0)  # forces beside those of the stencil
        self._shift: Amplitude | None = None  # of velocities, which the next drift adds
        self._moving = False  # True: it has moved, and may move still
        # step length [s] and `keeps_volume` for which the coefficients are prepared
        self._prepared = (0.0, keeps_volume)
        self._load = NO_LOAD
        # the load of which the pulses are prepared
        self._pulsed: TexelLoad | None = None
        self._probes: Probes | None = None
        # sums of the probes, [substeps, k]
        self._sums = np.zeros((0, 0), np.float32)

    def velocity(self) -> NDArray[np.float32]:
        """Copy of the velocity [m/s], with all kicks."""
        self._apply_kicks()
        return self.fields.velocity()

    def set_velocity(self, velocity: NDArray[np.float32]) -> None:
        """Replace the velocity [m/s]; earlier kicks are gone."""
        self.fields.set_velocity(velocity)
        self._shift = None
        self._moving = False  # unless the next step finds otherwise

    def snapshot(self) -> NDArray[np.float32]:
        """Copy of the height [m]."""
        return self.fields.height()

    def crests(self) -> NDArray[np.float32]:
        """Greatest size of the height since the last call [m]: after any `advance`, or now."""
        self._raise_crests(self.fields.watched_crests())
        return self.fields.take_crests()

    def kick(
        self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: Amplitude
    ) -> None:
        """Add velocities [m/s] to some texels, each named once, and one to all, as they respond.

        The velocity of all texels is only noted: the next step adds all that were noted at once.
        """
        self.fields.v.reshape(-1)[self._layout.addresses[texels]] += velocities
        self._shift = everywhere if self._shift is None else self._shift + everywhere

    def hold(self, load: TexelLoad) -> None:
        """Let a load act in every substep until the next call."""
        self._load = load

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        sum_count = 0 if self._probes is None else len(self._probes.heights)
        self._sums = np.zeros((substeps, sum_count), np.float32)
        coefficients = self._prepare(dt)  # it checks them, so before a step at rest too
        if self._rests():
            return
        acceleration = (
            self._pressure(self._load.acceleration)
            if self._balance is None
            else self._balance.pressure
        )
        kick = Kick(
            stencil=self._stencil,
            gain=coefficients.gain,
            decay=coefficients.decay,
            spring=coefficients.spring,
            span=coefficients.span,
            extra=self._extra,
            acceleration=acceleration,
        )
        self._apply_kicks()
        fields = self.fields
        state = State(
            h=fields.h.reshape(-1),
            v=fields.v.reshape(-1),
            h_next=self._h_next.reshape(-1),
            dent=_NO_DENT if fields.dent is None else fields.dent.reshape(-1),
            halo=self._layout.halo,
        )
        step = functools.partial(
            advance,
            substeps,
            np.float32(dt),
            state,
            kick,
            self._pulses,
            self._viscosity,
            None if self._plain else self._features,
            None if self._probes is None else ProbedSums(self._probes, self._sums),
        )
        # a curvature pulls at texels of other threads, and a kept volume is one sum over all texels
        can_be_shared = self._balance is None and not len(self._features.squares.force)
        if can_be_shared:
            self._team.run(step, substeps)
        else:
            step(alone())
        if substeps % 2:
            fields.h, self._h_next = self._h_next, fields.h
        if fields.crests is not None:
            self._raise_crests(fields.crests)

    def probe(self, probes: Probes | None) -> None:
        """Take sums of texels after every substep from now on; None ends it."""
        if probes is not None:
            probes = probes._replace(texels=self._layout.addresses[probes.texels])
        self._probes = probes

    def probed(self) -> NDArray[np.float32]:
        """The sums of the latest `advance`, [substeps, k]."""
        return self._sums

    def wait(self) -> None:
        """Return at once: all steps are done."""

    def finite(self) -> bool:
        """Whether all heights are finite."""
        return all_finite(self.fields.h)

    def move(self, operator: WaveOperator) -> None:
        """Take over the stencils of the same surface with its texels elsewhere."""
        self._operator = operator
        layout = self._layout
        self._stencil = layout.weights(operator.stencil, self._stencil.rows)
        if operator.viscosity_stencil is not None:
            rows = NO_WEIGHTS.rows if self._viscosity is None else self._viscosity.rows
            self._viscosity = layout.weights(operator.viscosity_stencil, rows)
        if isinstance(operator.bending, Bending):
            self._features = self._features._replace(
                laplace=layout.weights(operator.bending.laplace, self._features.laplace.rows),
                rigidity=layout.coefficients(operator.bending.rigidity.astype(np.float32)),
            )
        if operator.density is not None:
            self._prepared = (0.0, self.keeps_volume)  # what keeps the volume follows the stencils

    def _rests(self) -> bool:
        """Whether the surface is flat, does not move, and nothing pushes it: steps change nothing.

        Surfaces often wait for the first hit. A surface that has moved never comes to rest exactly.
        """
        if not self._moving:
            load = self._load
            fields = self.fields
            self._moving = bool(
                self._shift is not None
                or np.any(load.forces)
                or np.any(load.acceleration)
                or fields.dent is not None
                or fields.h.any()
                or fields.v.any()
            )
        return not self._moving

    def _raise_crests(self, crests: NDArray[np.float32]) -> None:
        """Raise the crests to the size of the height where that is greater."""
        scratch = self._h_next  # between steps it holds nothing
        height = self.fields.h
        if self.fields.dent is not None:
            height = np.add(height, self.fields.dent, out=scratch)
        np.maximum(crests, np.abs(height, out=scratch), out=crests)

    def _apply_kicks(self) -> None:
        """Add the velocity of all texels that kicks have noted."""
        if self._shift is not None:
            shift = self._pressure(self._shift) * self._response
            velocities = self.fields.v[:, 1:-1, 1 : self._layout.columns + 1]
            velocities += shift.reshape(velocities.shape) if shift.ndim else shift
            self._shift = None

    def _pressure(self, amplitude: Amplitude) -> Coefficient:
        """An amplitude as the loops take it: a number, or a flat field for several parts."""
        if self._part_runs is None:
            return np.float32(amplitude)
        begins, parts = self._part_runs
        amplitudes = np.broadcast_to(np.float32(amplitude), self._part_count)
        return np.repeat(amplitudes[parts], np.diff(begins))

    def _prepare(self, dt: float) -> StepCoefficients:
        """Coefficients of the kick for substeps of dt [s], and the pulses of the load.

        The coefficients are computed once for each step length, the pulses also for each load.
        """
        new_length = self._prepared != (dt, self.keeps_volume)
        if new_length:
            self._prepare_coefficients(dt)
            self._prepared = (dt, self.keeps_volume)
        load = self._load
        if new_length or load is not self._pulsed:
            gain = self._coefficients.gain[self._layout.places[load.texels]]
            self._pulses = Pulses(
                addresses=self._layout.addresses[load.texels],
                velocities=gain * load.forces.astype(np.float32),
            )
            if self._balance is not None:
                self._balance.loaded[:] = load.acceleration
            self._pulsed = load
        return self._coefficients

    def _prepare_coefficients(self, dt: float) -> None:
        """Compute the coefficients of the kick for substeps of dt [s], and choose the loops."""
        self._balance = volume_balance(self._operator, dt, self.keeps_volume, self._layout)
        self._features = features = self._features._replace(balance=self._balance or NO_BALANCE)
        k = step_coefficients(self._operator, dt)
        values: tuple[Any, ...] = (k.gain, k.decay, k.spring, k.span)
        # beside the gain all coefficients are fields, or none is
        varied = any(np.ndim(value) for value in values[1:])
        varied = varied or self._part_runs is not None or self._balance is not None
        if varied:
            values = np.broadcast_arrays(*values)
        self._coefficients = StepCoefficients(
            *(self._layout.coefficients(value) for value in values)
        )
        bends = len(features.moment) > 0 or len(features.squares.force) > 0
        self._plain = not (varied or bends or len(features.limit))
        # a field where forces are added up, or the number 0
        needs_field = self._viscosity is not None or not self._plain
        if needs_field != bool(np.ndim(self._extra)):
            self._extra = self._layout.zeros().reshape(-1) if needs_field else np.float32(0)
