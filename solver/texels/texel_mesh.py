"""The texel mesh: charts of texels on a surface, whose centres are the vertices on which waves are solved."""

from __future__ import annotations

import dataclasses
import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from ..checked import shown
from ..errors import AtlasError
from ..kernel import Floats, Ints
from .stencil import Stencil
from .stiffness import lumped_areas, stiffness_stencil
from .stiffness_matrix import stiffness_matrix
from .topology import TexelTopology


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
        Positions of the halo [m], where these are not simply those of the texels that it shows: the points of a rim
        nearest to the texels beside it, or images of a periodic surface; NaN where there is nothing. None: as the
        texels lie, and the surface ends at the centres of its last ones.
    """

    topology: TexelTopology
    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    areas: NDArray[np.float64]
    beyond: NDArray[np.float64] | None = None

    @classmethod
    def of(
        cls,
        topology: TexelTopology,
        positions: ArrayLike,
        *,
        normals: NDArray[np.float64] | None = None,
        beyond: NDArray[np.float64] | None = None,
    ) -> TexelMesh:
        """Texel mesh with the areas that it spans itself, and the normals of its grid lines where none are given.

        Raises
        ------
        AtlasError
            If positions are not finite, or of another shape than the topology's.
        """
        points = _checked(positions, (*topology.shape, 3))
        around = _with_halo(topology, points, beyond)
        if normals is None:
            normals = _grid_normals(around)
        return cls(topology, points, normals, lumped_areas(topology, around), beyond)

    def with_positions(
        self,
        positions: ArrayLike,
        *,
        normals: NDArray[np.float64] | None = None,
        beyond: NDArray[np.float64] | None = None,
    ) -> TexelMesh:
        """The same texels elsewhere: the topology stays, areas and (unless given) normals follow the positions.

        Areas change in proportion to what the texel mesh spans, so that a level taken from a finer mesh is kept.
        """
        moved = TexelMesh.of(self.topology, positions, normals=normals, beyond=beyond)
        spanned = lumped_areas(self.topology, self.halo_positions)
        level = np.divide(self.areas, spanned, out=np.ones_like(spanned), where=spanned > 0)
        return dataclasses.replace(moved, areas=moved.areas * level)

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
    def grid(self) -> TexelGrid:
        """The texel mesh as compiled code reads it."""
        halo = self.topology.halo.view()
        halo.flags.writeable = False  # as `glue` makes it: for copies, which can be written, kernels were compiled anew
        return TexelGrid(halo, self.positions.reshape(-1, 3), self.normals.reshape(-1, 3), self.areas.reshape(-1))

    def with_fixed_rim(self) -> TexelMesh:
        """The same with heights of 0 at its rims."""
        return dataclasses.replace(self, topology=dataclasses.replace(self.topology, fixed_rim=True))

    @property
    def bare_rim(self) -> NDArray[np.bool_]:
        """Texels in whose centres the surface ends: a rim beside them has no positions; [C, n, n]."""
        bare = self.topology.rim & ~np.isfinite(self.halo_positions[..., 0])
        ends = np.zeros(self.shape, bool)
        ends[:, 0] |= bare[:, 0, 1:-1]
        ends[:, -1] |= bare[:, -1, 1:-1]
        ends[:, :, 0] |= bare[:, 1:-1, 0]
        ends[:, :, -1] |= bare[:, 1:-1, -1]
        return ends

    def stencil(self, coefficient: NDArray[np.float64], softening: NDArray[np.float64] | None = None) -> Stencil:
        """Stiffness weights of -div(coefficient grad); see `stiffness_stencil`."""
        return stiffness_stencil(self.topology, self.halo_positions, coefficient, softening)

    def stiffness(self, speed: float | NDArray[np.float64] = 1.0) -> csr_array:
        """Stiffness matrix [T, T], T = C n^2, of the area integral of c^2 grad . grad for a wave speed c [m/s].

        Symmetric and positive semidefinite; with the areas as lumped mass M, waves on a free surface of density 1 have
        M h_tt = -K h.
        """
        try:
            squared = np.broadcast_to(np.asarray(speed, dtype=np.float64) ** 2, self.shape)
        except (TypeError, ValueError, OverflowError) as error:
            raise AtlasError(
                f"speed is {shown(speed)}; valid is a number, or an array of shape {self.shape}, in m/s"
            ) from error
        return stiffness_matrix(self.stencil(squared))


class TexelGrid(NamedTuple):
    """What compiled code asks of a texel mesh: its halo table, and places, normals and areas by flat texel index."""

    halo: Ints
    positions: Floats
    normals: Floats
    areas: Floats


def _checked(positions: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    points = np.asarray(positions, dtype=np.float64)
    if points.shape != shape:
        raise AtlasError(f"texel positions have shape {points.shape}; this topology needs {shape}, in metres")
    if not np.isfinite(points).all():
        raise AtlasError(
            f"{(~np.isfinite(points)).sum()} numbers of the texel positions are not finite; valid are metres"
        )
    return np.ascontiguousarray(points)


def _with_halo(
    topology: TexelTopology, positions: NDArray[np.float64], beyond: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    if beyond is not None:
        around = beyond.copy()
        around[:, 1:-1, 1:-1] = positions
        return around
    around = topology.with_halo(positions)
    around[(topology.halo < 0) | topology.rim] = np.nan
    return around


def _grid_normals(around: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normals [C, n, n, 3] from the differences along rows and columns, one-sided at a rim without positions."""
    own = around[:, 1:-1, 1:-1]
    beside = (around[:, 1:-1, 2:], around[:, 1:-1, :-2], around[:, 2:, 1:-1], around[:, :-2, 1:-1])
    east, west, north, south = (np.where(np.isfinite(each), each, own) for each in beside)
    normals = np.cross(east - west, north - south)
    return normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), np.finfo(np.float64).tiny)
