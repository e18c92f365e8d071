"""The wave operator of a surface with deep fluid below: long waves move more of it than short ones.

The square root of the surface's Laplacian turns the height of deep water into the flow below it.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import numpy as np
from scipy.sparse import diags_array, sparray
from scipy.sparse.linalg import splu
from scipy.special import ellipj, ellipk

from ..errors import SolverError
from ..kernel import Bools, Floats
from ..texels.stencil import Stencil, largest_eigenvalue, stiffness_matrix
from .wave_operator import WaveOperator

# Shifted solves for each root. With 5 the error is below 0.1 % for 6 x 64 x 64 texels, whose
# greatest eigenvalue is 10,000 times the least.
_POLES = 5

# Corrections of the inverse half Laplacian: the error of the approximation falls by its own share
# with each.
_CORRECTIONS = 2


def factorised(matrix: sparray) -> Callable[[Floats], Floats]:
    """Solver for a symmetric positive definite matrix, which needs no pivots."""
    options = {
        "permc_spec": "MMD_AT_PLUS_A",
        "diag_pivot_thresh": 0.0,
        "options": {"SymmetricMode": True},
    }
    return splu(matrix.tocsc(), **options).solve


class HalfLaplacian:
    """sqrt(A^-1 K) of the stiffness K and the areas A of the texels, of second order in their size.

    The rational approximation of Hale, Higham and Trefethen (2008, SIAM Journal on Numerical
    Analysis 46, 2505, method 3): L sum w_i (L + s_i)^-1 with L = A^-1 K and weights and shifts from
    elliptic functions. Its error falls by exp(-2 pi^2 / (3 + log(most / least))) with each pole. A
    field without waves, a constant, gives exactly 0, and the operator is symmetric with areas as
    weights. Each shifted matrix is factorised once.

    Parameters
    ----------
    stencil : Stencil
        Of the Laplacian.
    areas : float64 [C, n, n]
        [m^2].

    Attributes
    ----------
    most : float
        Greatest eigenvalue, the square root's greatest wave number [1/m].
    """

    def __init__(self, stencil: Stencil, areas: Floats) -> None:
        self._areas = areas.ravel()
        self._matrix = stiffness_matrix(stencil)
        square = largest_eigenvalue(
            stencil, areas, np.ones(areas.shape, np.bool_), stencil.fastest(areas)
        )
        self.most = float(np.sqrt(square))
        # few waves on a surface are longer than twice the way round a sphere of its area
        least = min(np.pi / areas.sum(), square / 4)
        complement = 1 - least / square
        quarter = ellipk(complement)
        arguments = (np.arange(_POLES) + 0.5) / _POLES * quarter
        sn, cn, dn, _ = ellipj(arguments, complement)
        self._weights = 2 * quarter * np.sqrt(least) / (np.pi * _POLES) * dn / cn**2
        shifts = least * (sn / cn) ** 2
        self._solvers = [
            factorised(self._matrix + diags_array(shift * self._areas)) for shift in shifts
        ]

    def __call__(self, field: Floats) -> Floats:
        """Apply it to a field [C, n, n]: the unit times 1/m."""
        root = self._matrix @ self._inverse(field.ravel()) / self._areas
        return root.reshape(field.shape)

    def inverse(self, field: Floats) -> Floats:
        """The field [C, n, n] whose half Laplacian a given field is: the unit times m.

        Neither field has a mean.
        """
        target = field.ravel()
        solution = self._inverse(target)
        for _ in range(_CORRECTIONS):
            root = self._matrix @ self._inverse(solution) / self._areas
            solution += self._inverse(target - root)
        mean = (self._areas @ solution) / self._areas.sum()
        return (solution - mean).reshape(field.shape)

    def _inverse(self, field: Floats) -> Floats:
        """Approximate inverse root: sum w_i (L + s_i)^-1."""
        load = self._areas * field
        return sum(
            weight * solve(load) for weight, solve in zip(self._weights, self._solvers, strict=True)
        )


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class FluidOperator(WaveOperator):
    """The wave operator of a surface with deep fluid below.

    M (deep / root) h_tt = -(K + M k) h - M (deep / root) zeta h_t - ..., with the half Laplacian as
    the root.

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
    areas: Floats

    @functools.cached_property
    def keeps_volume(self) -> Bools:
        """All parts keep their volume, as a fluid does."""
        return np.ones_like(super().keeps_volume)

    @functools.cached_property
    def longest_timestep(self) -> float:
        """The stable step [s]; springs need no shorter one.

        So much of the fluid moves with long waves that they are slow under any restoring force.
        """
        return self.stable_timestep

    @functools.cached_property
    def root(self) -> HalfLaplacian:
        """The surface's half Laplacian, factorised when it is first needed."""
        return HalfLaplacian(self.geometry, self.areas)

    def acceleration(self, momentum: Floats) -> Floats:
        """Acceleration [m/s^2] by forces [N], or velocity [m/s] by momenta [N s], [C, n, n]."""
        without_fluid = np.where(self.free, momentum / self.mass, 0.0)
        return np.where(self.free, self.root(without_fluid) / self.deep, 0.0)

    def momenta(self, velocity: Floats) -> Floats:
        """Momentum of the fluid that moves with the surface [N s], float64 [C, n, n]."""
        return self.mass * self.deep * self.root.inverse(velocity)

    def _lightened(self, rate: float) -> float:
        """Squared frequency [1/s^2] at the greatest wave number, where least of the fluid moves."""
        return rate * self.root.most / self.deep


def over_fluid(
    operator: WaveOperator, deep: float, geometry: Stencil, areas: Floats
) -> FluidOperator:
    """The operator of a surface with deep fluid below; see `FluidOperator`.

    Raises `SolverError` if the density varies, or the surface bends or yields.
    """
    excluded = {
        "a density that varies": operator.density,
        "bending": operator.bending,
        "a yield height": operator.yield_height,
    }
    for property_name, value in excluded.items():
        if value is not None:
            raise SolverError(
                "a material with deep fluid must have one density and neither bending nor a "
                f"yield height, got {property_name}"
            )
    fields = {field.name: getattr(operator, field.name) for field in dataclasses.fields(operator)}
    return FluidOperator(**fields, deep=deep, geometry=geometry, areas=areas)
