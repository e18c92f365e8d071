"""The wave operator of a surface with deep fluid below: long waves move more of it than short ones."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverError
from ..texels.spectrum import largest_eigenvalue
from ..texels.stencil import Stencil
from .deep_water import HalfLaplacian
from .wave_operator import SAFETY, WaveOperator


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FluidOperator(WaveOperator):
    """M (deep / root) h_tt = -(K + M k) h - M (deep / root) zeta h_t - ..., with the half Laplacian as the root.

    Attributes
    ----------
    deep : float
        Wave number at which the fluid weighs as much as `mass` says [1/m].
    geometry : Stencil
        Link weights of the Laplacian.
    areas : float64 [C, n, n]
        [m^2].
    """

    deep: float
    geometry: Stencil
    areas: NDArray[np.float64]

    @functools.cached_property
    def root(self) -> HalfLaplacian:
        """The surface's half Laplacian, factorised when it is first needed."""
        return HalfLaplacian(self.geometry, self.areas)

    def acceleration(self, momentum: NDArray[np.float64]) -> NDArray[np.float64]:
        """What forces [N] make of the height [m/s^2], or momenta [N s] of the velocity [m/s], [C, n, n]."""
        return np.where(self.free, self.root(np.where(self.free, momentum / self.mass, 0.0)) / self.deep, 0.0)

    def momenta(self, velocity: NDArray[np.float64]) -> NDArray[np.float64]:
        """Momentum of the fluid that moves with the surface [N s], float64 [C, n, n]."""
        return self.mass * self.deep * self.root.inverse(velocity)

    @functools.cached_property
    def stable_timestep(self) -> float:
        """Largest stable step of the leapfrog scheme [s]; see `WaveOperator.stable_timestep`."""
        wave = largest_eigenvalue(self.link_force, self.mass, self.free, self.stencil.fastest(self.mass))
        square = (wave + self.stiffness.max()) * self.root.most / self.deep
        viscous = 0.0
        if self.viscous_stencil is not None:
            bound = self.viscous_stencil.fastest(self.mass)
            viscous = largest_eigenvalue(self.viscous_stencil, self.mass, self.free, bound)
        return float(SAFETY * 4 / (viscous + np.sqrt(viscous**2 + 4 * square)))


def over_fluid(operator: WaveOperator, deep: float, geometry: Stencil, areas: NDArray[np.float64]) -> FluidOperator:
    """The operator of a surface with deep fluid below; see `FluidOperator`.

    Raises
    ------
    SolverError
        If the density varies, or the surface bends or yields.
    """
    for wrong, what in (
        (operator.density is not None, "a density that varies"),
        (operator.rigidity is not None, "bending"),
        (operator.yield_height is not None, "a yield height"),
    ):
        if wrong:
            raise SolverError(f"a material with deep fluid has {what}; valid is one density alone")
    given = {field.name: getattr(operator, field.name) for field in dataclasses.fields(operator)}
    return FluidOperator(**given, deep=deep, geometry=geometry, areas=areas)
