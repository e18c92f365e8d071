"""`HighPass` leaves a flex its coarse motion: the waves get the rest, which it cannot follow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from ripple_sim.solver import Load, WaveSolver

from .soft import SoftSurface

# Share of a mass that is added to the mass of each coarse motion: some motions are nearly the same.
_ADDED_MASS = 1e-9


class HighPass:
    """Takes out of a load the part that would move the surface as its flex moves by itself.

    The forces that remain do no work on any coarse velocity: M B u is taken off, with M the
    texels' masses, the columns of B the coarse motions along the normals, and B' M B u = B' f.

    Parameters
    ----------
    waves : WaveSolver
    surface : SoftSurface
        Of a flex.
    """

    def __init__(self, waves: WaveSolver, surface: SoftSurface) -> None:
        self._mass = waves.operator.mass.reshape(-1)
        self._basis = coarse_motions(waves, surface)
        gram = csc_array(self._basis.T @ (self._basis * self._mass[:, None]))
        masses = gram.diagonal()
        gram.setdiag(np.maximum(masses, _ADDED_MASS * masses.max()) * (1 + _ADDED_MASS))
        self._solve = splu(gram).solve

    def __call__(self, load: Load) -> Load:
        """The fine part of a load: forces on all texels."""
        if not len(load.texels):
            return load
        forces = np.bincount(load.texels, load.forces, len(self._mass)).astype(np.float64)
        # sparse products, and einsum, stay off the threads of BLAS, which wait for one another on a
        # busy machine
        coarse = self._solve(_times(self._basis.T, forces))
        fine = forces - self._mass * _times(self._basis, coarse)
        return Load(np.arange(len(forces)), fine)


def _times(
    matrix: csr_array | NDArray[np.float64], vector: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Product of a sparse or dense matrix and a vector."""
    if isinstance(matrix, np.ndarray):
        return np.einsum("ij,j->i", matrix, vector)
    return matrix @ vector


def coarse_motions(waves: WaveSolver, surface: SoftSurface) -> csr_array | NDArray[np.float64]:
    """Motions of the texels along their normals that a flex makes itself, [T, k].

    If the degrees of freedom of a flex are its vertices, there is a motion for each vertex along
    the normal, and heights between vertices are linear. If the flex is interpolated between 8 or 27
    nodes, the motions are all polynomials of that degree along each axis.
    """
    atlas = waves.rest
    texels = np.arange(atlas.areas.size)
    if not surface.degree:
        corners = np.asarray(atlas.mesh.F)[atlas.triangles.reshape(-1)]
        entries = atlas.barycentrics.reshape(-1), (np.repeat(texels, 3), corners.reshape(-1))
        return csr_array(entries, shape=(len(texels), len(atlas.mesh.V)))
    x = atlas.positions.reshape(-1, 3)
    x = 2 * (x - x.min(axis=0)) / np.ptp(x, axis=0) - 1
    powers = np.stack(np.meshgrid(*[np.arange(surface.degree + 1)] * 3), axis=-1).reshape(-1, 3)
    functions = np.prod(x[:, None] ** powers, axis=2)
    # each motion is contiguous in memory: products with vectors are then sums along it
    normals = atlas.normals.reshape(-1, 3)
    return np.concatenate([functions.T * component for component in normals.T]).T
