"""The shape of a surface at rest under forces: K h = -f, with one sparse factor for all forces."""

from __future__ import annotations

import numpy as np
from scipy.sparse import diags_array

from ..errors import SolverError
from ..kernel import Bools, Floats
from .deep_water import factorised
from .modes import elastic_matrix
from .wave_operator import WaveOperator

# Pull of a surface on a constant height, over the mean pull on single texels, up to which nothing
# holds the surface.
_MAX_LOOSE_PULL = 1e-9


class StaticSurface:
    """Heights at rest under forces, for the operator K of tension, springs and bending.

    Where a part of the surface keeps its volume, a uniform pressure on the part does: it is the
    Lagrange multiplier of the volume. A part that keeps its volume needs nothing else to hold it.

    Parameters
    ----------
    operator : WaveOperator
    kept_parts : bool [p]
        Whether each part keeps its volume; see `volume.kept_parts`.

    Raises
    ------
    SolverError
        If nothing holds a part of the surface.
    """

    def __init__(self, operator: WaveOperator, kept_parts: Bools) -> None:
        self._shape = operator.mass.shape
        matrix = elastic_matrix(operator)
        # rigid texels and those that nothing ties to others stay where they are
        self._moving = np.flatnonzero(operator.free.ravel() & (matrix.diagonal() > 0))
        matrix = matrix[self._moving][:, self._moving]
        part = np.zeros(self._shape, np.int32) if operator.parts is None else operator.parts
        self._part = part.ravel()[self._moving]
        self._areas = self._part_areas(operator)
        self._kept = np.flatnonzero(kept_parts)
        diagonal = matrix.diagonal()
        pull = np.bincount(self._part, matrix @ np.ones(len(diagonal)), len(kept_parts))
        mean_pull = np.bincount(self._part, diagonal, len(kept_parts))
        floats = (pull <= _MAX_LOOSE_PULL * mean_pull) & (mean_pull > 0)
        if (floats & ~kept_parts).any():
            raise SolverError(
                "nothing holds the surface, so that a force moves it for ever: give the material "
                "stiffness, or the surface a rim that is supported or clamped"
            )
        # a part that floats is tied to its place by one texel: balanced forces do not pull there
        tie = np.zeros(len(diagonal))
        for k in np.flatnonzero(floats):
            texel = np.flatnonzero(self._part == k)[0]
            tie[texel] = diagonal[texel]
        self._solve = factorised(matrix + diags_array(tie))
        # heights under an even pressure of 1, in each part that keeps its volume and is held
        self._under_pressure = np.zeros((len(self._kept), len(diagonal)))
        for row, k in enumerate(self._kept):
            if not floats[k]:
                forces = np.where(self._part == k, self._areas, 0.0)
                self._under_pressure[row] = self._solve(forces)
        self._floats = floats

    def _part_areas(self, operator: WaveOperator) -> Floats:
        """Area of each moving texel, in any unit: where the density is even, its mass."""
        areas = operator.mass if operator.density is None else operator.mass / operator.density
        return areas.ravel()[self._moving]

    def heights(self, forces: Floats) -> Floats:
        """Heights at rest [m] under forces that press inwards.

        Parameters
        ----------
        forces : float64 [T] or [T, k]
            Force on each texel [N], in one or several columns.

        Returns
        -------
        float64 [T] or [T, k]
        """
        load = -np.asarray(forces, dtype=np.float64)[self._moving]
        areas = self._areas
        for k in self._kept:
            if self._floats[k]:
                in_part = self._part == k
                mean = load[in_part].sum(axis=0) / areas[in_part].sum()
                load[in_part] -= np.multiply.outer(areas[in_part], mean)
        height = self._solve(load)
        for row, k in enumerate(self._kept):
            in_part = self._part == k
            volume = areas[in_part] @ height[in_part]
            if self._floats[k]:
                height[in_part] -= volume / areas[in_part].sum()
            else:
                under_pressure = self._under_pressure[row][in_part]
                pressure = volume / (areas[in_part] @ under_pressure)
                height[in_part] -= np.multiply.outer(under_pressure, pressure)
        result = np.zeros((int(np.prod(self._shape)), *height.shape[1:]))
        result[self._moving] = height
        return result
