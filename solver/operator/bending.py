"""The bending of a plate by its Laplacian, for plates without rims of their own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, diags_array

from ..kernel import Bools, Floats
from ..texels.stencil import (
    Stencil,
    link_exists,
    stiffness_matrix,
)


def joins_neighbours(stencil: Stencil) -> bool:
    """Whether the sides of all quads are links, so that every part of the mesh is one."""
    topology = stencil.topology
    return all(stencil.weights[:, link][link_exists(topology, link)].all() for link in range(2))


class Bending(NamedTuple):
    """L B L, the bi-Laplacian's symmetric form; B L h are a plate's moments.

    Attributes
    ----------
    laplace : Stencil
        Link weights of L, which gives the area integral of the Laplacian.
    rigidity : float64 [C, n, n]
        B = sigma b / A [kg/s^2].
    """

    laplace: Stencil
    rigidity: Floats

    def force(self, height: Floats) -> Floats:
        """-L B L h [N], float64 [C, n, n]."""
        return -self.laplace(self.rigidity * self.laplace(height))

    @property
    def stiffness(self) -> csr_array:
        """L B L [N/m], [T, T]."""
        laplace = stiffness_matrix(self.laplace)
        return csr_array(laplace @ diags_array(self.rigidity.ravel()) @ laplace)

    def fastest(self, mass: Floats) -> float:
        """Bound of the largest eigenvalue over a lumped mass [C, n, n]."""
        rate = self.laplace.fastest(mass)
        return rate * float((self.rigidity * mass).max()) * rate

    def ties(self, free: Bools) -> Bools:
        """Texels that bend together with one that is not free, [C, n, n]."""
        return self.laplace(free.astype(np.float64)) != 0

    @property
    def joins_all(self) -> bool:
        """Whether all texels of a part of the mesh bend together."""
        return bool((self.rigidity > 0).all()) and joins_neighbours(self.laplace)

    @property
    def graph(self) -> csr_array:
        """Texels that are joined, [T, T]; not symmetric."""
        stiff = (self.rigidity.reshape(-1, 1) > 0).astype(np.float64)
        return csr_array(abs(stiffness_matrix(self.laplace)).multiply(stiff))
