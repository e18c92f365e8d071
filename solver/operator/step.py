"""Coefficients of one substep of the leapfrog scheme."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverError
from ..kernel import Floats, Floats32
from .wave_operator import WaveOperator


@dataclasses.dataclass(frozen=True, eq=False)
class StepCoefficients:
    """The kick of a step dt: v = decay v + gain force - spring h.

    Damping is implicit (centred): decay = (1 - zeta dt/2) / (1 + zeta dt/2), and 0 where that would
    be negative, zeta dt > 2: the velocity is then what the forces sustain against the damping, and
    does not change its sign each substep.

    Attributes
    ----------
    gain : float32 [C, n, n]
        [s/kg]; 0 where the surface is clamped.
    decay, spring, span : float32 or float32 [C, n, n]
        One number where a coefficient is uniform, so that the kernel reads less. The spring is in
        [1/s]. The span is the time for which the acceleration of a pressure that acts everywhere
        counts [s]; it is 0 where sources move nothing.
    """

    gain: Floats32
    decay: Floats32 | np.float32
    spring: Floats32 | np.float32
    span: Floats32 | np.float32


def step_coefficients(operator: WaveOperator, dt: float) -> StepCoefficients:
    """Coefficients of the kick of one substep of dt [s].

    Raises
    ------
    SolverError
        If float32 cannot hold one of them.
    """
    decay, span = damped_step(operator, dt)
    with np.errstate(over="ignore"):
        kick = StepCoefficients(
            gain=np.where(operator.free, span / operator.mass, 0).astype(np.float32),
            decay=number_or_field(decay),
            spring=number_or_field(span * operator.stiffness),
            span=number_or_field(span * operator.response),
        )
    if not all(np.isfinite(value).all() for value in (kick.gain, kick.spring, kick.span)):
        raise SolverError(
            f"a substep of {dt:.4g} s on texels of {operator.mass.min():.4g} kg and more is "
            "beyond float32: take a shorter step, or a larger mesh or material density"
        )
    return kick


def damped_step(operator: WaveOperator, dt: float) -> tuple[Floats, Floats]:
    """Decay of the velocity over a substep of dt [s], and the time that a force counts [s].

    Both are [C, n, n].
    """
    half = operator.damping * (dt / 2)
    decay = np.maximum((1 - half) / (1 + half), 0)
    span = dt / (1 + np.maximum(half, 2 * half - 1))
    return decay, span


def number_or_field(field: NDArray) -> Floats32 | np.float32:
    """One float32 number where a field has one value, else the field as float32."""
    first = field.flat[0]
    return np.float32(first) if (field == first).all() else field.astype(np.float32)
