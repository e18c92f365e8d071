"""The wave operator of a surface that moves: masses stay with the texels, stiffness follows their positions."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverError
from ..texels.atlas import Atlas
from ..texels.moved_stencil import MovedPlaces, MovedStencil
from ..texels.moving import MovingCells
from ..texels.softening import softening
from ..texels.stencil import Stencil
from .assembly import texel_fields
from .fluid_operator import FluidOperator
from .material import Material
from .wave_operator import WaveOperator

Floats: TypeAlias = NDArray[np.float64]


class MovingOperator:
    """Makes the operator of a material anew wherever the texels are.

    The mass sigma A of each texel is that at rest, so that its density falls as its area grows, and with it tension
    sigma c^2 and viscous resistance sigma nu. Rates and speeds are the material's own, but that c^2 goes with a power
    of the area, `Material.tightening`; so does the square of a plate's frequency with b.

    Parameters
    ----------
    atlas : Atlas
        At rest.
    material : Material
    operator : WaveOperator
        At rest, of kind "fem".

    Raises
    ------
    SolverError
        If there is deep fluid below.
    """

    def __init__(self, atlas: Atlas, material: Material, operator: WaveOperator) -> None:
        if isinstance(operator, FluidOperator):
            raise SolverError("a surface with deep fluid below cannot move; take a material without `deep`")
        rim = "fixed" if operator.topology.fixed_rim else "free"
        texels, field = texel_fields(atlas, material, rim)
        self._rest, self._cells = operator, MovingCells(texels)
        soft, density = softening(texels), field["density"]
        self._tension = self._cells.coefficient(density * field["speed"] ** 2, soft, material.tightening - 1.0)
        self._viscous = self._laplace = None
        self._viscous_share = None
        if operator.viscous_stencil is not None:
            self._viscous_share = _share(field["viscosity"], field["speed"] ** 2, material.tightening)
            self._viscous = self._cells.coefficient(density * field["viscosity"], soft, -1.0)
        if operator.laplace_stencil is not None:
            self._laplace = self._cells.coefficient(np.ones_like(density), soft, 0.0)
        self._level = atlas.areas / self._cells.assemble(_coordinates(texels.halo_positions), self._tension)[1]
        self._areas = atlas.areas

    def at(self, places: MovedPlaces) -> WaveOperator:
        """Operator where the places are."""
        tension, rigidity = MovedStencil(self._cells, self._tension, places), self._rest.rigidity
        viscous = laplace = None
        if self._viscous is not None:
            like = None if self._viscous_share is None else (tension, self._viscous_share)
            viscous = MovedStencil(self._cells, self._viscous, places, like)
        if self._laplace is not None and rigidity is not None:
            laplace = MovedStencil(self._cells, self._laplace, places)
            # sigma b / A, with sigma = M / A
            rigidity = rigidity * (self._areas / self.areas(laplace)) ** 2
        return self._rest.moved(tension, viscous, laplace, rigidity)

    def areas(self, stencil: Stencil) -> Floats:
        """Area of each texel [m^2], [C, n, n], under a stencil of `at`; that at rest under any other."""
        if not isinstance(stencil, MovedStencil):
            return self._areas
        return np.maximum(stencil.areas * self._level, 1e-3 * self._areas)


def _coordinates(halo_positions: Floats) -> Floats:
    """Positions [C, n + 2, n + 2, 3] as coordinates [3, C, n + 2, n + 2]."""
    return np.ascontiguousarray(np.moveaxis(halo_positions, -1, 0))


def _share(viscosity: Floats, squared_speed: Floats, tightening: float) -> float | None:
    """What the viscous stencil is of that of tension, where it is the same share everywhere and at any time."""
    if tightening or not squared_speed.all():
        return None
    share = viscosity / squared_speed
    return float(share.flat[0]) if (share == share.flat[0]).all() else None
