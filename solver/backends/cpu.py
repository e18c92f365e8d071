"""CPU backend: the leapfrog update as one pass over the texels, compiled by numba.

One thread on all but the largest atlases: a substep takes 0.07 ms at N = 128 and 0.3 ms at N = 256, less than a helper
may wait for its core while other threads render and encode. Waiting for it then costs more than two threads gain.

Fields in memory as the compiled loops read them: charts with halo, aligned to cache lines and pages.

What compiled loops read beside fields, in few types: for each choice of types the loops are compiled anew.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..operator.volume import volume_rate
from ..operator.wave_operator import StepCoefficients, WaveOperator, number_or_field, step_coefficients
from ..texels.stencil import NO_LINKS, Stencil
from ..texels.topology import TexelTopology
from . import blocks, kernels
from .stencil_loops import (
    NO_FEATURES,
    Amplitude,
    Balance,
    Bending,
    Coefficient,
    Drift,
    Features,
    Halo,
    Kick,
    Links,
    Loads,
    PartRuns,
    Plasticity,
    State,
    Weights,
)

# From this resolution on memory is what takes time, milliseconds a substep: several threads share out the charts, and
# rows lie close together. Below, where caches hold the fields, rows that begin with a cache line are a tenth faster.
LARGE = 512

# Below this resolution charts lie side by side, row by row: one loop then runs over a row of all of them. On charts of
# 12 columns, loops that begin anew for each take four times as long.
SMALL = 64

# Floats of a cache line, and of a page of memory.
LINE, PAGE = 16, 1024


class FieldLayout:
    """Charts [C, n + 2, pitch] float32, the texels from row 1 and column 1 on.

    Side by side, all charts with their halo are one, [1, n + 2, (C + 1)(n + 2)]: loops run over the halo between them
    too, where coefficients are 0, and what they leave there is filled again. The last n + 2 columns stay 0.

    Parameters
    ----------
    topology : TexelTopology
    alone : bool
        Whether small charts, too, lie one after the other.

    Attributes
    ----------
    n : int
        Texels along a chart's side.
    columns : int
        Columns that loops run over, from 1 on.
    addresses : int64 [C n^2]
        Address of every texel, by flat texel index.
    halo : Halo
        Addresses of the halo, and of the texels that it shows.
    """

    def __init__(self, topology: TexelTopology, *, alone: bool = False) -> None:
        self._charts, self.n, _ = topology.shape
        self._alone = alone or self.n >= SMALL or self._charts == 1
        width = self.n + 2
        if self._alone:
            self.columns, self._pitch = self.n, width if self.n >= LARGE else -(-width // LINE) * LINE
        else:
            self.columns, self._pitch = self._charts * width - 2, (self._charts + 1) * width
        table = topology.addresses
        self.addresses = self._address(table.texels)
        self.halo = Halo(self._address(table.ghosts), self._address(table.sources))
        if topology.fixed_rim and not self._alone:
            # loops run over these: they are set to 0 again
            beside = np.flatnonzero(topology.rim)
            beside = self._address(beside[(beside // width % width % (width - 1)) > 0])
            ghosts, sources = self.halo
            self.halo = Halo(
                np.concatenate([ghosts, beside]), np.append(sources, np.full(len(beside), self._pitch - 1))
            )

    def zeros(self, shift: int = 0) -> NDArray[np.float32]:
        """A field with halo; its first texel, or that of every row of a chart alone, begins a cache line."""
        return aligned((self._charts if self._alone else 1, self.n + 2, self._pitch), 1, shift)

    def coefficients(self, field: NDArray | np.float32) -> Any:
        """A field [C, n, n] as loops read it beside one with halo, [C, n, columns], 0 between charts; or a number."""
        if np.ndim(field) == 0:
            return field
        field = np.asarray(field)
        if self._alone:
            laid = aligned(field.shape, 0, dtype=field.dtype)
            laid[:] = field
            return laid
        spread = np.zeros((self.n, self._charts, self.n + 2), field.dtype)
        spread[:, :, 1:-1] = field.transpose(1, 0, 2)
        laid = aligned((1, self.n, self.columns), 0, dtype=field.dtype)
        laid[0] = spread.reshape(self.n, -1)[:, 1:-1]
        return laid

    @functools.cached_property
    def places(self) -> NDArray[np.int64]:
        """Flat index of every texel in its `coefficients`, [C n^2]."""
        row, column = np.divmod(self.addresses, self._pitch)
        chart, row = np.divmod(row, self.n + 2)
        return (chart * self.n + row - 1) * self.columns + column - 1

    def weights(self, stencil: Stencil) -> Weights:
        """A stencil laid out like a field, and its irregular links."""
        count = self._charts
        rows = aligned((count if self._alone else 1, 4, self.n + 1, self._pitch), 1)
        return self.fill(rows, stencil)

    def fill(self, rows: NDArray[np.float32], stencil: Stencil) -> Weights:
        """The same in the rows of another one, written over."""
        count = self._charts
        if self._alone:
            rows[..., : self.n + 1] = stencil.weights
        else:
            beside = rows.reshape(4, self.n + 1, count + 1, self.n + 2)
            beside[:, :, :count, : self.n + 1] = stencil.weights.transpose(1, 2, 0, 3)
        links = stencil.irregular if stencil.irregular is not None else NO_LINKS
        addresses = self.addresses
        return Weights(
            rows,
            self.columns,
            Links(
                self.places[links.texels],
                addresses[links.texels],
                links.begins,
                addresses[links.others],
                links.weights.astype(np.float32),
            ),
        )

    def texels(self, field: NDArray[np.float32]) -> NDArray[np.float32]:
        """The texels of a field, without halo: a view [C, n, n]."""
        if self._alone:
            return field[:, 1:-1, 1 : self.n + 1]
        beside = field.reshape(self.n + 2, self._charts + 1, self.n + 2)
        return beside[1:-1, : self._charts, 1:-1].transpose(1, 0, 2)

    def _address(self, address: NDArray[np.int64]) -> NDArray[np.int64]:
        """From an address in [C, n + 2, n + 2] to one in a field here."""
        row, column = np.divmod(address, self.n + 2)
        if self._alone:
            return row * self._pitch + column
        chart, row = np.divmod(row, self.n + 2)
        return row * self._pitch + chart * (self.n + 2) + column


def aligned(shape: tuple[int, ...], column: int, shift: int = 0, dtype: DTypeLike = np.float32) -> NDArray:
    """Zeros, of four bytes each, whose first row has the given column `shift` of them into a page."""
    size = int(np.prod(shape))
    memory = np.zeros(size + PAGE, dtype)
    start = (shift - column - memory.ctypes.data // memory.itemsize) % PAGE
    return memory[start : start + size].reshape(shape)


def is_varied(k: StepCoefficients) -> bool:
    """Whether a coefficient other than the gain is a field."""
    return any(np.ndim(each) for each in (k.decay, k.spring, k.span))


def laid_out(k: StepCoefficients, fields: FieldLayout, *, varied: bool) -> StepCoefficients:
    """Coefficients as the loops read them: beside the gain all fields, or none."""
    each = (k.gain, k.decay, k.spring, k.span)
    return StepCoefficients(*map(fields.coefficients, np.broadcast_arrays(*each) if varied else each))


def part_runs(parts: NDArray[np.int32], fields: FieldLayout) -> PartRuns:
    """Runs of texels in coefficients, by the part of each texel, [C, n, n]."""
    beside = fields.coefficients(parts).reshape(-1)
    begins = np.flatnonzero(np.diff(beside, prepend=-1))
    return PartRuns(np.append(begins, beside.size), beside[begins].astype(np.int64))


def pressure(amplitude: Amplitude, runs: PartRuns | None, fields: FieldLayout) -> Coefficient:
    """An amplitude, one for all or one for each part, as a number, or where there are runs of parts as a field."""
    if runs is None:
        return np.float32(amplitude)
    amplitudes = np.full(int(runs.parts.max()) + 1, amplitude, np.float32)
    field: NDArray[np.float32] = np.repeat(amplitudes[runs.parts], np.diff(runs.begins))
    return field.reshape(-1, fields.n, fields.columns)


def volume_balance(operator: WaveOperator, dt: float, fields: FieldLayout, runs: PartRuns | None) -> Balance | None:
    """What keeps the volume over a substep of dt [s], if anything needs to; see `volume_rate`."""
    rate = volume_rate(operator, dt)
    if rate is None:
        return None
    addresses = fields.addresses[rate.texels]
    follows = np.append(False, np.diff(addresses) == 1)
    follows[rate.begins[:-1][rate.begins[:-1] < len(follows)]] = False
    starts = np.flatnonzero(~follows)
    loaded, total = np.zeros((2, len(rate.begins) - 1), np.float32)
    return Balance(
        np.searchsorted(starts, rate.begins),
        addresses[starts],
        np.append(starts, len(addresses)),
        rate.heights,
        rate.velocities,
        loaded,
        total,
        runs or part_runs(np.zeros(operator.mass.shape, np.int32), fields),
    )


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
            thread_count = blocks.available() if large else 1
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
            plan = blocks.Plan(substeps, self._most, length)
            blocks.advance(self._threads, plan, *step, self._start(dt / 2))
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
