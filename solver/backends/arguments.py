"""Arguments of the compiled loops: arrays that belong together, as one argument each."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from ripple_sim.solver.kernel import Floats32, Ints

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
