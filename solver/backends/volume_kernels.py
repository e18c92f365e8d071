"""Compiled loops that keep the volume of surfaces whose density varies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import Floats32, Ints, kernel
from .stencil_kernels import NO_FLOATS, NO_INTS


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


NO_BALANCE = Balance(
    begins=NO_INTS,
    addresses=NO_INTS,
    runs=NO_INTS,
    heights=NO_FLOATS,
    velocities=NO_FLOATS,
    loaded=NO_FLOATS,
    total=NO_FLOATS,
    pressure=NO_FLOATS,
    part_begins=NO_INTS,
    parts=NO_INTS,
)


@kernel(no_cpython_wrapper=True)
def keep_volume(balance: Balance, h: Floats32, v: Floats32) -> None:
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
