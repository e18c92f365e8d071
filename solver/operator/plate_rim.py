"""Rims of an open surface: what holds them, and the stiffness that a plate has there.

A plate's energy is D / 2 times the integral of (1 - nu) |H|^2 + nu (tr H)^2 = (tr H)^2 - 2 (1 - nu) det H, with the
rigidity D, Poisson's ratio nu and the second derivatives H of its height. Where neither its value nor its slope is
held at a rim, that alone makes the rim's natural conditions: no moment, no shear force.

Inside, L B L is the first term, and det H is a divergence: its integral over a region is the area that the gradient
goes round along the border. Beside rims L is not the Laplacian, unless the slope is 0. There, and where texels are
softened, quadratics fitted to the heights around give H, and a stiffness against what they miss keeps the rest from
moving freely.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array, diags_array, eye_array, triu, vstack

from ..errors import SolverError, shown
from ..kernel import Floats, Ints
from ..texels.stencil import IrregularLinks, Stencil, stiffness_matrix
from ..texels.texel_mesh import TexelMesh
from ..texels.topology import TRIANGLE

# Waves come back upright from a free rim, inverted from one that is held. "fixed": heights and, of a plate, L h are 0.
RIMS = ("free", "supported", "clamped", "fixed")

FREE, SUPPORTED, CLAMPED = 1, 2, 3

# A name for all of the rim, or a function of its points [k, 3]: a name for each, or whether it is clamped, else free.
Rim: TypeAlias = str | Callable[[NDArray[np.float64]], ArrayLike]

_MISFIT = 8.0  # stiffness against what a fit misses, and against leaving a clamp, in D / A
_HEAVY = 30.0  # weight of a support in a fit; a texel's is 1 at most
_REACH = 1.5  # spacings up to which supports count
_RIDGE = 0.03  # weight with which second derivatives are 0; all of a fit's texels have about 0.5
_TINY = 1e-9


def rim_conditions(texels: TexelMesh, rim: Rim) -> NDArray[np.int8]:
    """What each place beyond a rim is, [C, n + 2, n + 2]: `FREE`, `SUPPORTED` or `CLAMPED`; 0 elsewhere.

    Raises
    ------
    SolverError
        For an unknown name, or a function whose result is neither a name nor a bool for each point.
    """
    valid = f"valid are {', '.join(map(repr, RIMS))}"
    conditions = np.zeros(texels.topology.halo.shape, np.int8)
    at = texels.topology.rim
    if isinstance(rim, str):
        if rim not in RIMS:
            raise SolverError(f"rim {rim!r} does not exist; {valid}")
        conditions[at] = RIMS.index(rim) + 1 if rim != "fixed" else SUPPORTED
        return conditions
    if not callable(rim):
        raise SolverError(f"rim {shown(rim)} is no name; {valid}, or a function of points [k, 3] that gives them")
    points = texels.halo_positions[at]
    points = np.where(np.isfinite(points), points, texels.positions.reshape(-1, 3)[texels.topology.halo[at]])
    found = np.asarray(rim(points))
    if found.shape != (len(points),) or found.dtype.kind not in "bU":
        raise SolverError(
            f"the function of the rim gives {found.dtype} of shape {found.shape} for {len(points)} points; valid are "
            "a name or a bool for each: 'free', 'supported' or 'clamped', or whether it is clamped"
        )
    if found.dtype.kind == "b":
        found = np.where(found, "clamped", "free")
    wrong = found[~np.isin(found, RIMS[:3])]
    if len(wrong):
        raise SolverError(f"the function of the rim gives {str(wrong[0])!r}; valid are 'free', 'supported', 'clamped'")
    conditions[at] = sum((k + 1) * (found == name) for k, name in enumerate(RIMS[:3]))
    return conditions


# Places next to a texel, beyond each side of a chart: slices of the halo, and of the texels along it.
_SIDES = (
    (np.s_[:, 0, 1:-1], np.s_[:, 0]),
    (np.s_[:, 1:-1, -1], np.s_[:, :, -1]),
    (np.s_[:, -1, 1:-1], np.s_[:, -1]),
    (np.s_[:, 1:-1, 0], np.s_[:, :, 0]),
)


class RimPlaces(NamedTuple):
    """Places beside texels, beyond a rim, k of them.

    Attributes
    ----------
    texels : int64 [k]
        Flat index of the texel beside.
    conditions : int8 [k]
    points : float64 [k, 3]
        On the rim [m]; the texel's own centre where the surface ends in it.
    lengths : float64 [k]
        Of the rim that belongs to the place [m].
    """

    texels: Ints
    conditions: NDArray[np.int8]
    points: Floats
    lengths: Floats


def rim_places(texels: TexelMesh, conditions: NDArray[np.int8]) -> RimPlaces:
    """The places where texels lie beside a rim."""
    topology, around = texels.topology, texels.halo_positions
    found = []
    for outside, inside in _SIDES:
        at = conditions[outside] > 0
        points = np.where(np.isfinite(around[outside]), around[outside], texels.positions[inside])
        # ends of a side count one-sided
        along = np.concatenate([points[:, :1], points, points[:, -1:]], axis=1)
        lengths = np.linalg.norm(along[:, 2:] - along[:, :-2], axis=-1)
        lengths[:, 1:-1] /= 2
        found.append((topology.halo[outside][at], conditions[outside][at], points[at], lengths[at]))
    return RimPlaces(*(np.concatenate(each) for each in zip(*found, strict=True)))


def plate_cells(texels: TexelMesh) -> tuple[Ints, Ints, list[csr_array]]:
    """The cells of a texel mesh, with their gradients.

    Returns
    -------
    pairs : int64 [p, 2]
        Texels that share a cell.
    edges : int64 [e, 4]
        Texels i, j of each edge between two cells, the cell on its right, and that on its left.
    gradients : list of csr [cells, T], three
        From heights to the components of the gradient in space [1/m].
    """
    topology, points = texels.topology, texels.positions.reshape(-1, 3)
    halo, count = np.where(topology.rim, -1, topology.halo), topology.texel_count
    quads = np.stack([halo[:, :-1, :-1], halo[:, :-1, 1:], halo[:, 1:, 1:], halo[:, 1:, :-1]], axis=-1)
    corner, chart = np.nonzero(topology.valence.T == TRIANGLE)
    triangles = quads[:, [0, 0, -1, -1], [0, -1, -1, 0]][chart, corner]  # a place of theirs shows nothing
    # corners of all cells between texels, counter-clockwise, [k, m] for each number of corners m
    kinds = [quads[(quads >= 0).all(axis=-1)], triangles[triangles >= 0].reshape(-1, 3)]
    numbers = sorted({len(each) for each in topology.polygons})
    kinds += [np.array([each for each in topology.polygons if len(each) == m]) for m in numbers]
    pairs, entries, cells = [], [], 0
    for corners in filter(len, kinds):
        # those across a glued side come once from each chart
        corners = corners[np.unique(np.sort(corners, axis=1), axis=0, return_index=True)[1]]
        x, m = points[corners], corners.shape[1]
        after, before = np.roll(x, -1, axis=1), np.roll(x, 1, axis=1)
        area = np.cross(x, after).sum(axis=1) / 2
        # along the boundary the outward normal is the side turned by the cell's own
        turned = np.cross(after - before, area[:, None]) / (2 * (area**2).sum(axis=1))[:, None, None]
        number, following = np.repeat(cells + np.arange(len(corners)), m), np.roll(corners, -1, axis=1)
        cells += len(corners)
        pairs += [corners[:, [a, b]] for a in range(m) for b in range(a)]
        entries.append((number, corners.ravel(), following.ravel(), turned.reshape(-1, 3)))
    cell, start, end, turned = (np.concatenate(each) for each in zip(*entries, strict=True))
    gradients = [csr_array((turned[:, k], (cell, start)), shape=(cells, count)) for k in range(3)]
    # the cell on whose border an edge runs counter-clockwise lies on its left
    key, back = start * count + end, end * count + start
    order = np.argsort(key)
    other = order[np.searchsorted(key[order], back).clip(0, len(key) - 1)]
    both = (key[other] == back) & (start < end)
    return np.concatenate(pairs), np.column_stack([start, end, cell[other], cell])[both], gradients


def fitted_rows(
    texels: TexelMesh, outer: Ints, pairs: Ints, places: RimPlaces, rigidity: Floats, poisson: float
) -> tuple[csr_array, Ints]:
    """Rows whose squares add up to the energy of quadratics fitted to the heights around some texels [o].

    Least-squares fits to those of two rings, which `pairs` of texels that share a cell make, and to supports: heavy
    rows of value 0. Texels count by their areas, so that needles do not stiffen. Ways are taken in the tangent plane,
    as long as they are in space. `rigidity` is that of all texels, [T].

    Returns
    -------
    rows : csr [r, T]
    owners : int64 [r]
        To which of the texels a row of bending belongs; -1 for those of the misfit.
    """
    count, size, index = len(rigidity), len(outer), np.arange(len(outer))
    points, areas = texels.positions.reshape(-1, 3), texels.areas.reshape(-1)
    both = np.concatenate([pairs, pairs[:, ::-1], np.arange(count)[:, None].repeat(2, axis=1)])
    near = csr_array((np.ones(len(both)), both.T), shape=(count, count))
    rings = (near[outer] @ near > 0).astype(np.float64)
    spacing = np.sqrt((rings @ areas) / rings.sum(axis=1))
    held = np.flatnonzero(places.conditions != FREE)
    beside = csr_array((np.ones(len(held)), (places.texels[held], held)), shape=(count, len(places.points)))
    # the texels first, then the supports
    owner, other = (np.concatenate(each) for each in zip(rings.nonzero(), (rings @ beside).nonzero(), strict=True))
    support = np.arange(len(owner)) >= rings.nnz
    ends = np.concatenate([points[other[~support]], places.points[other[support]]])
    ways = (ends - points[outer[owner]]) / spacing[owner, None]
    lengths = np.linalg.norm(ways, axis=1)
    weight = np.sqrt(areas[np.where(support, 0, other)]) / spacing[owner] * np.exp(-(lengths**2) / 2)
    weight = np.where(support, _HEAVY * (lengths <= _REACH), weight)
    # along any direction in the tangent plane, and across it
    normals = texels.normals.reshape(-1, 3)[outer]
    first = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    u, v = (np.einsum("ij,ij->i", axis[owner], ways) for axis in (first, np.cross(normals, first)))
    stretch = lengths / np.maximum(np.hypot(u, v), _TINY)
    u, v = stretch * u, stretch * v
    # a block of rows for each fit, as many as the largest has
    order = np.argsort(owner, kind="stable")
    owner, other, support, weight, u, v = (each[order] for each in (owner, other, support, weight, u, v))
    slot = np.arange(len(owner)) - np.searchsorted(owner, index)[owner]
    width = int(slot.max(initial=0)) + 1
    terms, weights, column = np.zeros((size, width, 6)), np.zeros((size, width)), np.full((size, width), -1)
    terms[owner, slot] = np.stack([np.ones_like(u), u, v, u * u / 2, u * v, v * v / 2], axis=1)
    weights[owner, slot], column[owner, slot] = weight, np.where(support, -1, other)
    weighed = weights[..., None] * terms
    # of weighed heights, [o, 6, width]; what hardly tells a second derivative leaves it at 0
    ridge = np.broadcast_to(_RIDGE * np.eye(6)[3:], (size, 3, 6))
    inverse = np.linalg.pinv(np.concatenate([weighed, ridge], axis=1), rcond=_TINY)[..., :width]
    missed = np.eye(width) - weighed @ inverse
    bent = inverse[:, 3:] * np.sqrt(areas[outer] / spacing**4)[:, None, None]
    total = np.linalg.norm(np.where(column >= 0, weights, 0.0), axis=1)[:, None, None] * spacing[:, None, None]
    energies = [
        np.sqrt(1 - poisson) * np.array([1.0, np.sqrt(2.0), 1.0])[:, None] * bent,
        np.sqrt(poisson) * (bent[:, :1] + bent[:, 2:]),
        np.sqrt(_MISFIT) * missed / total,
    ]
    rows = np.concatenate(energies, axis=1) * weights[:, None] * np.sqrt(rigidity[outer])[:, None, None]
    o, row, k = np.nonzero((rows != 0) & (column >= 0)[:, None])
    matrix = csr_array((rows[o, row, k], (o * (width + 4) + row, column[o, k])), shape=(size * (width + 4), count))
    return matrix, np.where(np.arange(width + 4) < 4, index[:, None], -1).ravel()


def tension_springs(places: RimPlaces, texels: TexelMesh, tension: Floats) -> Floats:
    """Springs by which a stretched surface is tied to the rims that hold it [N/m], [T]; `tension` [N/m] is [T]."""
    way = np.linalg.norm(places.points - texels.positions.reshape(-1, 3)[places.texels], axis=1)
    way[(places.conditions == FREE) | (way == 0)] = np.inf
    pull = tension[places.texels] * places.lengths / way
    return np.bincount(places.texels, pull, len(tension)).astype(np.float64)


def plate_matrix(
    texels: TexelMesh, places: RimPlaces, softening: Floats, rigidity: Floats, poisson: float, laplace: Stencil
) -> tuple[IrregularLinks, Floats, NDArray[np.bool_]]:
    """What bending adds to L B L beside rims: a matrix [kg/s^2], symmetric, with L B L positive semidefinite.

    Parameters
    ----------
    texels : TexelMesh
    places : RimPlaces
    softening : float64 [C, n, n]
        That of `laplace`.
    rigidity : float64 [C, n, n]
        D [N m].
    poisson : float
    laplace : Stencil
        L, of free rims.

    Returns
    -------
    links : IrregularLinks
    springs : float64 [T]
        From each texel to where it is at rest [N/m].
    inner : bool [C, n, n]
        Where L B L holds; elsewhere B is to be 0.
    """
    count = texels.topology.texel_count
    D, areas, soft = rigidity.reshape(-1), texels.areas.reshape(-1), softening.reshape(-1) < 1
    L = -stiffness_matrix(laplace)
    pairs, edges, gradients = plate_cells(texels)
    clamped = places.conditions == CLAMPED
    outer = np.zeros(count, bool)
    outer[places.texels[~clamped]] = True
    outer[places.texels[clamped]] = False
    first, second = pairs.T
    outer[np.concatenate([np.flatnonzero(soft), first[soft[second]], second[soft[first]]])] = True
    at, held = np.flatnonzero(outer), places.texels[clamped]
    rows, owners = fitted_rows(texels, at, pairs, places, D, poisson)
    # beside a clamp the height is d^2 / 2 times its second derivative
    way = np.linalg.norm(places.points[clamped] - texels.positions.reshape(-1, 3)[held], axis=1)
    share = np.minimum(way**2 / (2 * areas[held]), 0.5)
    own = eye_array(count, format="csr")[held]
    leaving = diags_array(np.sqrt(_MISFIT * D / areas)[held]) @ (own - diags_array(share) @ L[held])
    rows = csr_array(vstack([rows, leaving]))
    owners = np.concatenate([owners, len(at) + np.arange(len(held))])
    total = rows.T @ diags_array(_evened(rows, owners, L, D, areas)) @ rows
    saddle = _saddle(texels.normals.reshape(-1, 3), edges, gradients, 2 * (1 - poisson) * D * ~outer)
    matrix = csr_array(total + saddle)
    above = triu(matrix, 1).tocoo()
    springs, diagonal = matrix @ np.ones(count), matrix.diagonal()
    springs[np.abs(springs) <= _TINY * diagonal] = 0.0  # sums that are round-off are no springs
    links = IrregularLinks.of(np.stack([above.row, above.col], axis=1).astype(np.int64), -above.data)
    return links, springs, ~outer.reshape(texels.shape)


def _evened(rows: csr_array, owners: Ints, laplace: csr_array, rigidity: Floats, areas: Floats) -> Floats:
    """Factors up to 1 of rows with owners: those of tiny texels must not set the time step for all."""
    size = abs(laplace)
    usual = (size @ (rigidity / areas * (size @ np.ones(len(areas)))) / areas).max()
    pull = abs(rows)
    rate = pull.T @ (pull @ np.ones(len(areas))) / areas
    entry = pull.tocoo()
    factor = np.ones(int(owners.max(initial=-1)) + 2)
    np.minimum.at(factor, owners[entry.row], (usual / np.maximum(rate, usual))[entry.col])
    factor[-1] = 1.0  # of what has no owner
    return factor[owners]


def _saddle(normals: Floats, edges: Ints, gradients: list[csr_array], factor: Floats) -> csr_array:
    """Minus the integral of a factor [T] times det H: only the edges count across which it changes."""
    i, j, right, left = edges.T
    jump = factor[i] - factor[j]
    crossed = np.abs(jump) > _TINY * np.abs(factor).max(initial=0.0)
    i, j, right, left, jump = (each[crossed] for each in (i, j, right, left, jump))
    normal = normals[i] + normals[j]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), _TINY)
    total = csr_array((len(factor), len(factor)))
    for k in range(3):
        share = diags_array(-jump * normal[:, k] / 4)
        a, b = gradients[(k + 1) % 3], gradients[(k + 2) % 3]
        wedge = a[right].T @ share @ b[left] - b[right].T @ share @ a[left]
        total = total + wedge + wedge.T
    return csr_array(total)
