"""Volume conservation: a uniform pressure, as from an incompressible interior.

The pressure balances sources, and the forces inside a surface of uneven density. Forces along links
conserve momentum. Where the density varies, that is not the rate of the volume, the sum of area
times velocity. The pressure is the Lagrange multiplier of this sum. It is linear in height and
velocity, and moves the surface along the operator's `response`: the accelerations are projected
with masses as weights, so that the operator stays symmetric and energy is conserved.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from ..errors import SolverError, shown
from ..kernel import Bools, Floats, Floats32, Ints
from .step import damped_step
from .wave_operator import WaveOperator

# Coefficients up to this share of the greatest one are round-off.
_MIN_COEFFICIENT_SHARE = 1e-12


def kept_parts(operator: WaveOperator, conserve: bool | None) -> Bools:
    """Whether each part of the surface keeps its volume, [p].

    All parts or none; for None, those that do by default, see `Mobility`.
    """
    if conserve not in (None, True, False):
        raise SolverError(
            f"conserve_volume must be True, False or None (the default), got {shown(conserve)}"
        )
    default = operator.keeps_volume
    return default if conserve is None else np.full_like(default, conserve)


class VolumeBalance:
    """Takes the mean out of sources, in each part of the surface that floats freely.

    A pressure moves each texel by one over its density. Taking that share of it out of a momentum
    leaves the sum of area times velocity unchanged. It is the orthogonal projection with masses as
    weights, and adds no energy.

    Parameters
    ----------
    operator : WaveOperator
    conserve : bool, optional
        Whether all parts keep their volume, or none; see `kept_parts`.
    """

    def __init__(self, operator: WaveOperator, conserve: bool | None = None) -> None:
        self._operator = operator
        self._kept = kept_parts(operator, conserve)
        self._parts = None if operator.parts is None else operator.parts.reshape(-1)
        self._inverse_density = operator.inverse_density.reshape(-1)
        # change of momentum per amplitude of the response, weighed by one over the density
        self._response_sum = self._sum(operator.mass * operator.inverse_density * operator.response)

    def counterpart(self, texels: Ints, momenta: Floats) -> float | Floats:
        """Amplitude of the operator's `response` that balances momenta [k] on some texels [k].

        [m/s], or for forces [m/s^2]; a number, or one for each part.
        """
        weighed = self._inverse_density[texels] * momenta
        total = self._response_sum
        if self._parts is None:
            return -float(weighed.sum()) / float(total) if total else 0.0
        # bincount of no texels gives integers
        sums = np.bincount(self._parts[texels], weighed, len(total)).astype(np.float64)
        return np.divide(-sums, total, out=np.zeros_like(sums), where=total > 0)

    def balanced_velocity(self, field: Floats) -> Floats:
        """A velocity field [C, n, n] without its volume rate."""
        operator = self._operator
        weighed = operator.mass * operator.inverse_density * field
        return field - operator.response * self._ratio(weighed, self._response_sum)

    def balanced_height(self, field: Floats, areas: Floats) -> Floats:
        """A height field [C, n, n] without its mean."""
        return field - self._operator.movable * self._ratio(areas * field, self._sum(areas))

    def _sum(self, field: Floats) -> Floats:
        """Sum over the movable texels of each part, [p]; a number where there is one part.

        It is 0 where no volume is kept.
        """
        movable = self._operator.movable
        if self._parts is None:
            return field[movable].sum() * self._kept[0]
        sums = np.bincount(self._parts, (field * movable).reshape(-1))
        return sums.astype(np.float64) * self._kept

    def _ratio(self, field: Floats, total: Floats) -> Floats | float:
        """Sum of a field over each part, over a total of the part, at every texel [C, n, n]."""
        if self._parts is None:
            return float(field.sum()) / float(total) if total else 0.0
        sums = np.bincount(self._parts, field.reshape(-1))
        ratios = np.divide(sums, total, out=np.zeros_like(sums), where=total > 0)
        return ratios[self._parts].reshape(field.shape)


def balanced_parts(operator: WaveOperator, conserve: bool | None) -> Bools:
    """Whether a pressure keeps the volume of each part while its waves run, [p].

    A pressure does so if the density varies, the part keeps its volume, and no clamp or uneven
    spring holds the part.
    """
    balanced = kept_parts(operator, conserve).copy()
    if operator.density is None:
        return np.zeros_like(balanced)
    parts = np.zeros(operator.mass.shape, np.int32) if operator.parts is None else operator.parts
    for number in np.flatnonzero(balanced):
        balanced[number] = _floats_freely(operator, parts == number)
    return balanced


# Begins, texels, heights, velocities; see `volume_rate`.
VolumeRate: TypeAlias = tuple[Ints, Ints, Floats32, Floats32]


def volume_rate(
    operator: WaveOperator, dt: float, conserve: bool | None = None
) -> VolumeRate | None:
    """The pressure that keeps the volume over a substep dt [s], from heights and velocities.

    None where nothing changes the volume, or no part keeps its volume. A part does not keep it
    where a clamp holds some of the part, or its stiffness varies: clamps and springs take up
    momentum themselves.

    Returns
    -------
    begins : int64 [p + 1]
        The pressure's acceleration of part p is the sum of heights h + velocities v from begins[p]
        to begins[p + 1].
    texels : int64 [k]
        Flat texel index of each entry: where the density varies, as a rule.
    heights, velocities : float32 [k]
        [1/s^2] and [1/s]; no velocities, [0], where none count.
    """
    if operator.density is None:
        return None
    parts = np.zeros(operator.mass.shape, np.int32) if operator.parts is None else operator.parts
    count = int(parts.max()) + 1
    balanced = balanced_parts(operator, conserve)
    decay, span = damped_step(operator, dt)
    weight = operator.mass * operator.inverse_density
    inertia = np.bincount(parts.reshape(-1), (weight * span * operator.response).reshape(-1), count)
    inverse_inertia = -1 / np.where(inertia > 0, inertia, 1)
    scale = np.where(balanced & (inertia > 0), inverse_inertia, 0)[parts]
    moved = span * operator.inverse_density
    # less the part that an even surface has as well: its mean is damped, and swings on its spring
    heights = operator.link_force(moved) - weight * operator.stiffness * (span - _mean(span))
    velocities = weight * (decay - _mean(decay))
    if operator.viscosity_stencil is not None:
        velocities = velocities + operator.viscosity_stencil(moved)
    heights = _without_round_off((scale * heights).reshape(-1))
    velocities = _without_round_off((scale * velocities).reshape(-1))
    texels = np.flatnonzero((heights != 0) | (velocities != 0))
    texels = texels[np.argsort(parts.reshape(-1)[texels], kind="stable")]
    begins = np.searchsorted(parts.reshape(-1)[texels], np.arange(count + 1))
    if not len(texels):
        return None
    heights = heights[texels]
    velocities = velocities[texels] if velocities.any() else velocities[:0]
    return begins, texels, heights.astype(np.float32), velocities.astype(np.float32)


def _floats_freely(operator: WaveOperator, part: Bools) -> bool:
    """Whether no clamp holds the texels [C, n, n] of a part, and their springs are alike."""
    movable = part & operator.movable
    if not movable.any():
        return False
    is_anchored = operator.anchored[part].any()
    has_uneven_springs = np.ptp(operator.stiffness[movable]) > 0
    return not is_anchored and not has_uneven_springs


def _without_round_off(coefficients: Floats) -> Floats:
    """The coefficients, changed in place: 0 where they are small against the greatest one."""
    sizes = np.abs(coefficients)
    coefficients[sizes <= _MIN_COEFFICIENT_SHARE * sizes.max(initial=0.0)] = 0.0
    return coefficients


def _mean(field: Floats) -> float:
    """Mean of a field; for a uniform field its value, to the last bit."""
    return float(field.flat[0]) if not np.ptp(field) else float(field.mean())
