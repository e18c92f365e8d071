"""The wave operator on a surface that moves.

The masses of the texels stay as they are at rest; the stiffness follows the positions of the
texels.
"""

from __future__ import annotations

import numpy as np

from ..errors import SolverError
from ..kernel import Floats
from ..texels.atlas import Atlas
from ..texels.moving import MovedPlaces, MovedStencil
from ..texels.stencil import Stencil
from .assembly import texel_fields
from .bending import Bending
from .deep_water import FluidOperator
from .material import Material
from .wave_operator import WaveOperator

# Area of a texel over its area at rest, at least.
_LEAST_AREA_RATIO = 1e-3


class MovingOperator:
    """Recomputes the operator of a material at new positions of the texels.

    The mass sigma A of each texel stays as it is at rest. So its density falls as its area grows,
    and with the density fall tension sigma c^2 and viscous resistance sigma nu. Rates, speeds and
    the bending b stay those of the material, except that c^2 goes with a power of the area,
    `Material.tightening`. A plate with rims of its own bends everywhere as it does at rest.

    Parameters
    ----------
    atlas : Atlas
        At rest.
    operator : WaveOperator
        At rest, of kind "fem".

    Raises
    ------
    SolverError
        If there is deep fluid below.
    """

    def __init__(self, atlas: Atlas, material: Material, operator: WaveOperator) -> None:
        if isinstance(operator, FluidOperator):
            raise SolverError(
                "a surface with deep fluid below cannot move; take a material without `deep`"
            )
        texels, field = texel_fields(atlas, material, operator.topology.fixed_rim)
        soft = texels.softening()
        density = field["density"]
        squared_speed = field["speed"] ** 2
        self._rest = operator
        self._areas = atlas.areas
        self._cells = texels.cells
        self._tension = self._cells.coefficient(
            density * squared_speed, soft, material.tightening - 1.0
        )
        self._viscosity = None
        self._viscosity_share: float | None = None
        if operator.viscosity_stencil is not None:
            self._viscosity = self._cells.coefficient(density * field["viscosity"], soft, -1.0)
            if not material.tightening and squared_speed.all():
                self._viscosity_share = _one_value(field["viscosity"] / squared_speed)
        self._laplace = None
        if isinstance(operator.bending, Bending):
            self._laplace = self._cells.coefficient(np.ones_like(density), soft, 0.0)
        # area of a texel over the area that the moving cells give it at rest
        around = np.ascontiguousarray(np.moveaxis(texels.halo_positions, -1, 0))
        self._level = atlas.areas / self._cells.moved(around, self._tension)[1]

    def at(self, places: MovedPlaces) -> WaveOperator:
        """Operator where the places are."""
        tension = MovedStencil(self._cells, self._tension, places, added=self._rest.rim_links)
        viscosity = None
        if self._viscosity is not None:
            multiple = None
            if self._viscosity_share is not None:
                multiple = (tension, self._viscosity_share)
            viscosity = MovedStencil(self._cells, self._viscosity, places, multiple)
        bending = self._rest.bending
        if self._laplace is not None and isinstance(bending, Bending):
            laplace = MovedStencil(self._cells, self._laplace, places)
            # the rigidity sigma b / A, with the density sigma = M / A
            growth = self._areas / self.areas(laplace)
            bending = Bending(laplace, bending.rigidity * growth**2)
        return self._rest.moved(tension, viscosity, bending)

    def areas(self, stencil: Stencil) -> Floats:
        """Area of each texel [m^2], [C, n, n], under a stencil of `at`.

        Under any other stencil it is the area at rest.
        """
        if not isinstance(stencil, MovedStencil):
            return self._areas
        return np.maximum(stencil.areas * self._level, _LEAST_AREA_RATIO * self._areas)


def _one_value(field: Floats) -> float | None:
    """The value of a field that is the same at all texels, or None."""
    first = field.flat[0]
    return float(first) if (field == first).all() else None
