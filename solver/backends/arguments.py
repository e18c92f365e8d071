"""Arguments of the compiled loops: arrays that belong together, as one argument each."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from ripple_sim.solver.kernel import Floats, Floats32, Ints, Ints32

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


class ByPart(NamedTuple):
    """A number for each part of the surface: part of each texel, [C, n, n], and values [p]; see `floating_parts`."""

    parts: Ints32
    values: Floats32


# one number, one for each chart, or one for each part
Pressure: TypeAlias = ByPart | Floats32 | np.float32


class Kick(NamedTuple):
    """v = decay v + gain (force + extra) - spring h + span acceleration; see `StepCoefficients`."""

    stencil: Weights
    gain: Floats32
    decay: Coefficient
    spring: Coefficient
    span: Coefficient
    extra: Coefficient
    acceleration: Pressure


class Drift(NamedTuple):
    """v += shift as far as texels respond, then h += dt v, in so many columns."""

    columns: int

    response: Coefficient
    shift: Pressure
    dt: np.float32


class Balance(NamedTuple):
    """What keeps the volume, see `VolumeRate`: factors of texels that lie side by side in runs.

    Where the runs of each part begin, [p + 1], the address of each run, [r], and where its factors begin, [r + 1]; what
    the load asks for and the sum, each [p]; the part of each chart.
    """

    begins: Ints
    addresses: Ints
    runs: Ints
    heights: Floats32
    velocities: Floats32
    loaded: Floats32
    total: Floats32
    chart_parts: Ints


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
