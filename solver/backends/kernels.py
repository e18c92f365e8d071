"""Compiled loops over charts with halo, [C, n + 2, n + 2 or more] of float32; coefficients are numbers or [C, n, n]."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numba
import numpy as np
from numba.extending import overload

from ripple_sim.solver.kernel import Floats32, Ints, kernel

Coefficient: TypeAlias = Floats32 | np.float32


class State(NamedTuple):
    """Height [m], velocity [m/s], and where the next height goes, each with halo."""

    h: Floats32
    v: Floats32
    h_next: Floats32


class Halo(NamedTuple):
    """Addresses of the halo's places, [k], and of the texels that they show."""

    ghosts: Ints
    sources: Ints


class Links(NamedTuple):
    """The irregular links of a stencil; see `IrregularLinks`. Often none.

    Flat indices of the texels, their addresses in a field with halo, where the links of each begin, the addresses of
    their other ends, their weights.
    """

    texels: Ints
    addresses: Ints
    begins: Ints
    others: Ints
    weights: Floats32


class Weights(NamedTuple):
    """A stencil: its rows, [C, 4, n + 1, as wide as a field], and its irregular links."""

    rows: Floats32
    irregular: Links


class Kick(NamedTuple):
    """v = decay v + gain (force + extra) - spring h + span acceleration; see `StepCoefficients`."""

    stencil: Weights
    gain: Floats32
    decay: Coefficient
    spring: Coefficient
    span: Coefficient
    extra: Coefficient
    acceleration: np.float32


class Loads(NamedTuple):
    """Addresses of the texels that are kicked in each substep, [k], and by how much [m/s]."""

    addresses: Ints
    kicks: Floats32


class Bending(NamedTuple):
    """Stencil of the Laplacian, rigidity, and a field with halo for the moments."""

    laplace: Weights
    rigidity: Floats32
    moment: Floats32


class Plasticity(NamedTuple):
    """Yield height, and the field with halo of what stays."""

    limit: Coefficient
    dent: Floats32


def _row(x, f, r):
    """x[f, r] of an array, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(_row, inline="always")
def _row_overload(x, f, r):
    if isinstance(x, numba.types.Array):
        return lambda x, f, r: x[f, r]
    return lambda x, f, r: x


def _in(x, c):
    """x[c] of an array, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(_in, inline="always")
def _in_overload(x, c):
    if isinstance(x, numba.types.Array):
        return lambda x, c: x[c]
    return lambda x, c: x


def _texel(x, i):
    """Value at the texel of flat index i of an array, or the number x itself."""
    raise NotImplementedError("for compiled code only")


@overload(_texel, inline="always")
def _texel_overload(x, i):
    if isinstance(x, numba.types.Array):
        return lambda x, i: x.reshape(-1)[i]
    return lambda x, i: x


@kernel
def fill(h: Floats32, halo: Halo) -> None:
    """Copy the texels beyond the charts' borders into the halo."""
    flat = h.reshape(-1)
    for i in range(len(halo.ghosts)):
        flat[halo.ghosts[i]] = flat[halo.sources[i]]


@kernel
def kick_texels(h: Floats32, v: Floats32, loads: Loads, dt: np.float32) -> None:
    """Kick some texels, and drift them by that."""
    heights, velocities = h.reshape(-1), v.reshape(-1)
    for i in range(len(loads.addresses)):
        velocities[loads.addresses[i]] += loads.kicks[i]
        heights[loads.addresses[i]] += dt * loads.kicks[i]


@kernel
def drift(h: Floats32, v: Floats32, movable: Coefficient, shift: np.float32, dt: np.float32) -> None:
    """Add the shift to v where texels are movable, then dt v to h."""
    n = h.shape[1] - 2
    for i in range(len(h) * n):
        f, r = i // n, i % n + 1
        for c in range(1, n + 1):
            v[f, r, c] += shift * _in(_row(movable, f, r - 1), c - 1)
            h[f, r, c] += dt * v[f, r, c]


@kernel
def flow(h: Floats32, plasticity: Plasticity) -> None:
    """Hand the part of the elastic height that is beyond the yield height over to the permanent one."""
    n = h.shape[1] - 2
    dent = plasticity.dent
    for i in range(len(h) * n):
        f, r = i // n, i % n + 1
        for c in range(1, n + 1):
            most = _in(_row(plasticity.limit, f, r - 1), c - 1)
            kept = min(max(h[f, r, c], -most), most)
            dent[f, r, c] += h[f, r, c] - kept
            h[f, r, c] = kept


# Rows are cut out of the fields before the loop over columns: the compiler then makes better vector code of that loop.
# A product and a sum may be contracted to one rounding.
_FAST = {"contract"}


@kernel(inline="always")
def _force(rows, links, c):
    """Sum over the eight links of weight (h_j - h_i) at column c.

    `rows` are those of the field below, at and above the texel; `links` those of this row's places, and of those below.
    """
    below, row, above = rows
    east, north, south, rising, risen, falling, fallen = links
    x = row[c]
    return (
        (east[c] * (row[c + 1] - x) + east[c - 1] * (row[c - 1] - x))
        + (north[c] * (above[c] - x) + south[c] * (below[c] - x))
        + (rising[c] * (above[c + 1] - x) + risen[c - 1] * (below[c - 1] - x))
        + (falling[c - 1] * (above[c - 1] - x) + fallen[c] * (below[c + 1] - x))
    )


@kernel(inline="always")
def _links(w, f, r):
    """Rows of a stencil's links that meet in row r."""
    return w[f, 0, r], w[f, 1, r], w[f, 1, r - 1], w[f, 2, r], w[f, 2, r - 1], w[f, 3, r], w[f, 3, r - 1]


@kernel
def _irregular_force(links: Links, i: int, flat: Floats32) -> np.float32:
    """Sum of weight (h_j - h_i) over the irregular links of texel i of the list."""
    here, force = flat[links.addresses[i]], np.float32(0)
    for k in range(links.begins[i], links.begins[i + 1]):
        force += links.weights[k] * (flat[links.others[k]] - here)
    return force


@kernel(fastmath=_FAST)
def apply(stencil: Weights, h: Floats32, factor: Coefficient, add: bool, out: Floats32) -> None:
    """The stencil on a field times a factor, written into `out` or added to it."""
    n = h.shape[1] - 2
    for i in range(len(h) * n):
        f, r = i // n, i % n + 1
        rows, links = (h[f, r - 1], h[f, r], h[f, r + 1]), _links(stencil.rows, f, r)
        result = out[f, r]
        for c in range(1, n + 1):
            force = _in(_row(factor, f, r - 1), c - 1) * _force(rows, links, c)
            result[c] = result[c] + force if add else force
    irregular, flat, sums = stencil.irregular, h.reshape(-1), out.reshape(-1)
    for i in range(len(irregular.texels)):
        sums[irregular.addresses[i]] += _texel(factor, irregular.texels[i]) * _irregular_force(irregular, i, flat)


@kernel(fastmath=_FAST)
def kick_drift(state: State, kick: Kick, dt: np.float32, first: int, last: int) -> None:
    """One substep of some charts: v = decay v + gain force - spring h + span acceleration, then h_next = h + dt v."""
    h, v, h_next = state
    n = h.shape[1] - 2
    for f in range(first, last):
        for r in range(1, n + 1):
            row = h[f, r]
            rows, links = (h[f, r - 1], row, h[f, r + 1]), _links(kick.stencil.rows, f, r)
            velocity, gains, result = v[f, r], kick.gain[f, r - 1], h_next[f, r]
            more, decays, springs, spans = (
                _row(kick.extra, f, r),
                _row(kick.decay, f, r - 1),
                _row(kick.spring, f, r - 1),
                _row(kick.span, f, r - 1),
            )
            for c in range(1, n + 1):
                force = _force(rows, links, c)
                kicked = (
                    _in(decays, c - 1) * velocity[c]
                    + gains[c - 1] * (force + _in(more, c))
                    - _in(springs, c - 1) * row[c]
                    + _in(spans, c - 1) * kick.acceleration
                )
                velocity[c] = kicked
                result[c] = row[c] + dt * kicked


@kernel
def kick_irregular(state: State, kick: Kick, dt: np.float32) -> None:
    """What the irregular links add to a substep: the same kick, and the drift by it."""
    links, gain = kick.stencil.irregular, kick.gain.reshape(-1)
    heights, velocities, drifted = state.h.reshape(-1), state.v.reshape(-1), state.h_next.reshape(-1)
    for i in range(len(links.texels)):
        kicked = gain[links.texels[i]] * _irregular_force(links, i, heights)
        velocities[links.addresses[i]] += kicked
        drifted[links.addresses[i]] += dt * kicked


@kernel
def advance(
    substeps: int,
    dt: np.float32,
    state: State,
    halo: Halo,
    kick: Kick,
    loads: Loads,
    viscous: Weights | None,
    bends_yields: tuple[Bending | None, Plasticity | None],
) -> None:
    """Substeps of dt, from the first half drift to the last; the height ends in `h_next` where their number is odd.

    What a material lacks is None, and compiled away. The interpreter's lock is free all the while.
    """
    bending, plasticity = bends_yields
    half = dt / np.float32(2)
    h, v, h_next = state
    for step in range(substeps):
        fill(h, halo)
        _gather_extra(h, v, halo, kick, viscous, bending)
        drifted = dt if step < substeps - 1 else half
        kick_drift(State(h, v, h_next), kick, drifted, 0, len(h))
        kick_irregular(State(h, v, h_next), kick, drifted)
        h, h_next = h_next, h
        kick_texels(h, v, loads, drifted)
        _flow(h, plasticity)


@kernel
def _gather_extra(
    h: Floats32, v: Floats32, halo: Halo, kick: Kick, viscous: Weights | None, bending: Bending | None
) -> None:
    """Forces beside tension and stiffness, into `kick.extra`: viscous, and of bending."""
    if viscous is not None:
        fill(v, halo)
        apply(viscous, v, np.float32(1), False, kick.extra)
    if bending is not None:
        apply(bending.laplace, h, bending.rigidity, False, bending.moment)
        fill(bending.moment, halo)
        apply(bending.laplace, bending.moment, np.float32(-1), viscous is not None, kick.extra)


@kernel
def _flow(h: Floats32, plasticity: Plasticity | None) -> None:
    if plasticity is not None:
        flow(h, plasticity)
