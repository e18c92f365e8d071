"""The coefficients of the wave equation as one object: numbers or maps, checked."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checked import is_finite, shown
from ..errors import SolverError
from .coefficients import LIMITS, check_mask, check_numbers, check_wavelengths
from .unset import Unset

_ZERO, _ONE = Unset(0.0), Unset(1.0)

_STEEPEST = 8.0  # power with which tension may follow the area


@dataclasses.dataclass(frozen=True, eq=False)
class MaterialFields:
    """The fields of `Material`, which says what each of them is: checked, and read at every texel."""

    speed: float | ArrayLike = _ONE
    damping: float | ArrayLike = _ZERO
    stiffness: float | ArrayLike = _ZERO
    viscosity: float | ArrayLike = 0.0
    density: float | ArrayLike = _ONE
    bending: float | ArrayLike = 0.0
    yield_height: float | ArrayLike = np.inf
    deep: float = 0.0
    fixed: bool | ArrayLike = False
    tightening: float = 0.0
    wavelengths: ArrayLike = (0.0, np.inf)

    def __post_init__(self) -> None:
        for name in LIMITS:
            check_numbers(name, getattr(self, name))
        check_mask("fixed", self.fixed)
        if not (is_finite(self.tightening) and -_STEEPEST <= self.tightening <= _STEEPEST):
            raise SolverError(
                f"material tightening is {shown(self.tightening)}; valid is from {-_STEEPEST:g} to {_STEEPEST:g}"
            )
        if np.ndim(self.deep):
            raise SolverError(f"material deep has shape {np.shape(self.deep)}; valid is one number")
        check_wavelengths(self.wavelengths)

    @property
    def unset(self) -> tuple[str, ...]:
        """Names of the coefficients that are left to the model: none where the density is given."""
        if not isinstance(self.density, Unset):
            return ()
        return tuple(name for name in LIMITS if isinstance(getattr(self, name), Unset))

    def texels(self, name: str, shape: tuple[int, int, int]) -> NDArray:
        """One coefficient at every texel, [C, n, n], float64 (bool for `fixed`).

        Raises
        ------
        SolverError
            If the coefficient was given for another atlas.
        """
        value = np.asarray(getattr(self, name), dtype=bool if name == "fixed" else np.float64)
        if value.ndim and value.shape != shape:
            raise SolverError(f"material {name} has shape {value.shape}, the atlas needs a number or {shape}")
        return np.array(np.broadcast_to(value, shape))
