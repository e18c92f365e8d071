"""The compiled wave step on the CPU.

Nothing is contracted or reordered: every loop over texels gives the same numbers, and the two ends
of a link see the same force, so that momentum is kept.

Fields are float32 charts with halo, see `RowLayout`, and all of them are flat here: indices of
several axes take twice as long to compile. A coefficient is a number or a flat field [C n columns];
a number costs no read. Arrays that belong together are one argument.

Several threads may take a step together: each has a share of the rows, and of the addresses from
its first row to the next thread's. A crew of one thread does everything.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from ..kernel import Floats, Floats32, Ints, kernel
from .curvature_kernels import NO_SQUARES, Squares, bend
from .meeting import Crew, meet
from .probes import ProbedSums, take_sums
from .stencil_kernels import (
    NO_FLOATS,
    NO_WEIGHTS,
    Coefficient,
    Share,
    Weights,
    apply,
    fill,
    force_at,
    irregular_force,
    look_along,
    row_of,
    share_of,
    value_in,
)
from .volume_kernels import NO_BALANCE, Balance, keep_volume

# Factor of the operator's `response`: one number, or a number for each part of the surface.
Amplitude: TypeAlias = float | Floats


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


NO_FEATURES = Features(
    laplace=NO_WEIGHTS,
    rigidity=NO_FLOATS,
    moment=NO_FLOATS,
    squares=NO_SQUARES,
    limit=NO_FLOATS,
    balance=NO_BALANCE,
)


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
            load_kick = value_in(span, c - 1) * value_in(acceleration, c - 1)
            small = load_kick - value_in(spring, c - 1) * row[c]
            force = force_at(
                below, row, above, east, north, south, rising, risen, falling, fallen, c
            )
            new = value_in(decay, c - 1) * velocity[c] + (
                gain[c - 1] * (force + value_in(extra, c)) + small
            )
            velocity[c] = new
            result[c] = row[c] + dt * new
    irregular = kick.stencil.irregular
    look_along(irregular, h, own)
    for i in range(len(irregular.texels)):
        address = irregular.addresses[i]
        if own.first_address <= address < own.last_address:
            force = irregular_force(irregular, i, h[address])
            kicked = kick.gain[irregular.texels[i]] * force
            v[address] += kicked
            h_next[address] += dt * kicked


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
            keep_volume(features.balance, h, v)
        if viscosity is not None:
            meet(crew)  # nobody reads the velocities of others any more
        drifted = dt if step < substeps - 1 else half
        kick_drift(h, v, h_next, kick, drifted, own)
        h, h_next = h_next, h
        push(h, v, pulses, drifted, own)
        if probed is not None:
            meet(crew)  # all heights and velocities are known
            if crew.rank == 0:
                take_sums(probed.probes, h, v, dent, drifted - half, probed.sums[step])
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
