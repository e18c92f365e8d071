"""Compiled loops of a wave step on the CPU: the nine-point stencil's force on a texel, and the step that it drives.

Nothing is contracted or reordered: every loop over texels gives the same numbers, and the two ends
of a link see the same force, so that momentum is kept. Rows are cut out of the fields before the
loop over columns: the compiler then makes better vector code of that loop.

Fields are float32 charts with halo, see `RowLayout`, and all of them are flat here: indices of
several axes take twice as long to compile. A coefficient is a number or a flat field [C n columns];
a number costs no read. Arrays that belong together are one argument.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numba
import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from ..kernel import Floats, Floats32, Ints, kernel

Coefficient: TypeAlias = Floats32 | np.float32

# Texels whose curvatures are taken at once: with their weights they stay in the fastest memory.
BLOCK = 512

# Of the operator's `response`: a number, or one for each of its parts.
Amplitude: TypeAlias = float | Floats

_NO_INTS = np.zeros(0, np.int64)
_NO_FLOATS = np.zeros(0, np.float32)


class Links(NamedTuple):
    """The irregular links of a stencil; see `IrregularLinks`. Often none.

    Flat indices of the texels in coefficients, their addresses in a field with halo, where the
    links of each begin, the addresses of their other ends, their weights.
    """

    texels: Ints
    addresses: Ints
    begins: Ints
    others: Ints
    weights: Floats32


class Weights(NamedTuple):
    """A stencil: its rows, [C, 4, n + 1, as wide as a field], the columns of texels, and its irregular links."""

    rows: Floats32
    columns: int
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
    below: Floats32, row: Floats32, above: Floats32,
    east: Floats32, north: Floats32, south: Floats32,
    rising: Floats32, risen: Floats32, falling: Floats32, fallen: Floats32,
    c: int,
) -> np.float32:  # fmt: skip
    """Sum over the eight links of weight (h_j - h_i) at column c.

    The first three are rows of the field below, at and above the texel; the others rows of its
    links, and of those of the places below. They are arguments of their own, since tuples take
    longer to compile.
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


@kernel(no_cpython_wrapper=True)
def apply(stencil: Weights, h: Floats32, factor: Coefficient, add: bool, out: Floats32) -> None:
    """The stencil on a field times a factor, written into `out` or added to it."""
    w = stencil.rows
    columns = stencil.columns
    n = w.shape[2] - 1
    pitch = w.shape[3]
    for i in range(len(w) * n):
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
        force = value_in(factor, irregular.texels[i]) * irregular_force(irregular, i, h)
        out[irregular.addresses[i]] += force


class Kick(NamedTuple):
    """v = decay v + gain (force + extra) - spring h + span acceleration; see `StepCoefficients`."""

    stencil: Weights
    gain: Floats32
    decay: Coefficient
    spring: Coefficient
    span: Coefficient
    extra: Coefficient  # where it is no number, a field with halo
    acceleration: Coefficient


class Balance(NamedTuple):
    """What keeps the volume, see `volume_rate`: factors of texels that lie side by side in runs.

    Where the runs of each part begin, [p + 1], the address of each run, [r], and where its factors
    begin, [r + 1]; what the load asks for and the sum, each [p]; the pressure, a coefficient, and
    the `part_runs` of its texels.
    """

    begins: Ints
    addresses: Ints
    runs: Ints
    heights: Floats32
    velocities: Floats32
    loaded: Floats32
    total: Floats32
    pressure: Floats32
    part_begins: Ints
    parts: Ints


class Squares(NamedTuple):
    """Bending by the squares of three curvatures; see `Curvatures`.

    Weights of the eight neighbours in each curvature, [8, 3, size] as coefficients; steps from an
    address to those of the neighbours, [8]; rows of texels in all, and in a chart; their columns,
    and addresses from one row to the next; a field for the forces, none without curvatures; room
    for a block of texels.
    """

    weights: Floats32
    steps: Ints
    rows: int
    chart_rows: int
    columns: int
    pitch: int
    force: Floats32
    scratch: Floats32


class Features(NamedTuple):
    """What few materials have, each empty where this one lacks it.

    Stencil of the viscosity; stencil of the Laplacian, rigidity, and a field for the moments of
    bending; the squares of a plate with rims; yield height, a field that is infinite in the halo,
    and the field of what stays; what keeps the volume. Lengths tell which are empty, not types:
    with one of them for every set of features, dozens would be compiled.
    """

    viscosity: Weights
    laplace: Weights
    rigidity: Floats32
    moment: Floats32
    squares: Squares
    limit: Floats32
    dent: Floats32
    balance: Balance


NO_WEIGHTS = Weights(
    np.zeros((0, 4, 0, 0), np.float32), 0, Links(_NO_INTS, _NO_INTS, _NO_INTS, _NO_INTS, _NO_FLOATS)
)
NO_BALANCE = Balance(
    _NO_INTS,
    _NO_INTS,
    _NO_INTS,
    _NO_FLOATS,
    _NO_FLOATS,
    _NO_FLOATS,
    _NO_FLOATS,
    _NO_FLOATS,
    _NO_INTS,
    _NO_INTS,
)
NO_SQUARES = Squares(
    np.zeros((0, 0, 0), np.float32), _NO_INTS, 0, 1, 0, 0, _NO_FLOATS, np.zeros((4, 0), np.float32)
)
NO_FEATURES = Features(
    NO_WEIGHTS, NO_WEIGHTS, _NO_FLOATS, _NO_FLOATS, NO_SQUARES, _NO_FLOATS, _NO_FLOATS, NO_BALANCE
)


@kernel(no_cpython_wrapper=True)
def bend(squares: Squares, h: Floats32, halo: Ints, add: bool, out: Floats32) -> None:
    """Force of the curvatures at each texel, written into `out` or added to it.

    Every curvature pulls at the texels from which it was taken, also at those that are the halo of
    another chart: what gathers there is handed to the texel that it shows.
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
    """Forces of the curvatures of texels side by side: their coefficients begin at `first`, they themselves at `at`."""
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
    """Weighted sums of heights or velocities that are taken after every substep: a sensor's points, or a sound.

    Sum i has the texels and weights from begins[i] to begins[i + 1]; those of `heights` are of
    heights, the others of velocities. `texels` are flat indices of texels, and addresses in a field
    where a backend holds them.
    """

    begins: Ints
    texels: Ints
    weights: Floats32
    heights: NDArray[np.bool_]

    @classmethod
    def together(cls, probes: Sequence[Probes]) -> Probes:
        """The sums of several, one after the other."""
        counts = np.concatenate([np.diff(each.begins) for each in probes])
        rest = (np.concatenate(each) for each in zip(*(each[1:] for each in probes), strict=True))
        return cls(np.append(0, np.cumsum(counts)), *rest)

    def of(self, height: NDArray, velocity: NDArray) -> NDArray[np.float64]:
        """The sums [k] of fields [C, n, n]; every sum has a texel."""
        both = (
            np.add.reduceat(self.weights * x.reshape(-1)[self.texels], self.begins[:-1])
            for x in (height, velocity)
        )
        return np.where(self.heights, *both)


@kernel(no_cpython_wrapper=True)
def _probe(
    probes: Probes, h: Floats32, v: Floats32, dent: Floats32, drifted: np.float32, sums: Floats32
) -> None:
    """Fill in the sums [k] of a substep, whose heights have drifted beyond its velocities [s]."""
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
def kick_drift(h: Floats32, v: Floats32, h_next: Floats32, kick: Kick, dt: np.float32) -> None:
    """One substep: v = decay v + gain force - spring h + span acceleration, then h_next = h + dt v.

    The small terms are added up first: one rounding at the size of the velocity, which else would
    gather over many substeps.
    """
    w = kick.stencil.rows
    columns = kick.stencil.columns
    n = w.shape[2] - 1
    pitch = w.shape[3]
    for i in range(len(w) * n):
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
        kicked = kick.gain[irregular.texels[i]] * irregular_force(irregular, i, h)
        address = irregular.addresses[i]
        v[address] += kicked
        h_next[address] += dt * kicked


@kernel
def fill(h: Floats32, halo: Ints) -> None:
    """Copy the texels beyond the charts' borders into the halo: addresses of its places and of the texels, [2, k]."""
    for i in range(halo.shape[1]):
        h[halo[0, i]] = h[halo[1, i]]


@kernel
def flow(h: Floats32, limit: Floats32, dent: Floats32) -> None:
    """Hand the part of the elastic height that is beyond the yield height over to the permanent one."""
    for i in range(len(h)):
        kept = min(max(h[i], -limit[i]), limit[i])
        dent[i] += h[i] - kept
        h[i] = kept


@kernel
def advance(
    substeps: int,
    dt: np.float32,
    h: Floats32,
    v: Floats32,
    h_next: Floats32,
    halo: Ints,
    kick: Kick,
    addresses: Ints,
    kicks: Floats32,
    viscosity: Weights | None,
    features: Features | None,
    probes: Probes | None,
    dent: Floats32,
    sums: Floats32,
) -> None:
    """Substeps of dt, from the first half drift to the last, and velocities [k] that kick the texels at addresses [k].

    The height ends in `h_next` where their number is odd.

    `sums` [substeps, k] are filled with those of the probes; `dent` is what stays of the height, or
    empty.

    What is None is compiled away: `features` where a material has no more than viscosity, which
    then is `viscosity`.
    """
    half = dt / np.float32(2)
    for i in range(len(h)):  # what that leaves in the halo is filled again
        h[i] += half * v[i]
    if features is not None and len(features.dent):
        flow(h, features.limit, features.dent)
    for step in range(substeps):
        fill(h, halo)
        if viscosity is not None:
            fill(v, halo)
            apply(viscosity, v, np.float32(1), False, kick.extra)
        if features is not None:
            _act(h, v, halo, features, kick.extra)
        drifted = dt if step < substeps - 1 else half
        kick_drift(h, v, h_next, kick, drifted)
        h, h_next = h_next, h
        for i in range(len(addresses)):
            v[addresses[i]] += kicks[i]
            h[addresses[i]] += drifted * kicks[i]
        if probes is not None:
            _probe(probes, h, v, dent, drifted - half, sums[step])
        if features is not None and len(features.dent):
            flow(h, features.limit, features.dent)


@kernel(no_cpython_wrapper=True)
def _act(h: Floats32, v: Floats32, halo: Ints, features: Features, extra: Floats32) -> None:
    """What a material's features add to a substep: forces in `extra`, and the pressure that keeps the volume."""
    drags = len(features.viscosity.rows) > 0
    if drags:
        fill(v, halo)
        apply(features.viscosity, v, np.float32(1), False, extra)
    if len(features.moment):
        apply(features.laplace, h, features.rigidity, False, features.moment)
        fill(features.moment, halo)
        apply(features.laplace, features.moment, np.float32(-1), drags, extra)
    if len(features.squares.force):
        bend(features.squares, h, halo, drags, extra)
    balance = features.balance
    # of which there are none where the density does not vary
    for part in range(len(balance.loaded)):
        total = 0.0
        for run in range(balance.begins[part], balance.begins[part + 1]):
            first = balance.runs[run]
            last = balance.runs[run + 1]
            address = balance.addresses[run]
            total += _weighed(balance.heights[first:last], h[address:])
            if len(balance.velocities):
                total += _weighed(balance.velocities[first:last], v[address:])
        balance.total[part] = balance.loaded[part] + np.float32(total)
    for i in range(len(balance.parts)):
        balance.pressure[balance.part_begins[i] : balance.part_begins[i + 1]] = balance.total[
            balance.parts[i]
        ]


@kernel(fastmath={"contract", "reassoc"}, no_cpython_wrapper=True)
def _weighed(factors: Floats32, field: Floats32) -> float:
    """Sum of factor times field over texels side by side."""
    total = 0.0
    for i in range(len(factors)):
        total += np.float64(factors[i] * field[i])
    return total
