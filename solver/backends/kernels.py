"""Compiled loops of a wave step on the CPU: forces of the nine-point stencil, and the step.

Nothing is contracted or reordered: every loop over texels gives the same numbers, and the two ends
of a link see the same force, so that momentum is kept. Rows are cut out of the fields before the
loop over columns: the compiler then makes better vector code of that loop.

Fields are float32 charts with halo, see `RowLayout`, and all of them are flat here: indices of
several axes take twice as long to compile. A coefficient is a number or a flat field [C n columns];
a number costs no read. Arrays that belong together are one argument.

Several threads may take a step together: each has a share of the rows, and of the addresses from
its first row to the next thread's. A crew of one thread does everything.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numba
import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from ..kernel import Floats, Floats32, Ints, kernel
from .meeting import Crew, meet, share

Coefficient: TypeAlias = Floats32 | np.float32

# Factor of the operator's `response`: one number, or a number for each part of the surface.
Amplitude: TypeAlias = float | Floats

# Texels whose curvatures are computed together: with their weights they stay in the fastest memory.
BLOCK = 512

_NO_INTS = np.zeros(0, np.int64)
_NO_FLOATS = np.zeros(0, np.float32)


class Links(NamedTuple):
    """The irregular links of a stencil; see `IrregularLinks`. Often there are none."""

    texels: Ints  # flat index of each texel in a coefficient, [k]
    addresses: Ints  # address of each texel in a field with halo, [k]
    begins: Ints  # where the links of each texel begin, [k + 1]
    others: Ints  # address of each link's other end, [links]
    weights: Floats32  # weight of each link, [links]


class Weights(NamedTuple):
    """The weights of a stencil."""

    rows: Floats32  # [C, 4, n + 1, pitch]: as wide as a field
    columns: int  # columns of texels
    irregular: Links


def row_of(x, first, count):
    """Values from `first` on of a flat field, or the number x itself."""
    return x[first : first + count] if np.ndim(x) else x


@overload(row_of)
def _compiled_row_of(x, first, count):
    if isinstance(x, numba.types.Array):
        return lambda x, first, count: x[first : first + count]
    return lambda x, first, count: x


def value_in(row, c):
    """Value in column c of a row, or the number itself."""
    return row[c] if np.ndim(row) else row


@overload(value_in)
def _compiled_value_in(row, c):
    if isinstance(row, numba.types.Array):
        return lambda row, c: row[c]
    return lambda row, c: row


@kernel(no_cpython_wrapper=True)
def force_at(
    below: Floats32,
    row: Floats32,
    above: Floats32,
    east: Floats32,
    north: Floats32,
    south: Floats32,
    rising: Floats32,
    risen: Floats32,
    falling: Floats32,
    fallen: Floats32,
    c: int,
) -> np.float32:
    """Sum over the eight links of weight (h_j - h_i) at column c.

    `below`, `row` and `above` are rows of the field. `east`, `north`, `rising` and `falling` are
    weights of the links that start in the texel's row; `south`, `risen` and `fallen` are weights of
    the links that start in the row below. They are separate arguments, since tuples take longer to
    compile.
    """
    x = row[c]
    return (
        (east[c] * (row[c + 1] - x) + east[c - 1] * (row[c - 1] - x))
        + (north[c] * (above[c] - x) + south[c] * (below[c] - x))
        + (rising[c] * (above[c + 1] - x) + risen[c - 1] * (below[c - 1] - x))
        + (falling[c - 1] * (above[c - 1] - x) + fallen[c] * (below[c + 1] - x))
    )


@kernel(no_cpython_wrapper=True)
def irregular_force(links: Links, i: int, h: Floats32) -> np.float32:
    """Sum of weight (h_j - h_i) over the irregular links of texel i of the list."""
    here = h[links.addresses[i]]
    force = np.float32(0)
    for k in range(links.begins[i], links.begins[i + 1]):
        force += links.weights[k] * (h[links.others[k]] - here)
    return force


class Share(NamedTuple):
    """What one thread does of a step."""

    first_row: int  # of all charts' rows
    last_row: int  # the row after the last
    first_address: int  # in a field with halo
    last_address: int  # the address after the last


@kernel(no_cpython_wrapper=True)
def share_of(stencil: Weights, size: int, crew: Crew) -> Share:
    """The rows of a thread, and its addresses in fields of `size` numbers.

    The thread's addresses end where the first row of the next thread begins.
    """
    n = stencil.rows.shape[2] - 1
    pitch = stencil.rows.shape[3]
    row_count = len(stencil.rows) * n
    first_row, last_row = share(row_count, crew)
    first_address = 0
    last_address = size
    if first_row > 0:
        first_address = (first_row // n * (n + 2) + first_row % n + 1) * pitch
    if last_row < row_count:
        last_address = (last_row // n * (n + 2) + last_row % n + 1) * pitch
    return Share(first_row, last_row, first_address, last_address)


@kernel(no_cpython_wrapper=True)
def apply(
    stencil: Weights, h: Floats32, factor: Coefficient, add: bool, out: Floats32, own: Share
) -> None:
    """Apply the stencil to a field, times a factor; write the result into `out`, or add it.

    Only at the thread's own texels.
    """
    w = stencil.rows
    columns = stencil.columns
    n = w.shape[2] - 1
    pitch = w.shape[3]
    for i in range(own.first_row, own.last_row):
        chart = i // n
        r = i % n + 1
        at = (chart * (n + 2) + r) * pitch
        below = h[at - pitch : at]
        row = h[at : at + pitch]
        above = h[at + pitch : at + 2 * pitch]
        east = w[chart, 0, r]
        north = w[chart, 1, r]
        south = w[chart, 1, r - 1]
        rising = w[chart, 2, r]
        risen = w[chart, 2, r - 1]
        falling = w[chart, 3, r]
        fallen = w[chart, 3, r - 1]
        factors = row_of(factor, i * columns, columns)
        result = out[at : at + pitch]
        for c in range(1, columns + 1):
            force = force_at(
                below, row, above, east, north, south, rising, risen, falling, fallen, c
            )
            force *= value_in(factors, c - 1)
            result[c] = result[c] + force if add else force
    irregular = stencil.irregular
    for i in range(len(irregular.texels)):
        address = irregular.addresses[i]
        if own.first_address <= address < own.last_address:
            force = value_in(factor, irregular.texels[i]) * irregular_force(irregular, i, h)
            out[address] += force


class Kick(NamedTuple):
    """v = decay v + gain (force + extra) - spring h + span acceleration; see `StepCoefficients`."""

    stencil: Weights
    gain: Floats32
    decay: Coefficient
    spring: Coefficient
    span: Coefficient
    extra: Coefficient  # where it is no number, a field with halo
    acceleration: Coefficient


class State(NamedTuple):
    """The fields of a surface, flat, with halo, and their halo."""

    h: Floats32  # height [m]
    v: Floats32  # velocity [m/s]
    h_next: Floats32  # room for the height of the next substep
    dent: Floats32  # permanent part of the height [m]; empty where there is none
    halo: Ints  # addresses of the halo's places, and of the texels that they show, [2, k]


class Pulses(NamedTuple):
    """Velocities that a load adds to some texels in every substep."""

    addresses: Ints  # of the texels in a field with halo, [k]
    velocities: Floats32  # [m/s], [k]


class Balance(NamedTuple):
    """The factors and the pressure that keep the volume, see `volume_rate`.

    Texels that lie side by side are one run. There are p parts of the surface and r runs.
    """

    begins: Ints  # where the runs of each part begin, [p + 1]
    addresses: Ints  # address of each run's first texel, [r]
    runs: Ints  # where the factors of each run begin, [r + 1]
    heights: Floats32  # factors of the heights
    velocities: Floats32  # factors of the velocities, or none
    loaded: Floats32  # acceleration that the load asks for, [p]
    total: Floats32  # that acceleration and the balance together, [p]
    pressure: Floats32  # `total` at every texel: a coefficient
    part_begins: Ints  # where the runs of `pressure` begin, see `part_runs`
    parts: Ints  # the part of each of those runs


class Squares(NamedTuple):
    """Bending by the squares of three curvatures; see `Curvatures`."""

    weights: Floats32  # of the eight neighbours in each curvature, as coefficients, [8, 3, size]
    steps: Ints  # from an address to the address of each neighbour, [8]
    rows: int  # rows of texels in all charts
    chart_rows: int  # rows of texels in one chart
    columns: int  # columns of texels
    pitch: int  # addresses from one row to the next
    force: Floats32  # a field for the forces; empty without curvatures
    scratch: Floats32  # room for a block of texels, [4, BLOCK]


class Features(NamedTuple):
    """Properties that few materials have; each is empty where a material lacks it.

    Lengths tell which are empty, not types: with a type for every set of features, dozens of
    versions would be compiled.
    """

    laplace: Weights  # bending: stencil of the Laplacian
    rigidity: Floats32  # bending: a coefficient [N m]
    moment: Floats32  # bending: a field for the moments [N]
    squares: Squares  # bending of a plate with rims
    limit: Floats32  # yield height [m], a field; infinite in the halo
    balance: Balance  # where the density varies


_NO_LINKS = Links(
    texels=_NO_INTS, addresses=_NO_INTS, begins=_NO_INTS, others=_NO_INTS, weights=_NO_FLOATS
)
NO_WEIGHTS = Weights(rows=np.zeros((0, 4, 0, 0), np.float32), columns=0, irregular=_NO_LINKS)
NO_BALANCE = Balance(
    begins=_NO_INTS,
    addresses=_NO_INTS,
    runs=_NO_INTS,
    heights=_NO_FLOATS,
    velocities=_NO_FLOATS,
    loaded=_NO_FLOATS,
    total=_NO_FLOATS,
    pressure=_NO_FLOATS,
    part_begins=_NO_INTS,
    parts=_NO_INTS,
)
NO_SQUARES = Squares(
    weights=np.zeros((0, 0, 0), np.float32),
    steps=_NO_INTS,
    rows=0,
    chart_rows=1,
    columns=0,
    pitch=0,
    force=_NO_FLOATS,
    scratch=np.zeros((4, 0), np.float32),
)
NO_FEATURES = Features(
    laplace=NO_WEIGHTS,
    rigidity=_NO_FLOATS,
    moment=_NO_FLOATS,
    squares=NO_SQUARES,
    limit=_NO_FLOATS,
    balance=NO_BALANCE,
)


@kernel(no_cpython_wrapper=True)
def bend(squares: Squares, h: Floats32, halo: Ints, add: bool, out: Floats32) -> None:
    """Write the force of the curvatures at each texel into `out`, or add it.

    Every curvature pulls at the texels from which it was computed, also at places of the halo. A
    force on a place of the halo is then handed to the texel that the place shows.
    """
    columns = squares.columns
    force = squares.force
    force[:] = np.float32(0)
    for i in range(squares.rows):
        at = _first_of_row(squares, i)
        for begin in range(0, columns, BLOCK):
            count = min(BLOCK, columns - begin)
            _pull_neighbours(squares, i * columns + begin, at + begin, count, h, force)
    for i in range(halo.shape[1]):
        force[halo[1, i]] += force[halo[0, i]]
    for i in range(squares.rows):
        at = _first_of_row(squares, i)
        pull = force[at : at + columns]
        result = out[at : at + columns]
        for c in range(columns):
            result[c] = result[c] + pull[c] if add else pull[c]


@kernel(no_cpython_wrapper=True)
def _first_of_row(squares: Squares, i: int) -> int:
    """Address of the first texel of row i, of all charts."""
    chart = i // squares.chart_rows
    row = i % squares.chart_rows
    return (chart * (squares.chart_rows + 2) + row + 1) * squares.pitch + 1


@kernel(no_cpython_wrapper=True)
def _pull_neighbours(
    squares: Squares, first: int, at: int, count: int, h: Floats32, force: Floats32
) -> None:
    """Add the forces of the curvatures of texels that lie side by side.

    Their coefficients begin at `first`, and the texels at the address `at`.
    """
    own = squares.scratch[0]
    uu = squares.scratch[1]
    vv = squares.scratch[2]
    uv = squares.scratch[3]
    row = h[at : at + count]
    for c in range(count):
        own[c] = uu[c] = vv[c] = uv[c] = np.float32(0)
    for k in range(len(squares.steps)):
        start = at + squares.steps[k]
        beside = h[start : start + count]
        weights = squares.weights[k]
        to_uu = weights[0, first : first + count]
        to_vv = weights[1, first : first + count]
        to_uv = weights[2, first : first + count]
        for c in range(count):
            difference = beside[c] - row[c]
            uu[c] += to_uu[c] * difference
            vv[c] += to_vv[c] * difference
            uv[c] += to_uv[c] * difference
    for k in range(len(squares.steps)):
        start = at + squares.steps[k]
        pulled = force[start : start + count]
        weights = squares.weights[k]
        to_uu = weights[0, first : first + count]
        to_vv = weights[1, first : first + count]
        to_uv = weights[2, first : first + count]
        for c in range(count):
            pull = to_uu[c] * uu[c] + to_vv[c] * vv[c] + to_uv[c] * uv[c]
            pulled[c] -= pull
            own[c] += pull
    here = force[at : at + count]
    for c in range(count):
        here[c] += own[c]


class Probes(NamedTuple):
    """Weighted sums of heights or velocities after every substep: a sensor's points, or a sound."""

    begins: Ints  # where the texels and weights of each sum begin, [k + 1]
    texels: Ints  # flat indices of texels; in a backend addresses in a field
    weights: Floats32
    heights: NDArray[np.bool_]  # whether each sum is of heights, else of velocities, [k]

    @classmethod
    def together(cls, probes: Sequence[Probes]) -> Probes:
        """The sums of several probes, one after the other."""
        counts = np.concatenate([np.diff(each.begins) for each in probes])
        return cls(
            begins=np.append(0, np.cumsum(counts)),
            texels=np.concatenate([each.texels for each in probes]),
            weights=np.concatenate([each.weights for each in probes]),
            heights=np.concatenate([each.heights for each in probes]),
        )

    def of(self, height: NDArray, velocity: NDArray) -> NDArray[np.float64]:
        """The sums [k] of fields [C, n, n]; every sum has a texel."""
        return np.where(self.heights, self._sums(height), self._sums(velocity))

    def _sums(self, field: NDArray) -> NDArray[np.float64]:
        """The sums [k] of one field [C, n, n]."""
        weighted = self.weights * field.reshape(-1)[self.texels]
        return np.add.reduceat(weighted, self.begins[:-1])


class ProbedSums(NamedTuple):
    """Probes, and the sums that they took."""

    probes: Probes
    sums: Floats32  # [substeps, k]


@kernel(no_cpython_wrapper=True)
def _probe(
    probes: Probes, h: Floats32, v: Floats32, dent: Floats32, drifted: np.float32, sums: Floats32
) -> None:
    """Fill in the sums [k] of a substep.

    Its heights have drifted for `drifted` [s] beyond the time of its velocities.
    """
    for i in range(len(sums)):
        total = 0.0
        for j in range(probes.begins[i], probes.begins[i + 1]):
            at = probes.texels[j]
            value = v[at]
            if probes.heights[i]:
                value = h[at] - drifted * v[at]
                if len(dent):
                    value += dent[at]
            total += probes.weights[j] * value
        sums[i] = total


@kernel(no_cpython_wrapper=True)
def kick_drift(
    h: Floats32, v: Floats32, h_next: Floats32, kick: Kick, dt: np.float32, own: Share
) -> None:
    """One substep: v = decay v + gain force - spring h + span acceleration, then h_next = h + dt v.

    Only at the thread's own texels.

    The small terms are added up first: a rounding at the size of the velocity happens once a
    substep. Such roundings would gather over many substeps.
    """
    w = kick.stencil.rows
    columns = kick.stencil.columns
    n = w.shape[2] - 1
    pitch = w.shape[3]
    for i in range(own.first_row, own.last_row):
        chart = i // n
        r = i % n + 1
        first = i * columns
        at = (chart * (n + 2) + r) * pitch
        below = h[at - pitch : at]
        row = h[at : at + pitch]
        above = h[at + pitch : at + 2 * pitch]
        velocity = v[at : at + pitch]
        result = h_next[at : at + pitch]
        east = w[chart, 0, r]
        north = w[chart, 1, r]
        south = w[chart, 1, r - 1]
        rising = w[chart, 2, r]
        risen = w[chart, 2, r - 1]
        falling = w[chart, 3, r]
        fallen = w[chart, 3, r - 1]
        gain = kick.gain[first : first + columns]
        decay = row_of(kick.decay, first, columns)
        spring = row_of(kick.spring, first, columns)
        span = row_of(kick.span, first, columns)
        extra = row_of(kick.extra, at, pitch)
        acceleration = row_of(kick.acceleration, first, columns)
        for c in range(1, columns + 1):
            held = (
                value_in(span, c - 1) * value_in(acceleration, c - 1)
                - value_in(spring, c - 1) * row[c]
            )
            force = force_at(
                below, row, above, east, north, south, rising, risen, falling, fallen, c
            )
            new = value_in(decay, c - 1) * velocity[c] + (
                gain[c - 1] * (force + value_in(extra, c)) + held
            )
            velocity[c] = new
            result[c] = row[c] + dt * new
    irregular = kick.stencil.irregular
    for i in range(len(irregular.texels)):
        address = irregular.addresses[i]
        if own.first_address <= address < own.last_address:
            kicked = kick.gain[irregular.texels[i]] * irregular_force(irregular, i, h)
            v[address] += kicked
            h_next[address] += dt * kicked


@kernel(no_cpython_wrapper=True)
def fill(h: Floats32, halo: Ints, crew: Crew) -> None:
    """Copy the texels beyond the charts' borders into the halo: this thread's share of it.

    `halo` [2, k] has the addresses of the halo's places, and of the texels that they show.
    """
    first, last = share(halo.shape[1], crew)
    for i in range(first, last):
        h[halo[0, i]] = h[halo[1, i]]


@kernel(no_cpython_wrapper=True)
def flow(h: Floats32, limit: Floats32, dent: Floats32, own: Share) -> None:
    """Move the part of the elastic height beyond the yield height into the permanent height.

    Only at the thread's own texels.
    """
    own_h = h[own.first_address : own.last_address]
    own_limit = limit[own.first_address : own.last_address]
    own_dent = dent[own.first_address : own.last_address]
    for i in range(len(own_h)):
        elastic = min(max(own_h[i], -own_limit[i]), own_limit[i])
        own_dent[i] += own_h[i] - elastic
        own_h[i] = elastic


@kernel
def advance(
    substeps: int,
    dt: np.float32,
    state: State,
    kick: Kick,
    pulses: Pulses,
    viscosity: Weights | None,
    features: Features | None,
    probed: ProbedSums | None,
    crew: Crew,
) -> None:
    """Take substeps of dt [s], from the first half drift to the last.

    The height ends in `state.h_next` where the number of substeps is odd. The sums of the probes
    are filled in. Code for an argument that is None is compiled away. All threads of the crew call
    this function; each steps its own texels. Curvatures and a volume that is kept need a crew of
    one thread.
    """
    half = dt / np.float32(2)
    h = state.h
    v = state.v
    h_next = state.h_next
    dent = state.dent
    halo = state.halo
    own = share_of(kick.stencil, len(h), crew)
    if not meet(crew):
        return  # the step is abandoned before it began
    drift(h, v, half, own)
    if features is not None and len(features.limit):
        flow(h, features.limit, dent, own)
    for step in range(substeps):
        meet(crew)  # all heights and velocities are known
        fill(h, halo, crew)
        if viscosity is not None:
            fill(v, halo, crew)
        meet(crew)  # the halo is filled
        if viscosity is not None:
            apply(viscosity, v, np.float32(1), False, kick.extra, own)
        if features is not None:
            _bend(h, halo, features, viscosity is not None, kick.extra, own, crew)
            _keep_volume(features.balance, h, v)
        if viscosity is not None:
            meet(crew)  # nobody reads the velocities of others any more
        drifted = dt if step < substeps - 1 else half
        kick_drift(h, v, h_next, kick, drifted, own)
        h, h_next = h_next, h
        push(h, v, pulses, drifted, own)
        if probed is not None:
            meet(crew)  # all heights and velocities are known
            if crew.rank == 0:
                _probe(probed.probes, h, v, dent, drifted - half, probed.sums[step])
            meet(crew)  # the sums are taken
        if features is not None and len(features.limit):
            flow(h, features.limit, dent, own)


@kernel(no_cpython_wrapper=True)
def drift(h: Floats32, v: Floats32, dt: np.float32, own: Share) -> None:
    """Add dt v to h at the thread's own addresses; the halo among them is filled again later."""
    own_h = h[own.first_address : own.last_address]
    own_v = v[own.first_address : own.last_address]
    for i in range(len(own_h)):
        own_h[i] += dt * own_v[i]


@kernel(no_cpython_wrapper=True)
def push(h: Floats32, v: Floats32, pulses: Pulses, dt: np.float32, own: Share) -> None:
    """Add the pulses to the velocities, and to the heights that have drifted for dt [s] since.

    Only at the thread's own texels.
    """
    for i in range(len(pulses.addresses)):
        address = pulses.addresses[i]
        if own.first_address <= address < own.last_address:
            v[address] += pulses.velocities[i]
            h[address] += dt * pulses.velocities[i]


@kernel(no_cpython_wrapper=True)
def _bend(
    h: Floats32,
    halo: Ints,
    features: Features,
    add: bool,
    extra: Floats32,
    own: Share,
    crew: Crew,
) -> None:
    """Write the forces of bending into `extra`, or add them; nothing without bending."""
    if len(features.moment):
        apply(features.laplace, h, features.rigidity, False, features.moment, own)
        meet(crew)  # all moments are known
        fill(features.moment, halo, crew)
        meet(crew)  # their halo is filled
        apply(features.laplace, features.moment, np.float32(-1), add, extra, own)
    if len(features.squares.force):
        bend(features.squares, h, halo, add, extra)


@kernel(no_cpython_wrapper=True)
def _keep_volume(balance: Balance, h: Floats32, v: Floats32) -> None:
    """Set the pressure that keeps the volume; nothing where the density does not vary."""
    for part in range(len(balance.loaded)):
        total = 0.0
        for run in range(balance.begins[part], balance.begins[part + 1]):
            first = balance.runs[run]
            last = balance.runs[run + 1]
            address = balance.addresses[run]
            total += _weighted_sum(balance.heights[first:last], h[address:])
            if len(balance.velocities):
                total += _weighted_sum(balance.velocities[first:last], v[address:])
        balance.total[part] = balance.loaded[part] + np.float32(total)
    for i in range(len(balance.parts)):
        first = balance.part_begins[i]
        last = balance.part_begins[i + 1]
        balance.pressure[first:last] = balance.total[balance.parts[i]]


@kernel(fastmath={"contract", "reassoc"}, no_cpython_wrapper=True)
def _weighted_sum(factors: Floats32, field: Floats32) -> float:
    """Sum of factor times field over texels side by side."""
    total = 0.0
    for i in range(len(factors)):
        total += np.float64(factors[i] * field[i])
    return total
