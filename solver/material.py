"""What the surface is made of: the coefficients of the wave equation."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SolverError

_LIMITS = {
    "speed": ("m/s", 0.0, False),
    "damping": ("1/s", 0.0, False),
    "stiffness": ("1/s^2", 0.0, False),
    "viscosity": ("m^2/s", 0.0, False),
    "density": ("kg/m^2", 0.0, True),
}


@dataclasses.dataclass(frozen=True, eq=False)
class Material:
    """Coefficients of sigma h_tt = div(sigma c^2 grad h) - sigma zeta h_t - sigma k h + sigma nu lap h_t + p.

    Each is a number or one value a texel, shape [6, N, N].

    Attributes
    ----------
    speed : c [m/s]
        Wave speed. Where it is 0 nothing propagates.
    damping : zeta [1/s]
        The amplitude of every wave falls as exp(-zeta t / 2).
    stiffness : k [1/s^2]
        Pull back to the undeformed surface, for each kg/m^2; a lone texel would swing at sqrt(k).
    viscosity : nu [m^2/s]
        Damps a wave of wave number q as exp(-nu q^2 t / 2): short ripples first.
    density : sigma [kg/m^2]
        Mass that takes part in the motion, for each area. An impulse J raises the momentum of the surface by J.
    """

    speed: float | ArrayLike = 1.0
    damping: float | ArrayLike = 0.0
    stiffness: float | ArrayLike = 0.0
    viscosity: float | ArrayLike = 0.0
    density: float | ArrayLike = 1.0

    def __post_init__(self) -> None:
        for name, (unit, low, strict) in _LIMITS.items():
            value = np.asarray(getattr(self, name), dtype=np.float64)
            below = value <= low if strict else value < low
            if not np.isfinite(value).all() or below.any():
                worst = value.flat[np.argmax(~np.isfinite(value) | below)]
                bound = f"greater than {low:g}" if strict else f"{low:g} or greater"
                raise SolverError(f"material {name} is {worst:g} {unit}; valid is a finite number, {bound}")
            if value.ndim not in (0, 3) or (
                value.ndim == 3 and not (value.shape[0] == 6 and value.shape[1] == value.shape[2])
            ):
                raise SolverError(f"material {name} has shape {value.shape}; valid is a number or [6, N, N]")

    def texels(self, name: str, resolution: int) -> NDArray[np.float64]:
        """One coefficient at every texel, float64 [6, N, N].

        Raises
        ------
        SolverError
            If the coefficient was given for another resolution.
        """
        value = np.asarray(getattr(self, name), dtype=np.float64)
        shape = (6, resolution, resolution)
        if value.ndim and value.shape != shape:
            raise SolverError(f"material {name} has shape {value.shape}, the atlas needs a number or {shape}")
        return np.array(np.broadcast_to(value, shape))
