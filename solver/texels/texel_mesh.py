"""The texel mesh: charts of texels on a surface; waves are solved at the centres of the texels.

The texel mesh cuts corners where the surface is creased, and spans twists that the surface does not
have: its area is up to 2 % too small or too large at N = 96. The map onto the charts is exact: the
area of a texel is the area of the surface that its square of a chart covers.

This module also keeps a few small texels from setting the time step for all, and has figures of how
good a texel mesh is.
"""

from __future__ import annotations

import dataclasses
import functools
import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import MatrixRankWarning, spsolve

from ..errors import AtlasError, shown
from ..kernel import Floats, Ints
from ..mesh.mesh import Mesh
from .stencil import EVEN_RATE, Stencil, largest_eigenvalue, link_lengths, stiffness_matrix
from .stiffness import TexelCells
from .topology import TexelTopology

# Passes of the smoothing: a neighbourhood has a standard deviation of 1.4 texels.
_SMOOTHING_PASSES = 4

# Least and greatest covered area round a texel, over the area that the texel mesh spans there. A
# limb that falls between the texels does not belong to them.
_LEAST_COVERED = 0.5
_MOST_COVERED = 1.2

# Least area of a texel, over the mean round it: a texel may cover only triangles without area.
_LEAST_AREA = 0.05

# Texels of a smooth surface that softening may take away, for each halving of the fastest rate. The
# loss falls with the square of their size, as the error of the operator does: eigenvalues stay of
# second order.
_LOST_TEXELS = 0.5

# Needles at creases may lose more: texels that are faster than the bulk of the surface by this
# factor. Rings of narrow texels round a limb are hardly faster. All waves along the limb pass
# through them, and softening them made the lowest frequencies too low.
_NEEDLE = 2.0

# Needles lose more only where the time step would be less than this share of an even grid's.
_LEAST_STEP = 0.45

# Share of the surface that is its bulk: texels as fast as the bulk stay as they are.
_BULK = 0.99

# Texels faster than the bulk by no more than this factor stay as they are, too.
_FASTER = 1.2

# Greatest change of eigenvalues for the sake of the time step, in units of about the error of the
# operator.
_MOST_CHANGE = 0.07

# Area to which a texel may grow, in mean texels: more would leave a hole round a needle.
_HEAVIEST = 3.0

# Share of the area of a part of the mesh that its texels may lack together. Where they lack more,
# the part is tiny and too fast altogether, and stays as it is.
_MOST_LACK = 0.2

# Newton steps for the least potential.
_MOST_NEWTON_STEPS = 50

# Halvings, in logarithms, of the range of bounds in which the lowest possible one is sought.
_HALVINGS = 6


def smoothed(topology: TexelTopology, field: Floats) -> Floats:
    """Mean of a field [C, n, n] round each texel.

    By passes of the weights 1 2 1 along rows and columns.
    """
    exists = _sum_around(topology, np.ones_like(field))
    for _ in range(_SMOOTHING_PASSES):
        # in corners of other than four charts a texel lacks a neighbour
        field = _sum_around(topology, field) / exists
    return field


def _sum_around(topology: TexelTopology, field: Floats) -> Floats:
    """Sum of a field [C, n, n] round each texel, with the weights 1 2 1 along rows and columns."""
    around = topology.with_halo(field)
    rows = around[:, :-2] + 2 * around[:, 1:-1] + around[:, 2:]
    return rows[:, :, :-2] + 2 * rows[:, :, 1:-1] + rows[:, :, 2:]


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
            change = np.clip(level, _LEAST_COVERED, _MOST_COVERED) / level
            areas = np.maximum(covered * change, _LEAST_AREA * mean)
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


def evened_areas(areas: Floats, stencil: Stencil) -> Floats:
    """Areas [C, n, n] with mass moved from neighbours to the few texels that are too fast.

    Those texels would set the time step for all. K w is added to the areas, with the stiffness K of
    a uniform surface and the least w >= 0 for which no texel is faster than a bound. K w has no sum
    and, except for the curvature, no first moment: total area and centre of mass stay. The mean
    square of the heights of a mode of wave number k changes by 2 k^2 times the mean of w, where the
    error of the operator is k^2 h^2 / 12. The bound is as low as a share of this error allows.
    """
    flat = areas.ravel()
    pull = stencil.absolute_sums().ravel()
    matrix = stiffness_matrix(stencil)
    if not pull.any():  # a single texel
        return areas
    rate = pull / flat
    part = connected_components(matrix, directed=False)[1]
    best = flat
    low = _FASTER * _bulk(rate, flat)
    high = float(rate.max())
    bound = max(low, _even(flat))  # beyond which texels are softened, if need be
    for _ in range(_HALVINGS):
        heaviest = np.maximum(flat, _HEAVIEST * flat.mean())
        lack = np.minimum(pull / bound, heaviest) - flat
        part_lack = np.bincount(part, np.maximum(lack, 0))
        is_too_fast = part_lack > _MOST_LACK * np.bincount(part, flat)
        lack[is_too_fast[part]] = -np.inf
        w = _least_potential(matrix, lack)
        if w is not None and 24 * (w @ flat) <= _MOST_CHANGE * flat.mean() * flat.sum():
            best = flat + matrix @ w
            high = bound
        else:
            low = bound
        bound = np.sqrt(low * high)
    return best.reshape(areas.shape)


def _least_potential(matrix: csr_array, lack: Floats) -> Floats | None:
    """The least w >= 0 with K w >= lack, an obstacle problem; None if it is not found.

    Newton's method finds where w is not 0 (Hintermueller, Ito and Kunisch 2002).
    """
    w = np.zeros_like(lack)
    touching = lack > 0
    for _ in range(_MOST_NEWTON_STEPS):
        inside = np.flatnonzero(touching)
        w[:] = 0
        if len(inside):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error", MatrixRankWarning)
                    w[inside] = spsolve(matrix[inside][:, inside].tocsc(), lack[inside])
            except MatrixRankWarning:  # all of a part: nothing beside it gives mass
                return None
        before = touching
        round_off = 1e-9 * np.abs(lack[inside]).sum()
        touching = np.where(touching, w > 0, matrix @ w < lack - round_off)
        if (touching == before).all():
            return w
    return None


def _even(areas: Floats) -> float:
    """Rate at which the time step is `_LEAST_STEP` of an even grid's."""
    return float(EVEN_RATE / (2 * areas.mean() * _LEAST_STEP**2))


def softening(texels: TexelMesh) -> Floats:
    """Factors that slow down the few texels that evened areas leave too fast, [C, n, n].

    Where the texel mesh crosses a crease, single texels are needles, for which the mass of their
    neighbours is not enough. Waves are through them in no time, even slowed down. On smooth
    surfaces that the texels resolve, little or nothing is softened; nothing on a sphere.
    """
    areas = texels.areas
    rate = texels.stencil(np.ones_like(areas)).absolute_sums() / areas
    # the least rate to which softening may bring the faster ones; texels without links have none
    order = np.argsort(-rate.ravel())[: np.count_nonzero(rate)]
    rates = rate.ravel()[order]
    shares = (areas.ravel() / areas.mean())[order]
    lost = np.cumsum(shares) - rates * np.cumsum(shares / rates)  # [texels]
    allowed = _LOST_TEXELS * np.log2(rates[0] / rates) + 1e-9
    cheapest = float(rates[np.flatnonzero(lost <= allowed)[-1]])
    bulk = _bulk(rate.ravel(), areas.ravel())
    bound = min(cheapest, max(_NEEDLE * bulk, _even(areas)))
    bound = max(bound, _FASTER * bulk)
    return np.divide(bound, rate, out=np.ones_like(rate), where=rate > bound)


def _bulk(rates: Floats, areas: Floats) -> float:
    """The rate that the bulk of the surface, by area, has at most.

    By area, since tiny parts may have many texels.
    """
    order = np.argsort(rates)
    covered = np.cumsum(areas[order])
    return float(rates[order[np.searchsorted(covered, _BULK * covered[-1])]])


def texel_quality(texels: TexelMesh, mesh: Mesh) -> dict[str, float]:
    """Figures of how good a texel mesh is; see `Atlas.quality`."""
    lengths = link_lengths(texels.topology, texels.halo_positions)
    edges = lengths[~texels.topology.still, :2]  # not the diagonals
    edges = edges[np.isfinite(edges) & (edges > 0)]
    stencil = texels.stencil(np.ones(texels.shape), softening(texels))
    rate = largest_eigenvalue(
        stencil, texels.areas, np.ones(texels.shape, bool), stencil.fastest(texels.areas)
    )
    # of an endless even grid of as many texels on the same area
    even_rate = EVEN_RATE * texels.topology.texel_count / mesh.area
    step = np.sqrt(even_rate / rate) if rate > 0 else np.inf
    return {
        "edge_min": float(edges.min()),
        "edge_max": float(edges.max()),
        "folded": folded_texels(texels),
        "coverage": float(texels.areas.sum() / mesh.area),
        "spanned": float(texels.cells.areas.sum() / mesh.area),
        "timestep": float(step),
    }


def folded_texels(texels: TexelMesh) -> int:
    """Number of texels with a corner, between two neighbours, that faces away from the normal."""
    around = texels.halo_positions
    own = texels.positions
    beside = [around[:, 1:-1, 2:], around[:, 2:, 1:-1], around[:, 1:-1, :-2], around[:, :-2, 1:-1]]
    folded = np.zeros(own.shape[:3], bool)
    for k in range(4):
        # NaN, where there is no neighbour, is not below 0
        facing = np.cross(beside[k] - own, beside[(k + 1) % 4] - own)
        folded |= np.einsum("...k,...k->...", facing, texels.normals) < 0
    return int(folded[~texels.topology.still].sum())
