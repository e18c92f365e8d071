"""The texel mesh: charts of texels on a surface; waves are solved at the centres of the texels.

The texel mesh cuts corners where the surface is creased, and spans twists that the surface does not
have: its area is up to 2 % too small or too large at N = 96. The map onto the charts is exact: the
area of a texel is the area of the surface that its square of a chart covers.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from ..errors import AtlasError, shown
from ..kernel import Floats, Ints
from .fast_texels import evened_areas, softening
from .smoothing import smoothed
from .stencil import Stencil, stiffness_matrix
from .stiffness import TexelCells
from .topology import TexelTopology

# Least and greatest covered area round a texel, over the area that the texel mesh spans there. A
# limb that falls between the texels does not belong to them.
_MIN_COVERED = 0.5
_MAX_COVERED = 1.2

# Least area of a texel, over the mean round it: a texel may cover only triangles without area.
_MIN_AREA_SHARE = 0.05


@dataclasses.dataclass(frozen=True, eq=False)
class TexelMesh:
    """C charts of n x n texels on a surface.

    Attributes
    ----------
    topology : TexelTopology
    positions, normals : float64 [C, n, n, 3]
        Surface point [m] and outward unit normal of every texel.
    areas : float64 [C, n, n]
        Area of the surface that belongs to each texel [m^2]; the mass of its waves sits there.
    beyond : float64 [C, n + 2, n + 2, 3] or None
        Positions of the halo [m], where they differ from the positions of the texels that it shows:
        the points of a rim nearest to the texels beside it, or images of a periodic surface; NaN
        where there is nothing. None: the halo lies as its texels lie, and the surface ends at the
        centres of its last texels.
    detours : float32 [4, C, n + 2, n + 2] or None
        How much longer than straight the links are; see `link_detours`. None: they are straight.
    """

    topology: TexelTopology
    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    areas: NDArray[np.float64]
    beyond: NDArray[np.float64] | None = None
    detours: NDArray[np.float32] | None = None

    @classmethod
    def of(
        cls,
        topology: TexelTopology,
        positions: ArrayLike,
        *,
        normals: NDArray[np.float64] | None = None,
        beyond: NDArray[np.float64] | None = None,
        covered: NDArray[np.float64] | None = None,
        detours: NDArray[np.float32] | None = None,
    ) -> TexelMesh:
        """Texel mesh with the normals of its grid lines where none are given.

        Its areas are the areas that it spans itself, or the areas of the surface that its texels
        cover, `covered` [m^2], [C, n, n]. A few areas are evened out for the sake of the time step;
        see `evened_areas`.

        Raises
        ------
        AtlasError
            If positions are not finite, or of another shape than the topology's.
        """
        points = np.asarray(positions, dtype=np.float64)
        shape = (*topology.shape, 3)
        if points.shape != shape:
            raise AtlasError(
                f"texel positions must have shape {shape} in this topology, in metres, got "
                f"{points.shape}"
            )
        wrong = int((~np.isfinite(points)).sum())
        if wrong:
            raise AtlasError(
                f"texel positions must be finite [m], got {wrong} numbers that are not"
            )
        points = np.ascontiguousarray(points)
        around = _with_halo(topology, points, beyond)
        if normals is None:
            along_row, along_column = tangents(around)
            normals = np.cross(along_row, along_column)
            lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
            normals /= np.maximum(lengths, np.finfo(np.float64).tiny)
        cells = TexelCells(topology, around, detours)
        areas = cells.areas
        if covered is not None:
            mean = smoothed(topology, covered)
            level = np.maximum(mean, 1e-300) / np.maximum(smoothed(topology, areas), 1e-300)
            change = np.clip(level, _MIN_COVERED, _MAX_COVERED) / level
            areas = np.maximum(covered * change, _MIN_AREA_SHARE * mean)
            areas[topology.still] = covered[topology.still]
        if (areas > 0).all():
            ones = np.ones_like(areas)
            areas = evened_areas(areas, cells.at_rest(ones, ones))
        return cls(topology, points, normals, areas, beyond, detours)

    def with_positions(
        self,
        positions: ArrayLike,
        *,
        normals: NDArray[np.float64] | None = None,
        beyond: NDArray[np.float64] | None = None,
    ) -> TexelMesh:
        """The same texels elsewhere.

        The topology stays, and areas follow the positions, as do normals unless they are given.
        Areas change in proportion to what the texel mesh spans, so that a level taken from a finer
        mesh is kept.
        """
        moved = TexelMesh.of(
            self.topology, positions, normals=normals, beyond=beyond, detours=self.detours
        )
        spanned = self.cells.areas
        level = np.divide(self.areas, spanned, out=np.ones_like(spanned), where=spanned > 0)
        return dataclasses.replace(moved, areas=moved.cells.areas * level)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape (C, n, n) of a field."""
        return self.topology.shape

    @property
    def resolution(self) -> int:
        """Texels along a chart's side, n."""
        return self.topology.shape[1]

    @functools.cached_property
    def halo_positions(self) -> NDArray[np.float64]:
        """Positions with halo [m], [C, n + 2, n + 2, 3]; NaN where there is nothing."""
        return _with_halo(self.topology, self.positions, self.beyond)

    @functools.cached_property
    def cells(self) -> TexelCells:
        """The cells between the texels."""
        return TexelCells(self.topology, self.halo_positions, self.detours)

    @functools.cached_property
    def grid(self) -> TexelGrid:
        """The texel mesh as compiled code reads it."""
        halo = self.topology.halo.view()
        # read-only, as `glue` makes it: kernels would be compiled anew for a writable copy
        halo.flags.writeable = False
        return TexelGrid(
            halo, self.positions.reshape(-1, 3), self.normals.reshape(-1, 3), self.areas.reshape(-1)
        )

    def with_fixed_rim(self) -> TexelMesh:
        """The same texel mesh with heights of 0 at its rims."""
        topology = dataclasses.replace(self.topology, fixed_rim=True)
        return dataclasses.replace(self, topology=topology)

    @property
    def bare_rim(self) -> NDArray[np.bool_]:
        """Texels in whose centres the surface ends, [C, n, n]: their rim has no positions."""
        bare = self.topology.rim & ~np.isfinite(self.halo_positions[..., 0])
        bare[:, [0, 0, -1, -1], [0, -1, 0, -1]] = False  # no texel lies beside a corner
        count = np.bincount(self.topology.halo[bare], minlength=self.topology.texel_count)
        return count.reshape(self.shape) > 0

    def stencil(
        self, coefficient: NDArray[np.float64], softening: NDArray[np.float64] | None = None
    ) -> Stencil:
        """Stiffness weights of -div(coefficient grad).

        The value at a texel is the area integral of div(coefficient grad h).

        Parameters
        ----------
        coefficient : [C, n, n]
            Averaged harmonically over the corners of every cell, as media in series: the operator
            stays symmetric, and a region where it is 0 is cut off at its edge.
        softening : [C, n, n], optional
            Factors up to 1: the stiffness of every cell is multiplied by the least factor at its
            corners.
        """
        factors = np.ones(self.shape) if softening is None else softening
        return self.cells.at_rest(coefficient, factors)

    def softening(self) -> Floats:
        """Factors for `stencil` that slow down the few texels that are too fast, [C, n, n]."""
        rate = self.stencil(np.ones_like(self.areas)).absolute_sums() / self.areas
        return softening(rate, self.areas)

    def stiffness(self, speed: float | NDArray[np.float64] = 1.0) -> csr_array:
        """Stiffness matrix [T, T], T = C n^2, for a wave speed c [m/s].

        It is that of the area integral of c^2 grad . grad, symmetric and positive semidefinite.
        With the areas as lumped mass M, waves on a free surface of density 1 have M h_tt = -K h.
        """
        try:
            squared = np.broadcast_to(np.asarray(speed, dtype=np.float64) ** 2, self.shape)
        except (TypeError, ValueError, OverflowError) as error:
            raise AtlasError(
                f"speed must be a number, or an array of shape {self.shape}, in m/s, got "
                f"{shown(speed)}"
            ) from error
        return stiffness_matrix(self.stencil(squared))


class TexelGrid(NamedTuple):
    """A texel mesh for compiled code: halo table, and fields by flat texel index."""

    halo: Ints
    positions: Floats
    normals: Floats
    areas: Floats


def _with_halo(topology: TexelTopology, positions: Floats, beyond: Floats | None) -> Floats:
    """Positions with halo [m], [C, n + 2, n + 2, 3]; see `TexelMesh`."""
    if beyond is not None:
        around = beyond.copy()
        around[:, 1:-1, 1:-1] = positions
        return around
    around = topology.with_halo(positions)
    around[(topology.halo < 0) | topology.rim] = np.nan
    return around


def tangents(around: Floats) -> tuple[Floats, Floats]:
    """Differences of positions with halo along rows and along columns, each [C, n, n, 3].

    They are one-sided at a bare rim.
    """
    own = around[:, 1:-1, 1:-1]
    east = _or_own(around[:, 1:-1, 2:], own)
    west = _or_own(around[:, 1:-1, :-2], own)
    north = _or_own(around[:, 2:, 1:-1], own)
    south = _or_own(around[:, :-2, 1:-1], own)
    return east - west, north - south


def _or_own(neighbours: Floats, own: Floats) -> Floats:
    """Positions of neighbours, or of the texels themselves where there is no neighbour."""
    return np.where(np.isfinite(neighbours), neighbours, own)
