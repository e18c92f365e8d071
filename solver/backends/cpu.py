"""CPU backend: the leapfrog update as one pass over the texels, compiled by numba.

One thread: a substep takes 0.07 ms at N = 128 and 0.3 ms at N = 256, less than a helper may wait
for its core while other threads render and encode. Waiting for it then costs more than two threads
gain.
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
from .field_backend import FieldBackend
from .kernels import (
    NO_BALANCE,
    NO_FEATURES,
    NO_WEIGHTS,
    Amplitude,
    Balance,
    Coefficient,
    Kick,
    Links,
    Squares,
    Weights,
)

# Below this resolution charts lie side by side, row by row: one loop then runs over a row of all of
# them. On charts of 12 columns, loops that begin anew for each take four times as long.
SMALL = 64

# Floats of a cache line, and of a page of memory.
LINE = 16
PAGE = 1024


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
        self._alone = self.n >= SMALL or self._charts == 1
        width = self.n + 2
        if self._alone:
            self.columns = self.n
            self._pitch = -(-width // LINE) * LINE
        else:
            self.columns = self._charts * width - 2
            self._pitch = (self._charts + 1) * width
        texels, ghosts, sources = topology.addresses
        self.addresses = self._address(texels)
        self.halo = np.stack([self._address(ghosts), self._address(sources)])
        if topology.fixed_rim and not self._alone:
            # loops run over these: they are set to 0 again
            beside = np.flatnonzero(topology.rim)
            beside = self._address(beside[(beside // width % width % (width - 1)) > 0])
            self.halo = np.append(
                self.halo, [beside, np.full(len(beside), self._pitch - 1)], axis=1
            )

    def zeros(self, shift: int = 0) -> NDArray[np.float32]:
        """A field with halo; its first texel, or that of every row of a chart alone, begins a cache line."""
        return aligned((self._charts if self._alone else 1, self.n + 2, self._pitch), 1, shift)

    def coefficients(self, field: NDArray | np.float32) -> Any:
        """A field [C, n, n] as loops read it beside one with halo: flat, [C n columns], 0 between; or a number."""
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
        """A stencil laid out like a field, and its irregular links; the rows of another one are written over."""
        count = self._charts
        if not rows.size:
            rows = aligned((count if self._alone else 1, 4, self.n + 1, self._pitch), 1)
        if self._alone:
            rows[..., : self.n + 1] = stencil.weights
        else:
            beside = rows.reshape(4, self.n + 1, count + 1, self.n + 2)
            beside[:, :, :count, : self.n + 1] = stencil.weights.transpose(1, 2, 0, 3)
        links = stencil.irregular
        addresses = self.addresses
        texels = links.texels
        weights = links.weights.astype(np.float32)
        irregular = Links(
            self.places[texels], addresses[texels], links.begins, addresses[links.others], weights
        )
        return Weights(rows, self.columns, irregular)

    def squares(self, bending: Curvatures) -> Squares:
        """Weights of curvatures laid out like coefficients, and room for their forces."""
        by_neighbour = bending.weights.astype(np.float32).swapaxes(0, 1)
        weights = np.stack(
            [[self.coefficients(weight) for weight in kinds] for kinds in by_neighbour]
        )
        steps = np.array([row * self._pitch + column for row, column in STEPS])
        rows = weights.shape[-1] // self.columns
        scratch = np.zeros((4, kernels.BLOCK), np.float32)
        return Squares(
            weights,
            steps,
            rows,
            self.n,
            self.columns,
            self._pitch,
            self.zeros().reshape(-1),
            scratch,
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
        """Replace a field's texels; all else becomes 0, also what was no number between charts."""
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
    """Zeros, of four bytes each, whose first row has the given column `shift` of them into a page."""
    size = int(np.prod(shape))
    memory = np.zeros(size + PAGE, dtype)
    start = (shift - column - memory.ctypes.data // memory.itemsize) % PAGE
    return memory[start : start + size].reshape(shape)


def part_runs(
    operator: WaveOperator, fields: RowLayout
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Runs of texels in coefficients that belong to one part: where each begins, [k + 1], and its part, [k]."""
    parts = np.zeros(operator.mass.shape, np.int32) if operator.parts is None else operator.parts
    beside = fields.coefficients(parts)
    begins = np.flatnonzero(np.diff(beside, prepend=-1))
    return np.append(begins, beside.size), beside[begins].astype(np.int64)


def volume_balance(
    operator: WaveOperator, dt: float, conserve: bool | None, fields: RowLayout
) -> Balance | None:
    """What keeps the volume over a substep of dt [s], if anything needs to; see `volume_rate`."""
    rate = volume_rate(operator, dt, conserve)
    if rate is None:
        return None
    begins, texels, heights, velocities = rate
    addresses = fields.addresses[texels]
    follows = np.append(False, np.diff(addresses) == 1)
    follows[begins[:-1][begins[:-1] < len(follows)]] = False
    starts = np.flatnonzero(~follows)
    runs = np.searchsorted(starts, begins), addresses[starts], np.append(starts, len(addresses))
    loaded, total = np.zeros((2, len(begins) - 1), np.float32)
    pressure = fields.coefficients(np.zeros(operator.mass.shape, np.float32))
    return Balance(
        *runs, heights, velocities, loaded, total, pressure, *part_runs(operator, fields)
    )


class CPUBackend(FieldBackend):
    """Height and velocity in float32 charts with halo."""

    name = "cpu"

    def __init__(self, operator: WaveOperator, *, keeps_volume: bool | None = False) -> None:
        self.keeps_volume = keeps_volume
        self._fields = fields = RowLayout(operator.topology)
        # the processor takes a store to one field and a load from another at the same place of a
        # page for a conflict: each field begins elsewhere in its page
        self._h, self._h_next, self._v = (
            fields.zeros(shift * PAGE // 3 // LINE * LINE) for shift in range(3)
        )
        self._stencil = NO_WEIGHTS
        self._features = NO_FEATURES
        if isinstance(operator.bending, Bending):
            self._features = self._features._replace(moment=fields.zeros().reshape(-1))
        elif operator.bending is not None:
            self._features = self._features._replace(squares=fields.squares(operator.bending))
        if operator.yield_height is not None:
            self._dent = fields.zeros()
            limit = np.full_like(self._dent, np.inf)
            fields.texels(limit)[:] = operator.yield_height
            self._features = self._features._replace(
                limit=limit.reshape(-1), dent=self._dent.reshape(-1)
            )
        self.move(operator)
        self._response = fields.coefficients(number_or_field(operator.response))
        self._part_runs = None if operator.parts is None else part_runs(operator, fields)
        self._part_count = 1 if operator.parts is None else int(operator.parts.max()) + 1
        self._balance: Balance | None = None
        self._extra: Coefficient = np.float32(0)
        self._shift: Amplitude | None = None  # of velocities, which the next drift adds
        self._prepared = (0.0, keeps_volume)
        self.load(np.zeros(0, np.int64), np.zeros(0), 0.0)

    def kick(
        self, texels: NDArray[np.int64], velocities: NDArray[np.float32], everywhere: Amplitude
    ) -> None:
        """Add velocities [m/s] to some texels (each named once), and one to all, as they respond.

        The latter is only noted: the next step adds all at once.
        """
        self._v.reshape(-1)[self._fields.addresses[texels]] += velocities
        self._shift = everywhere if self._shift is None else self._shift + everywhere

    def load(
        self, texels: NDArray[np.int64], forces: NDArray[np.float64], everywhere: Amplitude
    ) -> None:
        """Hold forces [N] on some texels, and one acceleration [m/s^2] on all, until the next call."""
        self._loaded = texels
        self._load_forces = forces
        self._acceleration = everywhere
        self._load_is_new = True

    def advance(self, substeps: int, dt: float) -> None:
        """Take leapfrog substeps of dt [s]: drift, kick, drift, with touching drifts joined."""
        k = self._prepare(dt)
        balance = self._balance
        acceleration = self._pressure(self._acceleration) if balance is None else balance.pressure
        kick = Kick(self._stencil, k.gain, k.decay, k.spring, k.span, self._extra, acceleration)
        self._apply_kicks()
        features = self._features
        drags = self._plain and len(features.viscosity.rows) > 0
        self._sums = np.zeros(
            (substeps, 0 if self._probes is None else len(self._probes.heights)), np.float32
        )
        fields = (field.reshape(-1) for field in (self._h, self._v, self._h_next))
        dent = NO_WEIGHTS.irregular.weights if self._dent is None else self._dent.reshape(-1)
        acting = (
            features.viscosity if drags else None,
            None if self._plain else features,
            self._probes,
            dent,
        )
        kernels.advance(
            substeps,
            np.float32(dt),
            *fields,
            self._fields.halo,
            kick,
            *self._kicks,
            *acting,
            self._sums,
        )
        if substeps % 2:
            self._h, self._h_next = self._h_next, self._h
        if self._crests is not None:
            self._raise_crests()

    def probe(self, probes: kernels.Probes | None) -> None:
        """Take sums of texels after every substep from now on; None ends it."""
        self._probes = probes and probes._replace(texels=self._fields.addresses[probes.texels])

    def move(self, operator: WaveOperator) -> None:
        """Take over the stencils of the same surface with its texels elsewhere."""
        self._operator = operator
        fields = self._fields
        self._stencil = fields.weights(operator.stencil, self._stencil.rows)
        features = self._features
        if operator.viscosity_stencil is not None:
            features = features._replace(
                viscosity=fields.weights(operator.viscosity_stencil, features.viscosity.rows)
            )
        if isinstance(operator.bending, Bending):
            rigidity = fields.coefficients(operator.bending.rigidity.astype(np.float32))
            laplace = fields.weights(operator.bending.laplace, features.laplace.rows)
            features = features._replace(laplace=laplace, rigidity=rigidity)
        self._features = features
        if operator.density is not None:
            self._prepared = (0.0, self.keeps_volume)  # what keeps the volume follows the stencils

    def _raise_crests(self) -> None:
        # the next height is but scratch between steps
        height = self._h if self._dent is None else np.add(self._h, self._dent, out=self._h_next)
        np.maximum(self._crests, np.abs(height, out=self._h_next), out=self._crests)

    def _apply_kicks(self) -> None:
        if self._shift is not None:
            shift = self._pressure(self._shift) * self._response
            velocities = self._v[:, 1:-1, 1 : self._fields.columns + 1]
            velocities += shift.reshape(velocities.shape) if shift.ndim else shift
            self._shift = None

    def _drop_kicks(self) -> None:
        self._shift = None

    def _pressure(self, amplitude: Amplitude) -> Coefficient:
        """An amplitude, one for all or one for each part, as the loops take it: a number, or a flat field."""
        if self._part_runs is None:
            return np.float32(amplitude)
        begins, parts = self._part_runs
        return np.repeat(
            np.broadcast_to(np.float32(amplitude), self._part_count)[parts], np.diff(begins)
        )

    def _prepare(self, dt: float) -> StepCoefficients:
        """Coefficients of the kick, computed once a step length, and the load's, once a load as well."""
        new_length = self._prepared != (dt, self.keeps_volume)
        if new_length:
            self._balance = volume_balance(self._operator, dt, self.keeps_volume, self._fields)
            self._features = self._features._replace(balance=self._balance or NO_BALANCE)
            k = step_coefficients(self._operator, dt)
            varied = any(np.ndim(each) for each in (k.decay, k.spring, k.span))
            varied = varied or self._part_runs is not None or self._balance is not None
            # beside the gain all of them are fields, or none
            each = (k.gain, k.decay, k.spring, k.span)
            laid_out = map(
                self._fields.coefficients, np.broadcast_arrays(*each) if varied else each
            )
            self._coefficients = StepCoefficients(*laid_out)
            features = self._features
            self._plain = not (
                varied or len(features.moment) or len(features.squares.force) or len(features.dent)
            )
            # a field where forces are added up, or the number 0
            drags = len(features.viscosity.rows) > 0 or not self._plain
            if drags != bool(np.ndim(self._extra)):
                self._extra = self._fields.zeros().reshape(-1) if drags else np.float32(0)
            self._prepared = (dt, self.keeps_volume)
        k = self._coefficients
        if new_length or self._load_is_new:
            kicks = k.gain[self._fields.places[self._loaded]] * self._load_forces.astype(np.float32)
            self._kicks = self._fields.addresses[self._loaded], kicks
            if self._balance is not None:
                self._balance.loaded[:] = self._acceleration
            self._load_is_new = False
        return k
