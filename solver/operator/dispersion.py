"""Theory of plane waves on a flat surface of a uniform material: phase speed and decay."""

from __future__ import annotations

import numpy as np

from .material import Material


def frequency(material: Material, wave_number: float) -> float:
    """Angular frequency of a wave [1/s], 0 where it creeps back without swinging; of a wave number [1/m]."""
    q2, rate = wave_number**2, 1 / decay_time(material, wave_number)
    square = _number(material, "speed") ** 2 * q2 + _number(material, "bending") * q2**2
    square += _number(material, "stiffness")
    if material.deep:
        square *= wave_number / material.deep
    return float(np.sqrt(max(square - rate**2, 0.0)))


def phase_speed(material: Material, wave_number: float) -> float:
    """Speed of a wave's crests [m/s]."""
    return frequency(material, wave_number) / wave_number


def decay_time(material: Material, wave_number: float) -> float:
    """Time in which a wave falls to 1/e [s], infinite without damping."""
    rate = (_number(material, "damping") + _number(material, "viscosity") * wave_number**2) / 2
    return float("inf") if rate == 0 else 1 / rate


def _number(material: Material, name: str) -> float:
    return float(np.asarray(getattr(material, name)))
