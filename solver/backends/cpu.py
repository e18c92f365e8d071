"""CPU backend: the leapfrog update as one pass over the texels, compiled by numba.

Large surfaces are stepped by several threads, see `crews`.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..operator.bending import Bending
from ..operator.curvatures import STEPS, Curvatures
from ..operator.step import StepCoefficients, number_or_field, step_coefficients
from ..operator.volume import volume_rate
from ..operator.wave_operator import WaveOperator
from ..texels.stencil import Stencil
from ..texels.topology import TexelTopology
from . import kernels
from .backend import NO_LOAD, TexelLoad
from .crews import Team
from .kernels import (
    NO_BALANCE,
    NO_FEATURES,
    NO_WEIGHTS,
    Amplitude,
    Balance,
    Coefficient,
    Kick,
    Links,
    ProbedSums,
    Pulses,
    Squares,
    State,
    Weights,
)
from .meeting import alone
from .surface_fields import SurfaceFields

# Below this resolution [texels along a side] charts lie side by side, row by row: one loop then
# runs over a row of all charts. On charts of 12 columns, a loop for each chart takes four times as
# long.
_MAX_JOINED_RESOLUTION = 64

_LINE_FLOATS = 16  # float32 in a cache line of 64 bytes
_PAGE_FLOATS = 1024  # float32 in a page of 4096 bytes

_NO_DENT = np.zeros(0, np.float32)


class RowLayout:
    """Charts [C, n + 2, pitch] float32, the texels from row 1 and column 1 on.

    Side by side, all charts with their halo are one, [1, n + 2, (C + 1)(n + 2)]: loops run over the
    halo between them too, where coefficients are 0, and what they leave there is filled again. The
    last n + 2 columns stay 0.

    Attributes
    ----------
    n : int
        Texels along a chart's side.
    columns : int
        Columns that loops run over, from 1 on.
    addresses : int64 [C n^2]
        Address of every texel, by flat texel index.
    halo : int64 [2, k]
        Addresses of the halo's places, and of the texels that they show.
    """

    def __init__(self, topology: TexelTopology) -> None:
        self._charts, self.n, _ = topology.shape
        self._alone = self.n >= _MAX_JOINED_RESOLUTION or self._charts == 1
        width = self.n + 2
        if self._alone:
            self.columns = self.n
            self._pitch = -(-width // _LINE_FLOATS) * _LINE_FLOATS
        else:
            self.columns = self._charts * width - 2
            self._pitch = (self._charts + 1) * width
        texels, ghosts, sources = topology.addresses
        self.addresses = self._address(texels)
        self.halo = np.stack([self._address(ghosts), self._address(sources)])
        if topology.fixed_rim and not self._alone:
            # loops run over the rim's places beside the charts: they are set to 0 again
            rim = np.flatnonzero(topology.rim)
            row = rim // width % width
            beside = self._address(rim[row % (width - 1) > 0])
            always_zero = np.full(len(beside), self._pitch - 1)
            self.halo = np.append(self.halo, [beside, always_zero], axis=1)

    def zeros(self, shift: int = 0) -> NDArray[np.float32]:
        """A field of zeros with halo.

        The first texel begins a cache line; where charts do not lie side by side, the first texel
        of every row does.
        """
        return aligned((self._charts if self._alone else 1, self.n + 2, self._pitch), 1, shift)

    def coefficients(self, field: NDArray | np.float32) -> Any:
        """A field [C, n, n] as loops read it beside a field with halo, or a number as it is.

        It is flat, [C n columns], and 0 between the charts.
        """
        if np.ndim(field) == 0:
            return field
        field = np.asarray(field)
        laid = aligned(
            field.shape if self._alone else (1, self.n, self.columns), 0, dtype=field.dtype
        )
        if not self._alone:
            beside = np.zeros((self.n, self._charts, self.n + 2), field.dtype)
            beside[:, :, 1:-1] = field.transpose(1, 0, 2)
            field = beside.reshape(self.n, -1)[:, 1:-1]
        laid[:] = field
        return laid.reshape(-1)

    @functools.cached_property
    def places(self) -> NDArray[np.int64]:
        """Flat index of every texel in its `coefficients`, [C n^2]."""
        row, column = np.divmod(self.addresses, self._pitch)
        chart, row = np.divmod(row, self.n + 2)
        return (chart * self.n + row - 1) * self.columns + column - 1

    def weights(self, stencil: Stencil, rows: NDArray[np.float32]) -> Weights:
        """A stencil laid out like a field; `rows` of an earlier stencil are used again, if any."""
        count = self._charts
        if not rows.size:
            rows = aligned((count if self._alone else 1, 4, self.n + 1, self._pitch), 1)
        if self._alone:
            rows[..., : self.n + 1] = stencil.weights
        else:
            beside = rows.reshape(4, self.n + 1, count + 1, self.n + 2)
            beside[:, :, :count, : self.n + 1] = stencil.weights.transpose(1, 2, 0, 3)
        links = stencil.irregular
        irregular = Links(
            texels=self.places[links.texels],
            addresses=self.addresses[links.texels],
            begins=links.begins,
            others=self.addresses[links.others],
            weights=links.weights.astype(np.float32),
        )
        return Weights(rows, self.columns, irregular)

    def squares(self, bending: Curvatures) -> Squares:
        """Weights of curvatures laid out like coefficients, and room for their forces."""
        weights_of_neighbours = []
        for weights_of_kinds in bending.weights.astype(np.float32).swapaxes(0, 1):
            weights_of_neighbours.append(
                np.stack([self.coefficients(weight) for weight in weights_of_kinds])
            )
        weights = np.stack(weights_of_neighbours)
        return Squares(
            weights=weights,
            steps=np.array([row * self._pitch + column for row, column in STEPS]),
            rows=weights.shape[-1] // self.columns,
            chart_rows=self.n,
            columns=self.columns,
            pitch=self._pitch,
            force=self.zeros().reshape(-1),
            scratch=np.zeros((4, kernels.BLOCK), np.float32),
        )

    def texels(self, field: NDArray[np.float32]) -> NDArray[np.float32]:
        """The texels of a field, without halo: a view [C, n, n]."""
        if self._alone:
            return field[:, 1:-1, 1 : self.n + 1]
        beside = field.reshape(self.n + 2, self._charts + 1, self.n + 2)
        return beside[1:-1, : self._charts, 1:-1].transpose(1, 0, 2)

    def read(self, field: NDArray[np.float32]) -> NDArray[np.float32]:
        """Copy of a field's texels, [C, n, n]."""
        return self.texels(field).copy()

    def write(self, field: NDArray[np.float32], values: NDArray | np.float32) -> None:
        """Replace a field's texels; all other places become 0, also where they were not numbers."""
        field[:] = 0
        self.texels(field)[:] = values

    def _address(self, address: NDArray[np.int64]) -> NDArray[np.int64]:
        """From an address in [C, n + 2, n + 2] to one in a field here."""
        row, column = np.divmod(address, self.n + 2)
        if self._alone:
            return row * self._pitch + column
        chart, row = np.divmod(row, self.n + 2)
        return row * self._pitch + chart * (self.n + 2) + column


def aligned(
    shape: tuple[int, ...], column: int, shift: int = 0, dtype: DTypeLike = np.float32
) -> NDArray:
    """Zeros of four bytes each; `column` of the first row is `shift` numbers into a page."""
    size = int(np.prod(shape))
    memory = np.zeros(size + _PAGE_FLOATS, dtype)
    start = (shift - column - memory.ctypes.data // memory.itemsize) % _PAGE_FLOATS
    return memory[start : start + size].reshape(shape)


def part_runs(
    operator: WaveOperator, fields: RowLayout
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Runs of texels of one part in coefficients: where each begins [k + 1], and its part [k]."""
    parts = np.zeros(operator.mass.shape, np.int32) if operator.parts is None else operator.parts
    beside = fields.coefficients(parts)
    begins = np.flatnonzero(np.diff(beside, prepend=-1))
    return np.append(begins, beside.size), beside[begins].astype(np.int64)


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
        # the processor takes a store to one field and a load from another at the same place of a
        # page for a conflict: each field begins elsewhere in its page
        height, next_height, velocity = (
            layout.zeros(i * _PAGE_FLOATS // 3 // _LINE_FLOATS * _LINE_FLOATS) for i in range(3)
        )
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
        # step length [s] and `keeps_volume` for which the coefficients are prepared
        self._prepared = (0.0, keeps_volume)
        self._load = NO_LOAD
        # the load of which the pulses are prepared
        self._pulsed: TexelLoad | None = None
        self._probes: kernels.Probes | None = None
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
        coefficients = self._prepare(dt)
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
        sum_count = 0 if self._probes is None else len(self._probes.heights)
        self._sums = np.zeros((substeps, sum_count), np.float32)
        step = functools.partial(
            kernels.advance,
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

    def probe(self, probes: kernels.Probes | None) -> None:
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
