"""Arguments of the compiled loops: arrays that belong together, as one argument each."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from ..kernel import Floats, Floats32, Ints

Coefficient: TypeAlias = Floats32 | np.float32

# Of the operator's `response`: a number, or one for each of its parts.
Amplitude: TypeAlias = float | Floats


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

    Flat indices of the texels in coefficients, their addresses in a field with halo, where the links of each begin, the
    addresses of their other ends, their weights.
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


class Kick(NamedTuple):
    """v = decay v + gain (force + extra) - spring h + span acceleration; see `StepCoefficients`."""

    stencil: Weights
    gain: Floats32
    decay: Coefficient
    spring: Coefficient
    span: Coefficient
    extra: Coefficient
    acceleration: Coefficient


class Drift(NamedTuple):
    """v += shift as far as texels respond, then h += dt v, in so many columns."""

    columns: int

    response: Coefficient
    shift: Coefficient
    dt: np.float32


class PartRuns(NamedTuple):
    """Texels side by side in coefficients that belong to one part of the surface; see `floating_parts`.

    Where each run begins, [k + 1], and its part, [k].
    """

    begins: Ints
    parts: Ints


class Balance(NamedTuple):
    """What keeps the volume, see `VolumeRate`: factors of texels that lie side by side in runs.

    Where the runs of each part begin, [p + 1], the address of each run, [r], and where its factors begin, [r + 1]; what
    the load asks for and the sum, each [p]; where the sums count.
    """

    begins: Ints
    addresses: Ints
    runs: Ints
    heights: Floats32
    velocities: Floats32
    loaded: Floats32
    total: Floats32
    spread: PartRuns


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
    """Yield height, and the field with halo of what stays, in so many columns."""

    columns: int

    limit: Coefficient
    dent: Floats32


class Features(NamedTuple):
    """What few materials have, each empty where this one lacks it: viscous stencil, bending, yielding, volume kept.

    Lengths tell which are empty, not types: with one of them for every set of features, dozens would be compiled.
    """

    viscous: Weights
    bending: Bending
    plasticity: Plasticity
    balance: Balance


_NO_INTS, _NO_FLOATS, _NO_FIELD = np.zeros(0, np.int64), np.zeros(0, np.float32), np.zeros((0, 0, 0), np.float32)
_NO_WEIGHTS = Weights(np.zeros((0, 4, 0, 0), np.float32), 0, Links(_NO_INTS, _NO_INTS, _NO_INTS, _NO_INTS, _NO_FLOATS))
NO_FEATURES = Features(
    _NO_WEIGHTS,
    Bending(_NO_WEIGHTS, _NO_FIELD, _NO_FIELD),
    Plasticity(0, _NO_FIELD, _NO_FIELD),
    Balance(
        _NO_INTS,
        _NO_INTS,
        _NO_INTS,
        _NO_FLOATS,
        _NO_FLOATS,
        _NO_FLOATS,
        _NO_FLOATS,
        PartRuns(_NO_INTS, _NO_INTS),
    ),
)
