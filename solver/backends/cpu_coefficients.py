"""What compiled loops read beside fields, in few types: for each choice of types the loops are compiled anew."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..operator.step_coefficients import StepCoefficients
from ..operator.volume import volume_rate
from ..operator.wave_operator import WaveOperator
from .arguments import Amplitude, Balance, Coefficient, PartRuns
from .cpu_fields import FieldLayout


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
