"""The stiffness of texels that have moved, worked out when somebody asks for it."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from .irregular import IrregularLinks
from .moving import CellCoefficient, MovingCells
from .riding import SurfaceRide
from .stencil import Stencil


class MovedPlaces:
    """Where the places of an atlas are.

    Attributes
    ----------
    ride : SurfaceRide
    V : float64 [n, 3]
        Vertices [m].
    """

    def __init__(self, ride: SurfaceRide, V: NDArray[np.float64]) -> None:
        self.ride, self.V = ride, V

    @functools.cached_property
    def around(self) -> NDArray[np.float64]:
        """Coordinates of the texels with halo [m], [3, C, n + 2, n + 2]."""
        return self.ride.around(self.V)


class MovedStencil(Stencil):
    """A stencil of cells and where they are. A GPU makes its own of it, so that nobody may ever ask for the weights.

    Parameters
    ----------
    cells : MovingCells
    coefficient : CellCoefficient
    places : MovedPlaces
    like : (MovedStencil, float), optional
        One of which this is a multiple, and by how much.
    """

    def __init__(
        self,
        cells: MovingCells,
        coefficient: CellCoefficient,
        places: MovedPlaces,
        like: tuple[MovedStencil, float] | None = None,
    ) -> None:
        self.__dict__.update(topology=cells.topology, cells=cells, coefficient=coefficient, places=places)
        self.__dict__.update(_like=like, _fastest=None)

    cells: MovingCells
    coefficient: CellCoefficient
    places: MovedPlaces
    _like: tuple[MovedStencil, float] | None
    _fastest: float | None

    @functools.cached_property
    def _made(self) -> tuple[Stencil, NDArray[np.float64]]:
        if self._like is not None:
            return self._like[0].scaled(self._like[1]), self._like[0].areas
        return self.cells.assemble(self.places.around, self.coefficient)

    @functools.cached_property
    def weights(self) -> NDArray[np.float64]:
        """Of the nine-point stencil, [C, 4, n + 1, n + 1]."""
        return self._made[0].weights

    @functools.cached_property
    def irregular(self) -> IrregularLinks | None:
        """The links beyond the nine points."""
        return self._made[0].irregular

    @property
    def areas(self) -> NDArray[np.float64]:
        """Area of the texel mesh that belongs to each texel [m^2], [C, n, n]."""
        return self._made[1]

    def note_fastest(self, rate: float) -> None:
        """Take over what `fastest` gives from whoever knows it."""
        self.__dict__["_fastest"] = rate

    def fastest(self, mass: NDArray[np.float64]) -> float:
        """As for any stencil, or as noted."""
        return super().fastest(mass) if self._fastest is None else self._fastest
