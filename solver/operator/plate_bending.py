"""The bending of a plate with rims, as a sum of squares: its energy is never negative.

A plate's energy is D / 2 times the integral of (1 - nu) |H|^2 + nu (tr H)^2, with the rigidity D,
Poisson's ratio nu and the second derivatives H of its height in the surface. Where neither the
height nor its slope is held at a rim, this energy alone makes the rim's natural conditions: no
moment, no shear force. In terms of three curvatures it is a sum of squares

    D / 2 (1 + nu) / 2 (H_uu + H_vv)^2 + D / 2 (1 - nu) / 2 ((H_uu - H_vv)^2 + (2 H_uv)^2)

for any -1 < nu < 1. Each texel has three curvatures of its own, of a quadratic that is fitted to
the heights around it. Inside, a fit takes the texels that share a cell with its texel, and leaves
heights that are linear in space without any energy. Beside rims that are free or supported, and
round softened texels, a fit takes two rings of texels and the supports. A stiffness against the
misfit keeps heights that the fit does not see from moving freely. Beside a clamp the Laplacian of
the membrane's elements takes the place of a fit: it knows that the slope is 0 there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, diags_array, eye_array, triu, vstack

from ..errors import warn_caller
from ..kernel import Bools, Floats, Ints
from ..texels.stencil import IrregularLinks, Stencil, stiffness_matrix
from ..texels.texel_mesh import TexelMesh
from ..texels.topology import TRIANGLE
from .curvatures import KINDS, STEPS, Curvatures, neighbours, regular_texels
from .plate_rim import CLAMPED, FREE, RimPlaces

# Weight, in a fit inside, of a texel that shares two cells with the fit's own.
_WEIGHT_BESIDE = np.exp(-1.0)

# Weight, in a fit inside, of a texel across a corner. A lesser one brings H_uu close to the
# difference of three texels in a row, which sees the pattern + - + - of a chessboard.
_WEIGHT_ACROSS = np.exp(-2.0)

# Weight with which second derivatives are drawn to 0, inside and beside rims; all texels of a fit
# together weigh about 0.5. It decides what degenerate fits leave open.
_RIDGE_INSIDE = 0.003
_RIDGE_OUTSIDE = 0.01

# Weight with which slopes are drawn to 0: texels in one line say nothing of the slope across it.
_RIDGE_SLOPE = 1e-7

# Stiffness against the misfit of a fit, and against leaving a clamp, in units of D / A.
_MISFIT_STIFFNESS = 8.0

# Weight of a support in a fit; a texel weighs 1 at most.
_SUPPORT_WEIGHT = 30.0

# Spacings of texels up to which supports count in a fit.
_SUPPORT_REACH = 1.5

# Length of a way in the tangent plane, in spacings, at least, that is stretched to its length in
# space.
_MIN_WAY = 1e-9

# Springs up to this share of the diagonal of their row are round-off.
_MIN_SPRING_SHARE = 1e-9

# Fits that are solved at once, so that their arrays stay small.
_FITS_IN_BLOCK = 2**14

# Share of the surface that is its bulk. The bulk sets the rate that softening leaves alone: only
# texels faster than nearly all others are softened.
_BULK_SHARE = 0.95

# Rate to which texels are softened, in units of Gershgorin's bound for the bulk of the surface.
_TOLERATED_RATE = 1.2

# Share of its curvatures that a texel may lose, to ridges or for the sake of the time step, before
# its bending is not to be trusted.
_MAX_TRUSTED_LOSS = 0.25

# Share of the surface that such texels may have before the solver warns.
_MAX_UNTRUSTED_SHARE = 0.05


class Fits(NamedTuple):
    """Quadratics fitted to the heights round o texels, each at up to w places.

    Attributes
    ----------
    texels : int64 [o]
        Texel in the middle of each fit.
    columns : int64 [o, w]
        Texel of each place; -1 for supports, whose height is 0, and where there is none.
    weights : float64 [o, w]
        Weight of each place; 0 where there is none.
    ways : float64 [o, w, 2]
        Ways to the places in the tangent plane, as long as they are in space, in units of
        `spacings`.
    spacings : float64 [o]
        Root of the mean area of the texels of each fit [m].
    """

    texels: Ints
    columns: Ints
    weights: Floats
    ways: Floats
    spacings: Floats


class FitPlaces(NamedTuple):
    """Places of fits, k of them.

    Attributes
    ----------
    owners : int64 [k]
        Number of the fit to which each place belongs.
    columns : int64 [k]
        Texel of each place; -1 for supports.
    points : float64 [k, 3]
        [m].
    weights : float64 [k]
    """

    owners: Ints
    columns: Ints
    points: Floats
    weights: Floats


class Rows(NamedTuple):
    """Rows of a matrix; the energy is half the sum of their squared products with a height.

    Attributes
    ----------
    matrix : csr [r, T]
    owners : int64 [r]
        Texel to whose bending a row belongs; -1 for a row that may not be softened.
    """

    matrix: csr_array
    owners: Ints

    @classmethod
    def together(cls, *groups: Rows) -> Rows:
        """The rows of all groups, one below the other."""
        matrix = csr_array(vstack([rows.matrix for rows in groups]))
        return cls(matrix, np.concatenate([rows.owners for rows in groups]))

    def scaled(self, factors: Floats) -> csr_array:
        """The matrix with each texel's rows multiplied by its factor, [T]."""
        return diags_array(np.where(self.owners < 0, 1.0, factors[self.owners])) @ self.matrix


def plate_bending(
    texels: TexelMesh,
    places: RimPlaces,
    softening: Floats,
    rigidity: Floats,
    poisson: float,
    laplace: Stencil,
) -> tuple[Curvatures, IrregularLinks, Floats]:
    """Bending of a plate with rims.

    Parameters
    ----------
    texels : TexelMesh
    places : RimPlaces
    softening : float64 [C, n, n]
        Softening of `laplace`.
    rigidity : float64 [C, n, n]
        D [N m].
    poisson : float
    laplace : Stencil
        The membrane's Laplacian, with free rims.

    Returns
    -------
    curvatures : Curvatures
    links : IrregularLinks
        Bending beside rims, and round irregular vertices.
    springs : float64 [T]
        Springs of the same bending, from each texel to its place at rest [N/m].

    Warns
    -----
    RippleWarning
        If the bending of more than a small part of the surface is softer than it should be.
    """
    topology = texels.topology
    count = texels.topology.texel_count
    areas = texels.areas.reshape(-1)
    rigidities = rigidity.reshape(-1)
    stiff = rigidities * areas
    laplacian = -stiffness_matrix(laplace)
    near = shared_cells(texels)
    beside_clamp = np.bincount(places.texels[places.conditions == CLAMPED], minlength=count) > 0
    outer = _outer_texels(places, softening.reshape(-1) < 1, near)
    regular = regular_texels(topology).reshape(-1) & ~outer & ~beside_clamp
    irregular = ~(regular | outer | beside_clamp)

    # how much of the curvature of each texel ridges leave, [T]
    weights, left_share = _regular_weights(texels, regular, stiff, poisson)
    inside = Rows(Curvatures(topology, weights, rigidity).matrix, np.tile(np.arange(count), KINDS))
    neighbourhood_fits = _neighbourhood_fits(texels, np.flatnonzero(irregular), near)
    rim_fits = _rim_fits(texels, np.flatnonzero(outer), near, places)
    rings, left_share[irregular] = _bending_rows(neighbourhood_fits, stiff, poisson, _RIDGE_INSIDE)
    rims, left_share[outer] = _bending_rows(rim_fits, stiff, poisson, _RIDGE_OUTSIDE)
    missed = _misfit_rows(rim_fits, rigidities)
    clamps = _clamp_rows(texels, places, rigidities, laplacian)
    beside = Rows.together(rings, rims, missed, clamps)

    factors = _evened(Rows.together(inside, beside), laplacian, stiff, areas)
    _warn_of_softened(left_share * factors, areas)
    roots = np.sqrt(factors)
    matrix = beside.scaled(roots)
    curvatures = Curvatures(topology, weights * roots.reshape(topology.shape), rigidity)
    return curvatures, *_links_and_springs(csr_array(matrix.T @ matrix))


def shared_cells(texels: TexelMesh) -> csr_array:
    """Number of cells that two texels share, [T, T]; on the diagonal a texel's cells plus 1."""
    topology = texels.topology
    count = texels.topology.texel_count
    halo = np.where(topology.rim, -1, topology.halo)
    quads = np.stack(
        [halo[:, :-1, :-1], halo[:, :-1, 1:], halo[:, 1:, 1:], halo[:, 1:, :-1]], axis=-1
    )
    corner, chart = np.nonzero(topology.valence.T == TRIANGLE)
    # one of the four places of such a corner shows nothing
    triangles = quads[:, [0, 0, -1, -1], [0, -1, -1, 0]][chart, corner]
    kinds = [quads[(quads >= 0).all(axis=-1)], triangles[triangles >= 0].reshape(-1, 3)]
    for size in sorted({len(polygon) for polygon in topology.polygons}):
        of_this_size = [polygon for polygon in topology.polygons if len(polygon) == size]
        kinds.append(np.array(of_this_size))
    shared = csr_array((count, count))
    for corners in filter(len, kinds):
        # a cell across a glued side comes once from each chart
        first = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)[1]
        cells = corners[first]
        cell = np.repeat(np.arange(len(cells)), cells.shape[1])
        has = csr_array((np.ones(cells.size), (cell, cells.ravel())), shape=(len(cells), count))
        shared = shared + has.T @ has
    return csr_array(shared + eye_array(count))


def _outer_texels(places: RimPlaces, soft: Bools, near: csr_array) -> Bools:
    """Texels beside rims that are not clamped, and softened texels with their neighbours, [T]."""
    clamped = places.conditions == CLAMPED
    outer = np.zeros(len(soft), bool)
    outer[places.texels[~clamped]] = True
    outer[places.texels[clamped]] = False
    return outer | ((near @ soft.astype(np.float64)) > 0)


def _regular_weights(
    texels: TexelMesh, regular: Bools, stiff: Floats, poisson: float
) -> tuple[Floats, Floats]:
    """Weights of `Curvatures`, and the share of the curvature that ridges leave, [T].

    The share is 1 except at the regular texels.
    """
    n = texels.resolution
    count = texels.topology.texel_count
    around = neighbours(texels.topology).reshape(len(STEPS), count)
    middles = texels.positions.reshape(-1, 3)
    halo = texels.halo_positions
    ends = np.stack([halo[:, 1 + r : n + 1 + r, 1 + c : n + 1 + c] for r, c in STEPS])
    ends = ends.reshape(len(STEPS), count, 3)
    is_beside = [r == 0 or c == 0 for r, c in STEPS]
    around_weights = np.where(is_beside, _WEIGHT_BESIDE, _WEIGHT_ACROSS)
    importance = np.append(around_weights, 1.0)  # last the texel itself
    weights = np.zeros((KINDS, len(STEPS), count))
    left_share = np.ones(count)
    fitted = np.flatnonzero(regular)
    for begin in range(0, len(fitted), _FITS_IN_BLOCK):
        block = fitted[begin : begin + _FITS_IN_BLOCK]
        columns = np.column_stack([around[:, block].T, block])
        areas = texels.areas.reshape(-1)[columns]
        spacings = np.sqrt(areas.mean(axis=1))
        ways = np.concatenate([np.moveaxis(ends[:, block], 0, 1), middles[block][:, None]], axis=1)
        ways = (ways - middles[block][:, None]) / spacings[:, None, None]
        flat = _in_tangent_plane(texels.normals.reshape(-1, 3)[block][:, None], ways)
        fit_weights = np.sqrt(areas) / spacings[:, None] * importance
        fits = Fits(block, columns, fit_weights, flat, spacings)
        curved, left_share[block] = _curvature_weights(fits, stiff, poisson, _RIDGE_INSIDE)
        weights[:, :, block] = np.moveaxis(curved[:, :, :-1], 0, -1)
    return weights.reshape(KINDS, len(STEPS), *texels.shape), left_share


def _neighbourhood_fits(texels: TexelMesh, at: Ints, near: csr_array) -> Fits:
    """Fits to the texels that share a cell with those at [o]."""
    beside = near[at].tocoo()
    itself = beside.col == at[beside.row]
    neighbour_weights = np.where(beside.data >= 2, _WEIGHT_BESIDE, _WEIGHT_ACROSS)
    importance = np.where(itself, 1.0, neighbour_weights)
    spacings = _mean_spacings(near[at], texels)
    weights = np.sqrt(texels.areas.reshape(-1)[beside.col]) / spacings[beside.row] * importance
    ends = texels.positions.reshape(-1, 3)[beside.col]
    places = FitPlaces(beside.row, beside.col, ends, weights)
    return _fits(texels, at, spacings, places)


def _rim_fits(texels: TexelMesh, at: Ints, near: csr_array, places: RimPlaces) -> Fits:
    """Fits to two rings of texels round those at [o], and to supports: heavy places of height 0.

    Texels count by their areas, so that needles do not stiffen.
    """
    count = texels.topology.texel_count
    areas = texels.areas.reshape(-1)
    points = texels.positions.reshape(-1, 3)
    rings = near[at] @ near
    spacings = _mean_spacings(rings, texels)
    owner, column = rings.nonzero()
    distance = np.linalg.norm(points[column] - points[at[owner]], axis=1) / spacings[owner]
    weights = np.sqrt(areas[column]) / spacings[owner] * np.exp(-(distance**2) / 2)
    texels_around = FitPlaces(owner, column, points[column], weights)

    supported = np.flatnonzero(places.conditions != FREE)
    entries = places.texels[supported], supported
    beside = csr_array((np.ones(len(supported)), entries), shape=(count, len(places.points)))
    owner, place = (rings @ beside).nonzero()
    distance = np.linalg.norm(places.points[place] - points[at[owner]], axis=1) / spacings[owner]
    weights = np.where(distance <= _SUPPORT_REACH, _SUPPORT_WEIGHT, 0.0)
    supports = FitPlaces(owner, np.full(len(owner), -1), places.points[place], weights)
    return _fits(texels, at, spacings, texels_around, supports)


def _mean_spacings(rings: csr_array, texels: TexelMesh) -> Floats:
    """Root of the mean area of the texels in each row of rings."""
    members = (rings > 0).astype(np.float64)
    return np.sqrt((members @ texels.areas.reshape(-1)) / np.maximum(members.sum(axis=1), 1))


def _fits(texels: TexelMesh, at: Ints, spacings: Floats, *groups: FitPlaces) -> Fits:
    """Fits round texels at [o], to groups of places."""
    owner = np.concatenate([places.owners for places in groups])
    order = np.argsort(owner, kind="stable")
    owner = owner[order]
    column = np.concatenate([places.columns for places in groups])[order]
    ends = np.concatenate([places.points for places in groups])[order]
    weight = np.concatenate([places.weights for places in groups])[order]
    ways = (ends - texels.positions.reshape(-1, 3)[at[owner]]) / spacings[owner, None]
    flat = _in_tangent_plane(texels.normals.reshape(-1, 3)[at[owner]], ways)
    # each fit gets as many places as the largest one has
    slot = np.arange(len(owner)) - np.searchsorted(owner, np.arange(len(at)))[owner]
    shape = len(at), int(slot.max(initial=0)) + 1
    fits = Fits(at, np.full(shape, -1), np.zeros(shape), np.zeros((*shape, 2)), spacings)
    fits.columns[owner, slot] = column
    fits.weights[owner, slot] = weight
    fits.ways[owner, slot] = flat
    return fits


def _in_tangent_plane(normals: Floats, ways: Floats) -> Floats:
    """Ways [..., 3] turned into the plane across normals [..., 3], as long as before, [..., 2]."""
    across = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=-1)])
    first = across / np.linalg.norm(across, axis=-1, keepdims=True)
    second = np.cross(normals, first)
    flat = np.stack([(ways * first).sum(axis=-1), (ways * second).sum(axis=-1)], axis=-1)
    shortened = np.maximum(np.linalg.norm(flat, axis=-1), _MIN_WAY)
    stretch = np.linalg.norm(ways, axis=-1) / shortened
    return flat * stretch[..., None]


def _solved(fits: Fits, ridge: float) -> tuple[Floats, Floats]:
    """Weighted quadratics at their places [o, w, 6], and their least-squares inverses [o, 6, w].

    An inverse takes weighted heights to the coefficients of a quadratic.
    """
    u = fits.ways[..., 0]
    v = fits.ways[..., 1]
    terms = np.stack([np.ones_like(u), u, v, u * u / 2, u * v, v * v / 2], axis=-1)
    weighed = fits.weights[..., None] * terms
    ridges = np.diag(np.array([0.0, _RIDGE_SLOPE, _RIDGE_SLOPE, ridge, ridge, ridge]) ** 2)
    transposed = np.swapaxes(weighed, 1, 2)
    inverse = np.linalg.solve(transposed @ weighed + ridges, transposed)
    return weighed, inverse.astype(np.float64, copy=False)


def _curvature_weights(
    fits: Fits, stiff: Floats, poisson: float, ridge: float
) -> tuple[Floats, Floats]:
    """Weights of places in the three curvatures [o, 3, w], and the share that ridges leave, [o].

    The share is the least one of the three second derivatives. `stiff` [T] is D A of each texel
    [N m^3].
    """
    weighed, inverse = _solved(fits, ridge)
    second = inverse[:, 3:]
    left_shares: Floats = np.einsum("okw,owk->ok", second, weighed[:, :, 3:])
    uu, uv, vv = np.moveaxis(second * fits.weights[:, None], 1, 0)
    mean = np.sqrt((1 + poisson) / 2)
    difference = np.sqrt((1 - poisson) / 2)
    scale: Floats = np.sqrt(stiff[fits.texels]) / fits.spacings**2
    curved: Floats = np.stack(
        [mean * (uu + vv), difference * (uu - vv), 2 * difference * uv], axis=1
    )
    return curved * scale[:, None, None], left_shares.min(axis=1)


def _bending_rows(fits: Fits, stiff: Floats, poisson: float, ridge: float) -> tuple[Rows, Floats]:
    """The curvatures of fits as rows, and the share of each that ridges leave, [o]."""
    curved, left_share = _curvature_weights(fits, stiff, poisson, ridge)
    matrix = _row_matrix(curved, fits.columns, len(stiff))
    return Rows(matrix, np.repeat(fits.texels, KINDS)), left_share


def _misfit_rows(fits: Fits, rigidity: Floats) -> Rows:
    """The misfits of fits as rows: without a stiffness against them some patterns had no energy."""
    weighed, inverse = _solved(fits, _RIDGE_OUTSIDE)
    missed = np.eye(fits.weights.shape[1]) - weighed @ inverse
    total = np.linalg.norm(np.where(fits.columns >= 0, fits.weights, 0.0), axis=1)
    stiffness = np.sqrt(_MISFIT_STIFFNESS * rigidity[fits.texels]) / (total * fits.spacings)
    weights = missed * fits.weights[:, None] * stiffness[:, None, None]
    matrix = _row_matrix(weights, fits.columns, len(rigidity))
    return Rows(matrix, np.full(matrix.shape[0], -1))


def _row_matrix(weights: Floats, columns: Ints, count: int) -> csr_array:
    """Weights [o, k, w] of places as a matrix [o k, count], without the supports."""
    fit, row, place = np.nonzero((weights != 0) & (columns >= 0)[:, None])
    number = fit * weights.shape[1] + row
    shape = weights.shape[0] * weights.shape[1], count
    return csr_array((weights[fit, row, place], (number, columns[fit, place])), shape=shape)


def _clamp_rows(
    texels: TexelMesh, places: RimPlaces, rigidity: Floats, laplacian: csr_array
) -> Rows:
    """Rows beside a clamp: the Laplacian, and springs to the height that belongs to it.

    At a distance d from a clamp this height is d^2 / 2 times the second derivative.
    """
    areas = texels.areas.reshape(-1)
    clamped = places.conditions == CLAMPED
    beside = places.texels[clamped]
    ways = places.points[clamped] - texels.positions.reshape(-1, 3)[beside]
    away = np.linalg.norm(ways, axis=1)
    share = np.minimum(away**2 / (2 * areas[beside]), 0.5)
    heights = eye_array(len(areas), format="csr")[beside]
    spring_roots = diags_array(np.sqrt(_MISFIT_STIFFNESS * rigidity / areas)[beside])
    leaving = spring_roots @ (heights - diags_array(share) @ laplacian[beside])
    once = np.unique(beside)  # a texel in a corner lies beside two places
    bent = diags_array(np.sqrt(rigidity / areas)[once]) @ laplacian[once]
    return Rows(csr_array(vstack([leaving, bent])), np.concatenate([beside, once]))


def _evened(rows: Rows, laplacian: csr_array, stiff: Floats, areas: Floats) -> Floats:
    """Factors up to 1 of the bending of each texel, [T].

    A few tiny texels must not set the time step for all. A texel may be as fast as the fastest one
    of L B L, or as nearly all of the surface.
    """
    ones = np.ones(len(areas))
    size = abs(laplacian)
    closed = (size @ (stiff / areas**2 * (size @ ones)) / areas).max()
    pull = abs(rows.matrix)
    rate = pull.T @ (pull @ ones) / areas
    order = np.argsort(rate)
    covered = np.cumsum(areas[order])
    bulk = rate[order[np.searchsorted(covered, _BULK_SHARE * covered[-1])]]
    bound = _TOLERATED_RATE * max(closed, bulk)
    slowing = bound / np.maximum(rate, bound)
    entry = pull.tocoo()
    owner = rows.owners[entry.row]
    has_owner = owner >= 0
    factors = np.ones(len(areas))
    np.minimum.at(factors, owner[has_owner], slowing[entry.col[has_owner]])
    return factors


def _warn_of_softened(left_share: Floats, areas: Floats) -> None:
    """Warn if too many texels have less than their bending: `left_share` [T] of it is left."""
    share = areas[left_share < 1 - _MAX_TRUSTED_LOSS].sum() / areas.sum()
    if share > _MAX_UNTRUSTED_SHARE:
        warn_caller(
            f"the plate is softer than its material on {100 * share:.0f} % of its surface, where "
            "texels are too narrow to tell its curvature; frequencies may be too low: take a mesh "
            "of evener triangles, or a finer resolution"
        )


def _links_and_springs(matrix: csr_array) -> tuple[IrregularLinks, Floats]:
    """A symmetric stiffness matrix as links between texels, and springs to their places at rest."""
    above = triu(matrix, 1).tocoo()
    springs = matrix @ np.ones(matrix.shape[0])
    diagonal = matrix.diagonal()
    springs[np.abs(springs) <= _MIN_SPRING_SHARE * diagonal] = 0.0
    ends = np.stack([above.row, above.col], axis=1).astype(np.int64)
    return IrregularLinks.of(ends, -above.data), springs
